"""A unit whose reading stands still while the other's moves (rap.md, 8)."""

from __future__ import annotations

import numpy as np

# A reading that is the same for this long stands still, s; and at least so many samples.
LONGEST, _SAMPLES = 2.0, 20
# The other unit must scatter by this share of its usual scatter in windows as long.
_MOVES = 0.5


def frozen_spans(time: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[tuple[float, float]]:
    """Return the spans in which `one` (n,) repeats itself exactly while `other` (n,) goes on.

    Two units that stand still together, as while the pump stands and the converter is coarse, are not frozen.
    """
    step = float(np.median(np.diff(time)))
    least = max(round(LONGEST / step), _SAMPLES)
    n = other.size // least
    if n < 2:
        return []
    usual = float(np.median(np.std(other[: n * least].reshape(n, least), axis=1)))
    edges = np.concatenate([[0], np.flatnonzero(np.diff(one) != 0.0) + 1, [one.size]])
    found = []
    for i in np.flatnonzero(np.diff(edges) >= least):
        low, high = int(edges[i]), int(edges[i + 1])
        moves = other[low:high]
        if np.unique(moves).size > 2 and np.std(moves) >= _MOVES * usual > 0.0:
            found.append((float(time[low]), float(time[high - 1])))
    return found
