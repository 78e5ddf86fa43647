"""Spans of a log in which a sensor hangs or is clipped. Masks of shape (n,), nothing is said here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# What a sum of opposed gaps may wander beyond noise and gain, m.
_LEAST_DEPARTURE = 1e-6
# Samples from which on a span is a state and no lone wild sample.
_LONG = 10


def held_still(values: np.ndarray, least: int) -> np.ndarray:
    """Mark runs of equal values of at least `least` samples.

    Examples
    --------
    >>> held_still(np.array([1.0, 2.0, 2.0, 2.0, 3.0]), 3).astype(int)
    array([0, 1, 1, 1, 0])
    """
    marks = np.zeros(values.size, dtype=bool)
    edges = np.flatnonzero(np.diff(values) != 0) + 1
    for start, stop in zip(np.r_[0, edges], np.r_[edges, values.size], strict=True):
        if stop - start >= least:
            marks[start:stop] = True
    return marks


@dataclass(frozen=True, eq=False)
class PairSum:
    """The sum of an opposed pair of gaps: where it departs from ``level + slope (first - second)``, shape (n,)."""

    departs: np.ndarray
    level: float
    slope: float

    def first_from(self, second: np.ndarray) -> np.ndarray:
        """Return the first gap as the second one has it."""
        return np.asarray((self.level - (1 + self.slope) * second) / (1 - self.slope))

    def second_from(self, first: np.ndarray) -> np.ndarray:
        """Return the second gap as the first one has it."""
        return np.asarray((self.level - (1 - self.slope) * first) / (1 + self.slope))


def pair_sum(first: np.ndarray, second: np.ndarray) -> PairSum:
    """Find where the sum of an opposed pair of gaps is not the constant that it is elsewhere.

    A difference in gain lets the sum follow the displacement, which is no fault here: the sum is
    compared with a straight line over the difference, found without the samples that depart.
    """
    total, difference = first + second, first - second
    finite = np.isfinite(total)
    nothing = PairSum(np.zeros(total.size, dtype=bool), 0.0, 0.0)
    if finite.sum() < 20:
        return nothing
    # The shortest half holds the sound samples even where nearly half are not.
    ordered = np.sort(total[finite])
    half = ordered.size // 2
    shortest = int(np.argmin(ordered[half:] - ordered[: ordered.size - half]))
    middle, width = ordered[shortest + half // 2], ordered[shortest + half] - ordered[shortest]
    kept = finite & (np.abs(total - middle) <= max(3 * float(width), _LEAST_DEPARTURE))
    step = max(_quantum(first), _quantum(second))
    for _ in range(8):
        if kept.sum() < 10:
            return nothing
        x = difference[kept] - difference[kept].mean()
        slope = float(x @ total[kept] / (x @ x)) if x @ x > 0 else 0.0
        rest = total - slope * difference
        level = float(np.median(rest[kept]))
        off = np.where(finite, np.abs(rest - level), 0.0)
        limit = max(6 * 1.4826 * float(np.median(off[kept])), 3 * step, _LEAST_DEPARTURE)
        now = finite & (off <= limit)
        if (now == kept).all():
            break
        kept = now
    return PairSum(finite & (off > limit), level, slope)


def culprit(first: np.ndarray, second: np.ndarray, start: int, stop: int) -> int | None:
    """Return which of two gaps is wrong in a span: 0 or 1; None where that cannot be told.

    A sensor that hangs or is clipped stands still while the other moves; a wild sample jumps.
    """
    if stop - start >= _LONG:
        size = [float(np.nanstd(values[start:stop])) for values in (first, second)]
        times, order = 0.3, 1
    else:
        beside = start - 1 if start else min(stop, first.size - 1)
        size = [abs(float(values[start] - values[beside])) for values in (first, second)]
        times, order = 0.3, -1
    if size[0] < times * size[1]:
        return 0 if order > 0 else 1
    if size[1] < times * size[0]:
        return 1 if order > 0 else 0
    return None


def _quantum(values: np.ndarray) -> float:
    """Return the smallest step between neighbouring samples, m."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12]
    return float(steps.min()) if steps.size else 0.0


def spans_of(marks: np.ndarray, join: int = 10) -> list[tuple[int, int]]:
    """Return (start, stop) of the marked stretches; gaps of up to `join` samples are bridged.

    Examples
    --------
    >>> spans_of(np.array([0, 1, 1, 0, 0, 1], dtype=bool), join=1)
    [(1, 3), (5, 6)]
    """
    at = np.flatnonzero(marks)
    if at.size == 0:
        return []
    breaks = np.flatnonzero(np.diff(at) > join + 1)
    starts, stops = np.r_[at[0], at[breaks + 1]], np.r_[at[breaks], at[-1]] + 1
    return [(int(a), int(b)) for a, b in zip(starts, stops, strict=True)]
