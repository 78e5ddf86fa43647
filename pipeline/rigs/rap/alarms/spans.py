"""Stretches of time in which something holds."""

from __future__ import annotations

import numpy as np


def spans(time: np.ndarray, holds: np.ndarray) -> list[tuple[float, float]]:
    """Return first and last moment of each stretch in which `holds` (n,) is true.

    Examples
    --------
    >>> spans(np.arange(5.0), np.array([True, True, False, True, False]))
    [(0.0, 1.0), (3.0, 3.0)]
    """
    edges = np.diff(np.concatenate([[0], holds.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return [(float(time[i]), float(time[k])) for i, k in zip(starts, ends, strict=True)]


def joined(found: list[tuple[float, float]], gap: float) -> list[tuple[float, float]]:
    """Return the spans with those joined that lie no more than `gap` seconds apart."""
    out: list[tuple[float, float]] = []
    for start, end in found:
        if out and start - out[-1][1] <= gap:
            out[-1] = (out[-1][0], end)
        else:
            out.append((start, end))
    return out


def since(time: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Return the seconds since the last of `moments` (increasing) at each of `time`; inf before the first, shape of `time`."""
    if moments.size == 0:
        return np.full(time.shape, np.inf)
    place = np.searchsorted(moments, time, side="right") - 1
    return np.where(place >= 0, time - moments[np.maximum(place, 0)], np.inf)
