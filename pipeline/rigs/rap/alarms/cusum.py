"""Two-sided cumulative sums (Page 1954) and runs over a threshold: the two schemes that find a mismatch."""

from __future__ import annotations

import numpy as np


def cumulative(means: np.ndarray, allowance: float) -> np.ndarray:
    """Return S_k = max(0, S_{k-1} + x_k - allowance), shape (n,); NaN counts as 0, which adds nothing.

    Examples
    --------
    >>> cumulative(np.array([0.0, 50.0, 50.0, 0.0]), 20.0).tolist()
    [0.0, 30.0, 60.0, 40.0]
    """
    x = np.where(np.isfinite(means), means - allowance, 0.0)
    total = np.cumsum(x)
    return np.asarray(total - np.minimum.accumulate(np.minimum(total, 0.0)))


def threshold_onsets(residual: np.ndarray, threshold: float, samples: int) -> np.ndarray:
    """Return the indices at which |residual| has been over `threshold` for `samples` samples in a row, one each run of them.

    A change of sign within a run does not end it: a pulsating difference is a difference.
    """
    with np.errstate(invalid="ignore"):
        over = np.abs(residual) > threshold
    edges = np.diff(np.concatenate([[0], over.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return np.asarray(starts[ends - starts >= samples] + samples - 1)


def second_means(time: np.ndarray, values: np.ndarray, width: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return end (s), mean and root mean square of each `width` seconds that hold samples, shape (m,) each."""
    place = np.floor((time - time[0]) / width).astype(np.int64)
    finite = np.isfinite(values)
    n = int(place[-1]) + 1
    count = np.bincount(place[finite], minlength=n)
    kept = count > 0
    total = np.bincount(place[finite], values[finite], minlength=n)
    square = np.bincount(place[finite], values[finite] ** 2, minlength=n)
    ends = time[0] + width * (np.arange(n) + 1.0)
    return ends[kept], total[kept] / count[kept], np.sqrt(square[kept] / count[kept])
