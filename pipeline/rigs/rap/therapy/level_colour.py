"""Echoes whose noise hangs together (waves, foam, condensation): how much, and minutes of them in place of seconds.

A filter that takes such noise for white follows it as if the volume moved. Means over a minute are white where it lasts less.
"""

from __future__ import annotations

import math

import numpy as np

_MINUTE = 60.0
# Bins with fewer echoes tell nothing; fewer second differences neither.
_FILLED, _FEWEST = 10, 12
# Beyond so many standard deviations of what white noise gives by chance it is coloured.
_CLEAR = 3.0
_CUT, _MEAN_BELOW_CUT = 9.0, 0.9733


def colour_of(time: np.ndarray, level: np.ndarray, moved: np.ndarray, variance: np.ndarray) -> float:
    """Return the variance of a minute's mean over that of white noise, 1 where it cannot be told from that.

    Parameters
    ----------
    time, level
        s, m; NaN without a usable level; shape (m,) as all.
    moved
        What the pump's command raised the level by since the start, m.
    variance
        Of a single level, m^2.
    """
    member, count = _minutes(time, level)
    if not count.size:
        return 1.0
    known = np.isfinite(level)
    mean = np.bincount(member, (level - moved)[known]) / count
    white = np.bincount(member, variance[known]) / count**2
    number = np.floor((time[known][np.searchsorted(member, np.arange(count.size))] - time[0]) / _MINUTE)
    filled = count >= _FILLED
    row = filled[:-2] & filled[1:-1] & filled[2:] & (number[2:] - number[:-2] < 2.5)
    if row.sum() < _FEWEST:
        return 1.0
    bend = (mean[:-2] - 2.0 * mean[1:-1] + mean[2:])[row] ** 2
    expected = (white[:-2] + 4.0 * white[1:-1] + white[2:])[row]
    found = 1.0
    for _ in range(20):
        found = float(np.minimum(bend / expected / found, _CUT).mean()) / _MEAN_BELOW_CUT * found
    # Neighbouring second differences share two of their three means.
    chance = math.sqrt(2.0 * 1.94 / row.sum())
    return found if found > 1.0 + _CLEAR * chance else 1.0


def by_minutes(
    time: np.ndarray, level: np.ndarray, moved: np.ndarray, variance: np.ndarray, colour: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return levels (m; NaN but for one a minute) and their variances (m^2), each the mean of a minute's with its colour."""
    member, count = _minutes(time, level)
    rows = np.flatnonzero(np.isfinite(level))
    mean = np.bincount(member, (level - moved)[rows]) / count
    # The echo in the middle of each minute stands for all.
    at = rows[np.searchsorted(member, np.arange(count.size)) + count // 2]
    out, spread = np.full(level.size, np.nan), variance.copy()
    out[at] = mean + moved[at]
    spread[at] = colour * np.bincount(member, variance[rows]) / count**2
    return out, spread


def _minutes(time: np.ndarray, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return to which minute each known level belongs, counted from 0, and how many each holds."""
    known = np.isfinite(level)
    if not known.any():
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    _, member = np.unique(np.floor((time[known] - time[0]) / _MINUTE), return_inverse=True)
    return member, np.bincount(member)
