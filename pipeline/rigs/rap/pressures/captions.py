"""What the figures and tables of `rap.pressures` answer, in words computed from the tables that they draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings import Findings, Parameter
from pipeline.rigs.rap.conditions import TAP_NAMES, TAPS
from pipeline.rigs.rap.pressures.declaration import MMHG
from pipeline.rigs.rap.wording import grouped, holding, joined, plus_minus, signed, told

if TYPE_CHECKING:
    import pandas as pd

# m3/(s Pa) in 1 mL/h/mmHg (rap.md, section 1).
K_UNIT = 2.0835e-12
_CIRCUIT = {"r_access": "access", "r_filter": "filter", "r_return": "return line", "k_uf": "membrane"}


def overlay(rows: pd.DataFrame, checks: pd.DataFrame) -> str:
    """Return how large the difference is that is drawn, and at which taps a line of the pump is left in it."""
    rms = [
        f"{np.sqrt(np.mean(np.square(rows[rows['channel'] == tap]['residual']))):.0f} Pa at {TAP_NAMES.get(tap, tap)}"
        for tap in dict.fromkeys(rows["channel"])
    ]
    lines = checks[checks["name"] == "residual_line"]
    left = [TAP_NAMES.get(tap, tap) for tap in lines[lines["exceeds"].astype(bool)]["channel"]]
    line = f"a line of the pump is left at {joined(left)}" if left else "no line of the pump is left"
    return f"What is left is {joined(rms)} (rms); {line if len(lines) else 'whether a line of the pump is left was not told'}."


def clock(findings: Findings, run: str) -> str:
    """Return lag and rate of the clock with their 95 % intervals."""
    lag, rate = (told(_of(findings, name, run), size, unit) for name, size, unit in (("lag", 1.0, "s"), ("clock_rate", 1e-6, "ppm")))  # fmt: skip
    parts = [f"the lag at mid-run is {lag}" if lag else "", f"the device's clock is off by {rate}" if rate else ""]
    said = joined([part for part in parts if part])
    return f" {said[0].upper()}{said[1:]}." if said else ""


def gains(table: pd.DataFrame, run: str) -> str:
    """Return the span of gains and offsets of a run and how they stand to the tolerances."""
    own = table[(table["run"] == run) & table["gain"].notna()]
    if own.empty:
        return "They could not be told."
    names = [TAP_NAMES.get(str(tap), str(tap)) for tap in own["channel"]]
    words = [grouped(zip(names, own[f"{name}_word"], strict=True), "every tap") for name in ("gain", "offset")]
    return (
        f"Gains of {own['gain'].min():.4f} to {own['gain'].max():.4f} and offsets of {signed(own['offset'].min(), 1)} to "
        f"{signed(own['offset'].max(), 1)} Pa. Beside their tolerances, gains lie {words[0]}, offsets {words[1]}."
    )


def lines(rows: pd.DataFrame) -> str:
    """Return how many lines of the pump hold eq. (2) within their errors."""
    within, of = holding(rows["ratio"] - rows["model"], 1.96 * rows["sd"])
    return f"{within} of {of} lines hold eq. (2) within their 95 % interval, as 95 % of them should."


def agreement(limits: pd.DataFrame) -> str:
    """Return between which limits 95 % of the readings lie, tap by tap."""
    own = limits[limits["kind"] == "samples"]
    found = [
        f"{signed(low / MMHG, 2)} to {signed(high / MMHG, 2)} mmHg at {TAP_NAMES.get(str(tap), str(tap))}"
        for tap, low, high in zip(own["channel"], own["lower"], own["upper"], strict=True)
    ]
    return f"95 % of single readings differ from the bench's by {joined(found)}." if found else ""


def equalised(limits: pd.DataFrame) -> str:
    """Return what making clocks and bandwidth equal is worth: half widths of both kinds, over all taps."""
    half = {kind: 0.5 * (own["upper"] - own["lower"]) / MMHG for kind, own in limits.groupby("kind")}
    if "samples" not in half or "as logged" not in half:
        return ""
    before, after = half["as logged"], half["samples"]
    return (
        f"Equalising takes the half widths from {before.min():.2f} to {before.max():.2f} mmHg down to {after.min():.2f} to {after.max():.2f} mmHg."
        if after.max() < before.max()
        else "Equalising does not narrow them."
    )


def coherent(rows: pd.DataFrame) -> str:
    """Return up to which harmonic the coherence stands above chance at every set-point, tap by tap."""
    found = []
    for tap in [tap for tap in TAPS if (rows["channel"] == tap).any()]:
        one = rows[rows["channel"] == tap]
        seen = (one["coherence"] > one["threshold"]).groupby(one["harmonic"]).all()
        order = 0
        while bool(seen.get(order + 1, False)):
            order += 1
        found.append((TAP_NAMES[tap], f"up to k = {order}" if order else "at none"))
    return f"At every set-point {grouped(found, 'every tap')}."


def checks(table: pd.DataFrame) -> str:
    """Return how many checks are beyond their limits, and which."""
    beyond = table[table["exceeds"].astype(bool)]
    if beyond.empty:
        return f"None of the {len(table)} is beyond its limit."
    names = [_CIRCUIT.get(str(one), TAP_NAMES.get(str(one), str(one))) for one in beyond["channel"]]
    return f"{len(beyond)} of {len(table)} are beyond: see {joined(list(dict.fromkeys(names)))}."


def constant(table: pd.DataFrame, run: str) -> str:
    """Return how the resistances change over the flow and within the run."""
    own = table[(table["run"] == run) & table["name"].isin(("resistance_over_flow", "resistance_trend"))]
    over = [
        f"{plus_minus(100 * value, 196 * sd, '%', sign=True)} ({_CIRCUIT[str(name)]})"
        for name, value, sd, what in zip(own["channel"], own["value"], own["std_error"], own["name"], strict=True)
        if what == "resistance_over_flow"
    ]
    if not over:
        return "One flow alone cannot tell."
    bad = [_CIRCUIT[str(name)] for name in dict.fromkeys(own[own["exceeds"].astype(bool)]["channel"])]
    return (
        f"From lowest to highest flow they change by {joined(over)}; "
        f"{f'beyond what is allowed: {joined(bad)}' if bad else 'none changes beyond what is allowed, over flow or time'}."
    )


def filtered(findings: Findings, rows: pd.DataFrame, curve: pd.DataFrame, run: str) -> str:
    """Return compliance and inertance found, and how many ratios hold eq. (4)."""
    C, L = (
        told(_of(findings, "c_return", run), 1e-12, "10⁻¹² m³/Pa"),
        told(_of(findings, "l_return", run), 1e6, "MPa s²/m³"),
    )
    if curve.empty or not C or not L:
        return "These ratios do not tell it."
    expected = np.interp(rows["frequency"], curve["frequency"], curve["size"])
    within, of = holding(rows["size"] - expected, 1.96 * rows["sd"])
    return f"With C₂ = {C} and L_r = {L}, {within} of {of} ratios hold eq. (4) in size within their 95 % interval, as 95 % of them should."


def membrane(findings: Findings, run: str, steps: pd.DataFrame) -> str:
    """Return the membrane's coefficient and how far the steps with ultrafiltration lie apart."""
    K = told(_of(findings, "k_uf", run), K_UNIT, "mL/h/mmHg")
    if not K:
        return "The run does not tell."
    apart = f"; the {len(steps)} steps lie within {100 * (steps['k_uf'].max() / steps['k_uf'].min() - 1):.2g} % of each other" if len(steps) > 1 else ""  # fmt: skip
    return f"It passes {K}{apart}."


def _of(findings: Findings, name: str, run: str) -> Parameter | None:
    return next((p for p in findings.find(name) if p.at.get("run", run) == run), None)
