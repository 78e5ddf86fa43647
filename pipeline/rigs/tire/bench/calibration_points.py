"""Runs that go into the peak-load calibration: one speed, and which of them repeat a load."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

# Loads closer than this are repeats of one; speeds closer than this are one speed.
_SAME_LOAD = 0.05
_SAME_SPEED = 0.1


@dataclass(frozen=True)
class PeakPoint:
    """One run: loads in N, peaks (less the mean of the turn) in ohm.

    Attributes
    ----------
    load, load_se, peak, peak_se
        Means over the run and their standard errors.
    nominal_load, speed
        As set, N and m/s.
    revolution_sd
        Scatter of single revolutions' peaks; 0 where it is not known.
    direction
        +1 where the load was reached from below, -1 from above, 0 where that is not known.
    """

    run: str
    load: float
    load_se: float
    peak: float
    peak_se: float
    nominal_load: float
    speed: float
    revolution_sd: float = 0.0
    direction: int = 0


def at_one_speed(points: Sequence[PeakPoint]) -> tuple[list[PeakPoint], dict[str, str]]:
    """Return the runs of the speed with most loads, and by name why each other run is left out."""
    left_out: dict[str, str] = {}
    rolling = []
    for p in points:
        if not (math.isfinite(p.load) and math.isfinite(p.peak) and p.load > 0.0):
            left_out[p.run] = f"its load is {p.load:.4g} N, its peak {p.peak:.4g} ohm"
        else:
            rolling.append(p)
    best: list[PeakPoint] = []
    for p in rolling:
        near = [q for q in rolling if abs(q.speed - p.speed) <= _SAME_SPEED * p.speed]
        if (len(set(groups_of(near))), len(near)) > (len(set(groups_of(best))), len(best)):
            best = near
    for p in rolling:
        if p not in best:
            left_out[p.run] = f"rolled at {p.speed:.3g} m/s, the calibration is made at {best[0].speed:.3g} m/s"
    return best, left_out


def groups_of(points: Sequence[PeakPoint]) -> list[int]:
    """Return which load each run repeats, 0, 1, ... by rising load."""
    order = sorted(range(len(points)), key=lambda i: points[i].nominal_load)
    member, first, group = [0] * len(points), -math.inf, -1
    for i in order:
        if points[i].nominal_load > first * (1.0 + _SAME_LOAD) or group < 0:
            group, first = group + 1, points[i].nominal_load
        member[i] = group
    return member
