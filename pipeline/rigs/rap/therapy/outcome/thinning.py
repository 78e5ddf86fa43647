"""Long signals made short for drawing: smallest and largest value of each stretch, so that nothing that stood out is lost."""

from __future__ import annotations

import numpy as np

BINS = 2000


def envelope(time: np.ndarray, values: np.ndarray, bins: int = BINS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return middles (s), smallest and largest value of up to `bins` equal stretches of time.

    Stretches without a finite value are NaN, so that gaps stay gaps; a signal of no more than `bins` samples is itself.

    Examples
    --------
    >>> time = np.arange(6.0)
    >>> _, low, high = envelope(time, np.array([0.0, 5.0, 1.0, np.nan, 2.0, -3.0]), 2)
    >>> low.tolist(), high.tolist()
    ([0.0, -3.0], [5.0, 2.0])
    """
    if time.size <= bins:
        return time, values, values
    edges = np.linspace(time[0], time[-1], bins + 1)
    starts = np.searchsorted(time, edges[:-1])
    counts = np.diff(np.append(starts, time.size))
    kept = counts > 0
    finite = np.isfinite(values)
    low, high = np.full(bins, np.nan), np.full(bins, np.nan)
    low[kept] = np.minimum.reduceat(np.where(finite, values, np.inf), starts[kept])
    high[kept] = np.maximum.reduceat(np.where(finite, values, -np.inf), starts[kept])
    empty = ~np.isfinite(low)
    low[empty], high[empty] = np.nan, np.nan
    return 0.5 * (edges[:-1] + edges[1:]), low, high


def picked(size: int, most: int = BINS) -> np.ndarray:
    """Return at most `most` places of a smooth signal of `size` samples, evenly, the first and the last among them."""
    return np.unique(np.linspace(0, size - 1, min(size, most)).round().astype(int)) if size else np.zeros(0, dtype=int)


def spans(time: np.ndarray, mask: np.ndarray, longest_gap: float = np.inf) -> list[tuple[float, float]]:
    """Return the stretches (first, last sample; s) in which `mask` holds; a gap in time ends one."""
    marked = np.flatnonzero(mask)
    if not marked.size:
        return []
    broken = (np.diff(marked) > 1) | (np.diff(time[marked]) > longest_gap)
    firsts = np.concatenate([[0], np.flatnonzero(broken) + 1])
    lasts = np.append(firsts[1:] - 1, marked.size - 1)
    return [(float(time[marked[a]]), float(time[marked[b]])) for a, b in zip(firsts, lasts, strict=True)]
