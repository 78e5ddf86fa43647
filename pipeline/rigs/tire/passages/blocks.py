"""Means of short blocks of samples: what a log looks like coarsely. Lost samples (NaN) do not count."""

from __future__ import annotations

import numpy as np


def block_means(values: np.ndarray, size: int) -> np.ndarray:
    """Return the mean of each whole block of `size` samples; NaN where less than half of it is valid.

    Parameters
    ----------
    values
        Samples, shape (n,); the means have the shape (n // size,).
    """
    if size == 1:
        return values.copy()
    blocks = values[: values.size // size * size].reshape(-1, size)
    means = blocks.mean(axis=1)
    broken = np.flatnonzero(np.isnan(means))
    some = blocks[broken]
    valid = np.isfinite(some)
    count = valid.sum(axis=1)
    total = np.where(valid, some, 0.0).sum(axis=1)
    means[broken] = np.divide(total, count, out=np.full(broken.size, np.nan), where=2 * count >= size)
    return np.asarray(means)


def without_gaps(values: np.ndarray, longest: int) -> np.ndarray:
    """Return the values with gaps of up to `longest` bridged by straight lines."""
    known = np.flatnonzero(np.isfinite(values))
    if known.size in (0, values.size):
        return values
    out = values.copy()
    inside = slice(int(known[0]), int(known[-1]) + 1)
    order = np.arange(inside.start, inside.stop)
    bridge = np.interp(order, known, values[known])
    following = np.repeat(np.diff(known, append=known[-1] + 1), np.diff(known, append=known[-1] + 1))
    out[inside] = np.where(following <= longest, bridge, values[inside])
    return out
