"""Stretches of a run between changes of the pumps: one set-point each, steady within (rap.md, T1 and 5.4).

Changes are seen in the pressures themselves; set-points only give the stretches their names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.rigs.rap.alignment.features import course
from pipeline.rigs.rap.pulsation.pump import Pump, pump
from pipeline.rigs.rap.tables import Signal

# A change stands out of the usual slope by that factor; two that lie nearer are one, s.
_STANDS_OUT, _APART = 10.0, 8.0
# Of each stretch so much behind its change and before the next is not steady, s.
SETTLE, _BEFORE = 8.0, 1.5
_SHORTEST = 5.0


@dataclass(frozen=True)
class Level:
    """A steady stretch on the bench's clock: `start` to `end` (s) without what settles; `begin` is where the change was.

    `turning` tells whether the blood pump turns; `flow_set`, `uf_set` (m^3/s) are None where not logged. A stretch that is
    too short to settle, or in which the pump both turns and stands, is not `steady`.
    """

    begin: float
    start: float
    end: float
    turning: bool
    flow_set: float | None = None
    uf_set: float | None = None
    steady: bool = True


@dataclass(frozen=True, eq=False)
class SetPoints:
    """Settings of the pumps on the bench's clock; None where not logged."""

    flow: Signal | None = None
    uf: Signal | None = None


def levels_of(pressures: Sequence[Signal], set_points: SetPoints | None = None) -> list[Level]:
    """Return the stretches of a run between its changes, in order; those that are not steady are marked.

    Parameters
    ----------
    pressures
        Of one clock (the bench's), the one with the strongest pulsation first.
    set_points
        On the same clock.
    """
    set_points = set_points or SetPoints()
    first = max(float(p.time[0]) for p in pressures)
    last = min(float(p.time[-1]) for p in pressures)
    turning = pump(pressures[0].time, pressures[0].values)
    changes = _changes(pressures, turning, set_points)
    edges = [first, *changes[(changes > first) & (changes < last)].tolist(), last]
    found = []
    for begin, end in pairwise(edges):
        start, stop = begin + (SETTLE if begin > first else 0.0), end - _BEFORE
        long = stop - start >= _SHORTEST
        start, stop = (start, stop) if long else (begin, end)
        on = float(turning.on(np.linspace(start, stop, 21)).mean())
        sets = _set(set_points.flow, start, stop), _set(set_points.uf, start, stop)
        found.append(Level(begin, start, stop, on > 0.5, *sets, steady=long and not 0.1 < on < 0.9))
    return found


def _changes(pressures: Sequence[Signal], turning: Pump, set_points: SetPoints) -> np.ndarray:
    """Return the moments (s) at which a pressure steps, the pump starts or stops, or a set-point changes; shape (c,)."""
    at = [float(t) for t in turning.changes]
    for signal in (set_points.flow, set_points.uf):
        if signal is not None:
            at += [float(t) for t in signal.time[1:][np.abs(np.diff(signal.values)) > 1e-10]]
    strengths = [np.inf] * len(at)
    for signal in pressures:
        one = course(signal)
        size = np.abs(one.slope)
        usual = float(np.median(size[one.known])) if one.known.any() else 0.0
        peaks = (
            np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:]) & (size[1:-1] > _STANDS_OUT * usual)) + 1
        )
        at += (one.start + one.step * peaks).tolist()
        strengths += (size[peaks] / max(usual, 1e-300)).tolist()
    kept: list[float] = []
    for k in np.argsort(strengths)[::-1]:
        if all(abs(at[k] - other) > _APART for other in kept):
            kept.append(at[k])
    return np.array(sorted(kept))


def _set(signal: Signal | None, start: float, end: float) -> float | None:
    """Return the setting of a stretch, None where it is not logged or not one."""
    if signal is None:
        return None
    inside = signal.values[(signal.time >= start) & (signal.time <= end)]
    if not inside.size:
        before = signal.values[signal.time <= start]
        return float(before[-1]) if before.size else None
    value = float(np.median(inside))
    return value if float(np.mean(np.abs(inside - value) < 1e-10)) > 0.9 else None
