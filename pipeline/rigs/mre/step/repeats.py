"""Logs of one campaign that answer the same step at different rates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

from pipeline.estimation.estimate import Estimate
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.step.lag_fit import LagFit
from pipeline.rigs.mre.step.record import DIRECTIONS
from pipeline.rigs.mre.step.times import largest

_NAMES = ("time_constant_1", "t63", "t90")
_SURE, _SHARE = 4.0, 0.05  # standard errors; of the value
_ALIKE = 0.1  # of a step, within which two are the same


def judge_repeats(found: Sequence[tuple[LagFit, Sequence[Estimate]]], doubts: Doubts) -> None:
    """Doubt a direction in which two logs with the same step tell times that differ beyond their errors."""
    for direction in DIRECTIONS:
        worst, message = _SURE, ""
        for (one, first), (other, second) in combinations(found, 2):
            if not _same_step(one, other, direction):
                continue
            for name in _NAMES:
                a, b = (_of(estimates, name, direction) for estimates in (first, second))
                if a is None or b is None or a.value is None or b.value is None:
                    continue
                off = abs(a.value - b.value)
                error = math.hypot(a.std_error or 0.0, b.std_error or 0.0)
                if off > _SHARE * min(a.value, b.value) and off > worst * error:
                    worst = off / max(error, 1e-12)
                    message = (
                        f"runs {one.record.run} and {other.record.run} make the same step and tell {name} of the {direction} as {a.value:.3g} and {b.value:.3g} s, "
                        "far beyond their errors: pad, gap, preload or temperature differ, or a clock does."
                    )
        if message:
            doubts.doubt(None, message, "Repeat a step in one mounting and note the temperature.")


def _of(estimates: Sequence[Estimate], name: str, direction: str) -> Estimate | None:
    return next((e for e in estimates if e.name == name and e.at["direction"] == direction), None)


def _same_step(one: LagFit, other: LagFit, direction: str) -> bool:
    if direction not in one.lags or direction not in other.lags:
        return False
    a, b = (largest(fit, direction)[1] for fit in (one, other))
    near = _ALIKE * max(abs(a.size), abs(b.size))
    return abs(a.before - b.before) < near and abs(a.after - b.after) < near
