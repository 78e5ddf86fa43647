"""What captions of the report of `mre.hold` answer, read from the findings; '' where there is nothing to tell."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pipeline.rigs.in_words import known

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.findings import Findings, Parameter

_EXPLAINED = 0.1  # of the difference between the sweeps that the law may leave
_SWEEPS = {"up": "rising", "down": "falling"}


def of_run(findings: Findings, name: str, run: str) -> list[Parameter]:
    """Return the parameters of that name that a run has, or the campaign of one run."""
    return [p for p in findings.find(name) if p.at.get("run", run) == run]


def law_refused(findings: Findings, state: Mapping[str, object]) -> str:
    """Say why no number rests on the law of a run; '' where the law holds, whether or not saturation was seen."""
    p = next(iter(of_run(findings, "saturation_current", str(state["run"]))), None)
    open_as_told = state["state"] != "seen" and p is not None and p.description.startswith("saturation")
    return "" if p is None or p.value is not None or open_as_told else p.description.rstrip(".")


def saturates(findings: Findings, state: Mapping[str, object]) -> str:
    """Say whether the force saturates, and where."""
    refused = law_refused(findings, state)
    if refused:
        return f"Not told: {refused}."
    top, flat = float(str(state["top"])), 100 * float(str(state["flatness"]))
    if state["state"] == "seen":
        bend = known(of_run(findings, "saturation_current", str(state["run"]))[0], 1.0, "A")
        return f"Yes: it bends at I_s = {bend}; at {top:.3g} A the slope is {flat:.2g} % of that at 0 A."
    if state["state"] == "begun":
        return (
            f"Saturation has begun and was not passed: at {top:.3g} A the slope is still {flat:.2g} % of that at 0 A."
        )
    return f"Saturation was not reached: up to {top:.3g} A the force rises straight."


def relaxes(findings: Findings, run: str, holds: pd.DataFrame) -> str:
    """Say how far the sweeps are apart, how much of the force relaxes, and what the law leaves of the holds then."""
    p = next(iter(of_run(findings, "relaxation", run)), None)
    if p is None:
        return ""
    if p.value is None:
        return f"Not told: {p.description.rstrip('.')}."
    left = float(np.sqrt((holds["residual"] ** 2).mean()))
    level = holds["current"].round(1)
    up, down = (holds["force"].groupby(level.where(holds["direction"] == sign)).mean() for sign in (1, -1))
    apart = (up - down).abs().max()
    rest = f"r = {known(p, 0.01, '%')} a decade leaves {left:.2g} N (rms)."
    if not math.isfinite(apart):
        return f"There is one sweep only; {rest}"
    return f"{'Yes' if left < _EXPLAINED * apart else 'Not all of it'}: of up to {apart:.2g} N between them {rest}"


def raised(findings: Findings, run: str) -> str:
    """Say by how much the largest current raises the force."""
    found = of_run(findings, "force_increment", run)
    told = [p for p in found if p.value is not None]
    if told:
        p = max(told, key=lambda p: float(p.at["coil_current"]))
        return f"At {float(p.at['coil_current']):g} A by {known(p, 0.01, '%')}."
    return f"Not told: {found[0].description.rstrip('.')}." if found else ""


def magnetised(findings: Findings, run: str) -> str:
    """Say to which limit the flux density tends and what remains without current."""
    said = []
    limit = next(iter(of_run(findings, "flux_saturation", run)), None)
    if limit is not None and limit.value is not None:
        said.append(f"It tends to B_s = {known(limit, 1e-3, 'mT')}.")
    elif limit is not None:
        said.append(f"Saturation is not told: {limit.description.rstrip('.')}.")
    remains = [
        f"{known(p, 1e-3, 'mT')} {_SWEEPS.get(str(p.at.get('sweep')), '')}".rstrip()
        for p in of_run(findings, "remanence", run)
        if p.value is not None
    ]
    return " ".join([*said, f"At 0 A remain {', '.join(remains)}."] if remains else said)


def pressed(table: pd.DataFrame, rise: tuple[float, float] | None) -> str:
    """Say whether the pull of the poles could be what the load cell saw; `rise` is a current (A) and the rise of the force there (N)."""
    bound, blank = table[table["kind"] == "bound"], table[table["kind"] != "bound"]
    beside = "" if rise is None else f", the pad's force rises by {rise[1]:.3g} N"
    if len(blank):
        row = blank.iloc[int(blank["current"].argmax())]
        return f"Both: the blank test shows {row['pull']:.3g} N at {row['current']:.3g} A{beside}. What it measured was taken off the force."
    unknown = "No blank test was run: how much of it the load cell sees is not known, and none was taken off."
    if bound.empty or rise is None:
        return f"Not told. {unknown}"
    most = float(np.interp(rise[0], bound["current"], bound["pull"]))
    if not math.isfinite(most):
        return f"Not told. {unknown}"
    could = "could be all of" if most >= rise[1] else "is less than"
    return f"Not told: at {rise[0]:.3g} A the poles pull with up to {most:.3g} N, which {could} the {rise[1]:.3g} N by which the force rises. {unknown}"
