"""What captions of the report of `mre.step` answer, read from the findings; '' where there is nothing to tell."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pipeline.rigs.in_words import known, span

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.findings import Findings, Parameter

DIRECTIONS = ("rise", "fall")
_SHORT = {"delay": "L", "time_constant_2": "tau_2"}
_SAME_LEVEL = 0.02  # of the largest level, in which two levels are one
_ALIKE = 2.0  # standard errors


def followed(steps: pd.DataFrame) -> str:
    """Say what the model leaves of the force of one run, beside its largest step."""
    rms, change = float(steps["rms_residual"].iloc[0]), float(steps["change"].abs().max())
    share = f", {100 * rms / change:.2g} % of the largest step" if change > 0 else ""
    return f"It leaves {rms:.2g} N (rms){share}."


def answered(findings: Findings, run: str) -> str:
    """Say after which time 63 % of the change is there in a run, by direction, and how many times slower one is."""
    times = {str(p.at["direction"]): p for p in findings.find("t63") if p.at.get("run", run) == run}
    told = {d: p for d, p in times.items() if p.value is not None}
    said = [f"{_time(p)} in the {d}" for d, p in told.items()]
    parts = [f"63 % of the change takes t_63 = {' and '.join(said)}."] if said else []
    parts += [_not_told("t_63", d, p) for d, p in times.items() if d not in told]
    if len(told) == 2:
        rise, fall = (told[d].value or 0.0 for d in DIRECTIONS)
        parts.append(f"The fall takes {fall / rise:.3g} times as long." if rise > 0 else "")
    return " ".join(part for part in parts if part)


def slowed(findings: Findings) -> str:
    """Say which larger lag each direction has, and whether the shorter times differ between them."""
    lags = [(str(p.at["direction"]), p) for p in findings.find("time_constant_1")]
    said, parts = [], []
    for direction in DIRECTIONS:
        own = [p for d, p in lags if d == direction]
        told = [p for p in own if p.value is not None]
        if len(told) == 1:
            said.append(f"{_time(told[0])} in the {direction}")
        elif told:
            said.append(f"{span((1e3 * (p.value or 0.0) for p in told), 1, 'ms')} in the {direction}")
        elif own:
            parts.append(_not_told("tau_1", direction, own[0]))
    for verb, differ in (("alike in rise and fall", False), ("not alike in rise and fall", True)):
        symbols = [symbol for name, symbol in _SHORT.items() if _differs(findings, name) is differ]
        parts += [f"{' and '.join(symbols)} {'is' if len(symbols) == 1 else 'are'} {verb}."] if symbols else []
    return " ".join((f"tau_1 = {' and '.join(said)}.", *parts) if said else parts)


def linear(steps: pd.DataFrame) -> str:
    """Say how far the gains of the steps of a run lie apart, and whether that could show saturation."""
    gains = steps["gain"].abs().groupby(steps["run"])
    if gains.size().max() < 2:
        return "Not told: there is no second step to hold one against."
    apart = float((100 * (gains.max() - gains.min()) / gains.mean()).max())
    levels = steps[["before", "after"]].abs()
    top, bottom = levels.max(axis=1), levels.min(axis=1)
    same = max(top.max() - top.min(), bottom.max() - bottom.min()) <= _SAME_LEVEL * top.max()
    few = " All steps join the same two levels, so they tell nothing of saturation." if same else ""
    return f"Within {f'{apart:.0f}' if apart >= 10.0 else f'{apart:.2g}'} %.{few}"


def _differs(findings: Findings, name: str) -> bool | None:
    """Tell whether a time of one run differs between the directions beyond its errors; None where one of them is open."""
    told = [p for p in findings.find(name) if p.value is not None]
    if len(told) != 2 or told[0].at["direction"] == told[1].at["direction"]:
        return None
    one, other = told
    error = math.hypot(one.std_error or 0.0, other.std_error or 0.0)
    return abs((one.value or 0.0) - (other.value or 0.0)) > _ALIKE * error


def _time(p: Parameter) -> str:
    return known(p, 1e-3, "ms") if abs(p.value or 0.0) < 1.0 else known(p, 1.0, "s")


def _not_told(symbol: str, direction: str, p: Parameter) -> str:
    return f"{symbol} of the {direction} is not told: {p.description.rstrip('.')}."
