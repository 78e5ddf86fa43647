"""When the output begins and ceases to turn, and when it leaves a steady speed, from the counts alone.

What the torque tells of the same events is in `events`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.rigs.gearbox.stages.breaks import Shape, cubic, find_break, parabola, parabola_before
from pipeline.rigs.gearbox.stages.counts import Counts, edges
from pipeline.rigs.gearbox.stages.stage import EventTime

LAST = 0.1
"""The first motion after a stand, and the last before one, that is fitted, s."""

# Samples that tell a stop or a start, that of the stand included.
_FEWEST = 5
# A stop within so many samples is told to a sample only.
_FEW = 10
# A start is looked for this far ahead of the first count, s.
_REACH = 0.5


def turns_from(counts: Counts, end: float, window: float) -> EventTime:
    """Return when a standing shaft began to turn, from its first counts; `window` s of them are used.

    A brake that lets go at once makes the angle grow with the square of time, one that lets go in proportion to time
    with its cube. Which is not known: the event lies between both, anywhere.
    """
    if (unseen := _unseen(counts, end)) is not None:
        return unseen
    at, _ = edges(counts)
    k = min(int(np.searchsorted(at, end - 1e-6)), at.size - 1)
    first, last = float(at[k]), float(at[min(k + 5, at.size - 1)])
    fitted = (first, max(first + window, last))
    ends = [
        _standing_end(counts, fitted, (first - _REACH, first), first - _REACH, (shape,)) for shape in (parabola, cubic)
    ]
    late, early = ends[0], ends[1]
    spread = abs(late.time - early.time) / math.sqrt(12.0)
    return EventTime(0.5 * (late.time + early.time), math.hypot(spread, 0.5 * (late.sd + early.sd)))


def turns_until(counts: Counts, start: float, since: float = -math.inf) -> EventTime:
    """Return when the shaft stood, from its last counts: it slows down evenly, from `since` (s) on at the earliest."""
    if (unseen := _unseen(counts, start)) is not None:
        return unseen
    at, _ = edges(counts)
    k = max(int(np.searchsorted(at, start + 1e-6)) - 1, 0)
    last, first = float(at[k]), float(at[max(k - 5, 0)])
    fitted = (max(min(last - LAST, first), min(since, last)), last)
    found = _standing_end(counts, fitted, (last, last + counts.still), last + counts.still, (parabola_before,))
    sampling = float(np.median(np.diff(counts.time)))
    few = found.time - since < _FEW * sampling
    return replace(found, sd=math.hypot(found.sd, sampling)) if few else found


def _unseen(counts: Counts, bound: float) -> EventTime | None:
    """Return the middle of a gap in the counts in which a stand's `bound` lies, s: it hides the event."""
    near = 2.0 * float(np.median(np.diff(counts.time)))
    return hidden_in(counts, bound - near, bound + near, -math.inf)


def hidden_in(counts: Counts, start: float, end: float, earliest: float) -> EventTime | None:
    """Return the middle of the gap in the counts that hides what happens between `start` and `end`, s; None without one."""
    hidden = [gap for gap in counts.gaps if gap[0] <= end and gap[1] >= start]
    if not hidden:
        return None
    first, last = max(hidden[0][0], earliest), hidden[-1][1]
    return EventTime(0.5 * (first + last), (last - first) / math.sqrt(12))


def _standing_end(
    counts: Counts, fitted: tuple[float, float], within: tuple[float, float], stands: float, shapes: Sequence[Shape]
) -> EventTime:
    """Return when a stand ends, or begins, from the moving samples of `fitted` and one of the stand, at `stands`.

    All samples of a stand have the same error, half a count at the most: they count as one.
    """
    t, angle = angle_in(counts, fitted)
    still = float(np.interp(stands, counts.time, counts.angle))
    t, angle = np.append(t, stands), np.append(angle, still)
    edge = fitted[0] if stands < fitted[0] else fitted[1]
    sampling = float(np.median(np.diff(counts.time)))
    if t.size < _FEWEST:
        return EventTime(edge, 0.25 * counts.still + sampling)
    found, _ = find_break(t, angle, [np.ones_like(t)], shapes, within, counts.step / math.sqrt(12))
    return EventTime(found.time, math.hypot(found.sd, sampling / math.sqrt(12.0)))


def slows_from(counts: Counts, near: float, after: float, before: float) -> EventTime:
    """Return when a steady speed begins to fall, near `near`: where the angle leaves its straight line."""
    span = (max(near - before, float(counts.time[0])), min(near + after, float(counts.time[-1])))
    t, angle = angle_in(counts, span)
    found, _ = find_break(t, angle, [np.ones_like(t), t - near], [parabola], (span[0] + 0.1, span[1] - 0.05))
    return found


def angle_in(counts: Counts, span: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return stamps and angles inside `span`, shape (n,) each."""
    inside = (counts.time >= span[0]) & (counts.time <= span[1])
    return counts.time[inside], counts.angle[inside]
