"""A unit whose reading stands still while the other's moves (rap.md, 8)."""

from __future__ import annotations

import numpy as np

# A reading that is the same for this long stands still, s; and at least so many samples.
LONGEST, _SAMPLES = 2.0, 20
# The other unit must scatter by this share of its usual scatter in windows as long.
_MOVES = 0.5


def constant_runs(time: np.ndarray, values: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last index of each run of equal `values` (n,) that lasts 2 s and 20 samples."""
    if time.size < _SAMPLES:
        return []
    least = max(round(LONGEST / float(np.median(np.diff(time)))), _SAMPLES)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1, [values.size]])
    long = np.flatnonzero(np.diff(edges) >= least)
    return [(int(edges[i]), int(edges[i + 1]) - 1) for i in long]


def frozen_spans(time: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[tuple[float, float]]:
    """Return the spans in which `one` (n,) repeats itself exactly while `other` (n,) goes on.

    Two units that stand still together, as while the pump stands and the converter is coarse, are not frozen.
    """
    runs = constant_runs(time, one)
    if not runs:
        return []
    least = max(round(LONGEST / float(np.median(np.diff(time)))), _SAMPLES)
    n = other.size // least
    usual = float(np.median(np.std(other[: n * least].reshape(n, least), axis=1)))
    moving = [
        (low, high)
        for low, high in runs
        if np.unique(other[low : high + 1]).size > 2 and np.std(other[low : high + 1]) >= _MOVES * usual > 0.0
    ]
    return [(float(time[low]), float(time[high])) for low, high in moving]
