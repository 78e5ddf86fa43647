"""What captions of the compression report answer, read from the findings; '' where there is nothing to tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.errors import counted
from pipeline.rigs.in_words import known, span

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.findings import Findings, Parameter

_WHITE = 0.99  # share of independent samples from which nothing is said of a pattern
_ROUNDED = 0.6  # of a gauge's step: what rounding and the error of the motion explain


def place(p: Parameter) -> str:
    """Name the coil current of a parameter, else its run."""
    value = p.at.get("coil_current")
    return f"{value:g} A" if isinstance(value, float | int) else str(p.at.get("run", "all"))


def followed(runs: pd.DataFrame) -> str:
    """Say how much of the force the model misses, and of which run most."""
    worst = runs.iloc[int(runs["nrmse"].argmax())]
    run = f", run {worst['run']}" if len(runs) > 1 else ""
    return f"It misses {'at most ' if run else ''}{100 * worst['nrmse']:.2g} % of the force (rms{run})."


def theory_beside(findings: Findings) -> str:
    """Say how far the secant stiffness without field lies from theory."""
    theory = findings.arrays.get("theory")
    p = next((p for p in findings.find("stiffness_secant", coil_current=0.0) if p.value is not None), None)
    if theory is None or len(theory) != 1 or p is None or p.value is None:
        return ""
    off = 100 * (p.value / float(theory["stiffness"].iloc[0]) - 1)
    return f"At 0 A the secant lies {abs(off):.2g} % {'above' if off > 0 else 'below'} it."


def noise(runs: pd.DataFrame) -> str:
    """Say whether what the model leaves is independent from sample to sample."""
    rms = f"{span(runs['residual'], _decimals(runs['residual'].max()), 'N')} (rms)"
    share = runs["effective"] / runs["samples"]
    if share.min() >= _WHITE:
        return f"It looks so: {rms}, independent from sample to sample."
    row = runs.iloc[int(share.argmin())]
    return (
        f"Not only: neighbours are alike, most in run {row['run']}, whose {row['samples']:.0f} samples count as "
        f"{row['effective']:.0f}. {rms[0].upper()}{rms[1:]}."
    )


def stiffened(findings: Findings) -> str:
    """Say by how much the field stiffens at the largest current, in both definitions."""
    told: dict[str, list[str]] = {}
    for name, by in (("stiffening_secant", "by the secant"), ("stiffening_slope", "by the slope")):
        found = [p for p in findings.find(name) if p.value is not None]
        if found:
            p = max(found, key=lambda p: float(p.at["coil_current"]))
            told.setdefault(place(p), []).append(f"{known(p, 0.01, '%')} {by}")
    if told:
        return " ".join(f"At {at} by {' and '.join(numbers)}." for at, numbers in told.items())
    left = findings.find("stiffening_secant")
    return (
        f"Not told: {_reason(left[0])}." if left else "Not told: there is no pair of a run at 0 A and one with current."
    )


def lost(findings: Findings) -> str:
    """Say how much of the loading work is lost, at the least and at the largest current."""
    return _at_ends(findings, "loss_ratio", 0.01, "%", "Of the loading work {} are lost")


def definitions(findings: Findings) -> str:
    """Say how far the two stiffnesses lie apart."""
    pairs = {(p.name, place(p)): p.value for p in findings.parameters if p.value is not None}
    apart = [
        100 * (value / pairs["stiffness_slope", at] - 1)
        for (name, at), value in pairs.items()
        if name == "stiffness_secant" and ("stiffness_slope", at) in pairs
    ]
    return f"The secant lies {span(apart, 1, '%')} above the slope." if apart and min(apart) > 0 else ""


def hysteresis(findings: Findings) -> str:
    """Say how large the hysteretic force is, and over which displacement it builds up."""
    told = _at_ends(findings, "alpha", 1.0, "N", "Hysteresis reaches alpha = {}")
    yields = [1e6 / p.value for p in findings.find("rho") if p.value is not None]
    most = max(yields, default=0.0)
    return f"{told} It builds up over 1/rho = {span(yields, _decimals(most), 'µm')}." if told and yields else told


def motion(runs: pd.DataFrame) -> str:
    """Say how the pad was moved, and whether every sample counts."""
    kinds = runs["motion"].value_counts()
    ways = " and ".join(f"{kind} in {counted(int(n), 'run')}" for kind, n in kinds.items())
    rates = 1e6 * runs["rate"].abs()
    least = runs.iloc[int((runs["effective"] / runs["samples"]).argmin())]
    count = (
        "every sample counts"
        if least["effective"] >= _WHITE * least["samples"]
        else f"of run {least['run']} {least['effective']:.0f} of {least['samples']:.0f} samples count"
    )
    return f"Motion: {ways}, {span(rates, _decimals(rates.max()), 'µm/s')}; {count}."


def between_steps(off: np.ndarray, step: float, run: str) -> str:
    """Say how far the reading of the gauge is from the motion, beside half of its step (m)."""
    most = float(np.nanmax(np.abs(off)))
    half = f"half a step (dashed) is {1e6 * step / 2:.3g} µm"
    if most <= _ROUNDED * step:
        return f"Yes, within rounding: the reading of {run} is at most {1e6 * most:.2g} µm off it; {half}."
    part = float(np.nanmean(np.abs(off) > _ROUNDED * step))
    return (
        f"Not everywhere: the reading of {run} is up to {1e6 * most:.2g} µm off it, {100 * part:.2g} % of the samples by more than "
        f"rounding explains; {half}."
    )


def _at_ends(findings: Findings, name: str, size: float, unit: str, words: str) -> str:
    """Return a sentence with the first and the last number that was determined."""
    found = [p for p in findings.find(name) if p.value is not None]
    if not found:
        left = findings.find(name)
        return f"Not told: {_reason(left[0])}." if left else ""
    ends: Sequence[Parameter] = found[:1] if len(found) == 1 else (found[0], found[-1])
    return words.format(", ".join(f"{known(p, size, unit)} at {place(p)}" for p in ends)) + "."


def _reason(p: Parameter) -> str:
    return p.description.partition(": ")[2].rstrip(".") or p.description.rstrip(".")


def _decimals(value: float) -> int:
    """Return the decimals of three digits."""
    return max(0, 2 - math.floor(math.log10(abs(value)))) if value and math.isfinite(value) else 0
