"""Times that the log cannot tell although a fit would: what a break hides, and what a set-point takes from the coil.

What is doubtful beside is in `faults`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.step.breaks import Break, lost
from pipeline.rigs.mre.step.lag_fit import LagFit

_COIL = 3.0  # times delay and smaller time constant, which may be the coil's: what is longer is the pad's
_SLOWEST_FILTER = 0.2  # s, time constant of a low-pass at 0.8 Hz
_WORDS = {"rise": "rising", "fall": "falling"}


def without_breaks(fit: LagFit, estimates: Sequence[Estimate], doubts: Doubts) -> list[Estimate]:
    """Return the estimates with a direction open whose every step is hidden by a hole or a freeze, and say so."""
    record, told = fit.record, list(estimates)
    for direction in fit.lags:
        steps = record.of(direction)
        found: list[Break] = []
        for step in steps:
            t63, t90 = _reach(fit, direction, told)
            gap = lost(record.breaks, step.onset, t63, t90, record.period, step.start)
            if gap is not None:
                found.append(gap)
        whole = [gap for gap in found if gap.channel == "current"] or (found if len(found) == len(steps) else [])
        for gap in found:
            doubts.doubt(
                record.run,
                f"{gap.words}, while a {_WORDS[direction]} step is answered"
                + (f": the times of the {direction} are withheld." if whole else ": that step tells little."),
                "Log the step again.",
                "current" if gap.channel == "current" else "force_axial",
            )
        if whole:
            reason = (
                f"{whole[0].words}, while the step is answered: what is fitted across would be the model's own shape"
            )
            told = [undetermined(e.name, reason, e.at) if e.at["direction"] == direction else e for e in told]
    return told


def without_coil(fit: LagFit, estimates: Sequence[Estimate]) -> list[Estimate]:
    """Return the estimates with those open that the coil's unknown time would enter, where the current is a set-point."""
    if not fit.record.looks_set:
        return list(estimates)
    reason = "the logged current looks like the set-point, so the coil's own time (some 10 to 100 ms) is in the fitted"
    told = []
    for e in estimates:
        direction = str(e.at["direction"])
        if e.value is None or e.name in ("t63", "t90") or direction not in fit.lags:
            told.append(e)
            continue
        taus = fit.taus(direction)
        short = abs(fit.values[f"{direction}.L"]) + (taus[1] if len(taus) > 1 else 0.0)
        if e.name == "time_constant_1" and taus[0] > _COIL * short:
            told.append(e)
        else:
            told.append(undetermined(e.name, f"{reason} {e.value:.3g} s", e.at))
    return told


def _reach(fit: LagFit, direction: str, estimates: Sequence[Estimate]) -> tuple[float, float]:
    """Return t63 and t90 as told, or from the lags where they are not."""
    told = {e.name: e.value for e in estimates if e.at["direction"] == direction}
    total = max(fit.values[f"{direction}.L"], 0.0) + sum(fit.taus(direction))
    return told.get("t63") or total, told.get("t90") or total * math.log(10)


def filter_remark(fit: LagFit, estimates: Sequence[Estimate]) -> str:
    """Return what a filter in the force channel may have to do with the times; empty where one is told or none could be as slow."""
    conditions = fit.record.recording.conditions
    if "force_filter" in conditions or "force_lag" in conditions:
        return ""
    short = {str(e.at["direction"]): e for e in estimates if e.name == "time_constant_2" and e.value is not None}
    possible = {d: e for d, e in short.items() if (e.value or 0.0) < _SLOWEST_FILTER}
    if not possible:
        return ""
    told = " and ".join(f"{1e3 * (e.value or 0.0):.3g} ms in the {d}" for d, e in possible.items())
    alike = ""
    if len(possible) == 2:
        rise, fall = possible["rise"], possible["fall"]
        error = math.hypot(rise.std_error or 0.0, fall.std_error or 0.0)
        if abs((rise.value or 0.0) - (fall.value or 0.0)) < 2 * error:
            alike = ", alike in both as a filter would make it"
    return (
        f"Run {fit.record.run}: the smaller time constant ({told}{alike}) may be the pad's or that of a filter in the force channel: "
        "the log cannot tell. Tell 'force_filter' (Hz) or 'force_lag' (s) where there is one."
    )
