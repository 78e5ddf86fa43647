"""Spans of a log in which a sensor hangs or is clipped. Masks of shape (n,), nothing is said here."""

from __future__ import annotations

import numpy as np

# What a sum of opposed gaps may wander beyond noise and gain, m.
_LEAST_DEPARTURE = 1e-6


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


def sum_departs(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Mark samples where the sum of an opposed pair of gaps is not the constant that it is elsewhere.

    A difference in gain lets the sum follow the displacement, which is no fault here: the sum is
    compared with a straight line over the difference, found without the samples that depart.
    """
    total, difference = first + second, first - second
    finite = np.isfinite(total)
    kept = finite.copy()
    rest = np.zeros(total.size)
    limit = np.inf
    for _ in range(8):
        if kept.sum() < 10:
            return np.zeros(total.size, dtype=bool)
        x = difference[kept] - difference[kept].mean()
        slope = float(x @ total[kept] / (x @ x)) if x @ x > 0 else 0.0
        rest = total - slope * difference
        rest = np.where(finite, rest - np.median(rest[kept]), 0.0)
        limit = max(6 * 1.4826 * float(np.median(np.abs(rest[kept]))), _LEAST_DEPARTURE)
        now = finite & (np.abs(rest) <= limit)
        if (now == kept).all():
            break
        kept = now
    return np.asarray(finite & (np.abs(rest) > limit))


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
