"""Stamps on an even grid: what a timer sampled and a logger stamped a little late or early."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

# Samples either side over which the grid is taken; steps within that share of the usual one belong to one stretch.
_HALF = 400
_SAME = 0.5
# So many steps, within that share of one, are as many less one lost samples: the timer went on meanwhile.
_LOST, _WHOLE = 4, 0.25
# Fewer samples than that in a stretch are left as they are.
_FEWEST = 20


def evened(time: np.ndarray) -> np.ndarray:
    """Return stamps (s, increasing, shape (n,)) replaced by the line through the neighbours' over some hundred samples.

    Each stretch without a gap by itself; a drift of the clock stays, jitter goes. A few lost samples make no gap.
    """
    out = np.array(time, dtype=float)
    if time.size < _FEWEST:
        return out
    steps = np.diff(out)
    usual = float(np.median(steps))
    count = np.maximum(np.round(steps / usual), 1.0)
    off = np.abs(steps - count * usual) / usual
    one_grid = np.where(count > 1.0, (count <= _LOST) & (off < _WHOLE), off <= _SAME)
    index = np.r_[0.0, np.cumsum(count)]
    bounds = [0, *(np.flatnonzero(~one_grid) + 1).tolist(), out.size]
    for first, last in pairwise(bounds):
        if last - first >= _FEWEST:
            out[first:last] = _smoothed(out[first:last], index[first:last])
    return out if np.all(np.diff(out) > 0) else np.array(time, dtype=float)


def jitter(time: np.ndarray) -> float:
    """Return the rms distance of stamps to the even grid, s."""
    return float(np.std(time - evened(time)))


def _smoothed(time: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Return the moving line through `time` over the timer's count `index`: a moving mean inside, one line for each end."""
    n = time.size
    half = min(_HALF, (n - 1) // 2)
    line = np.polyfit(index, time, 1)
    flat = time - np.polyval(line, index)
    size = 2 * half + 1
    sums = np.r_[0.0, np.cumsum(flat)]
    smooth = np.empty(n)
    smooth[half : n - half] = (sums[size:] - sums[:-size]) / size
    for part, edge in ((slice(0, half), slice(0, size)), (slice(n - half, n), slice(n - size, n))):
        smooth[part] = np.polyval(np.polyfit(index[edge], flat[edge], 1), index[part])
    return np.asarray(smooth + np.polyval(line, index))
