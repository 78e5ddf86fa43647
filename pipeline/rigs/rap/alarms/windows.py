"""Moving means and deviations at the stamps as logged; a window with a gap has none."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.rap.tables import Signal

# A window with less than this share of its samples is a gap; a centred one is half empty at the ends of a log.
_SHARE, _SHARE_CENTRED = 0.6, 0.4


def trailing_mean(signal: Signal, grid: np.ndarray, width: float | np.ndarray = 1.0) -> np.ndarray:
    """Return the mean over the last `width` seconds (one for all, or for each moment) at `grid`; NaN in gaps, shape of `grid`."""
    return _moments(signal, grid - width, grid, width, _SHARE)[0]


def centred_deviation(signal: Signal, grid: np.ndarray, width: float = 1.0) -> np.ndarray:
    """Return the standard deviation over `width` seconds about each moment of `grid`; NaN in gaps, shape of `grid`."""
    return _moments(signal, grid - 0.5 * width, grid + 0.5 * width, width, _SHARE_CENTRED)[1]


def held(signal: Signal, grid: np.ndarray) -> np.ndarray:
    """Return the last value logged at or before each moment of `grid`; before the first one, that one."""
    place = np.searchsorted(signal.time, grid, side="right") - 1
    return np.asarray(signal.values[np.maximum(place, 0)], float)


def _moments(
    signal: Signal, low: np.ndarray, high: np.ndarray, width: float | np.ndarray, share: float
) -> tuple[np.ndarray, np.ndarray]:
    half_step = 0.5 / signal.rate if signal.time.size > 1 else 0.0
    first = np.searchsorted(signal.time, low + half_step * 1e-3, side="right")
    last = np.searchsorted(signal.time, high + half_step * 1e-3, side="right")
    count = last - first
    expected = np.maximum(width * signal.rate, 1.0) if signal.time.size > 1 else 1.0
    enough = count >= np.maximum(share * expected, 1.0)
    middle = float(np.median(signal.values))
    x = signal.values - middle
    n = np.where(enough, count, 1)
    sums = [np.concatenate([[0.0], np.cumsum(power)]) for power in (x, x * x)]
    mean, square = ((total[last] - total[first]) / n for total in sums)
    deviation = np.sqrt(np.maximum(square - mean**2, 0.0))
    return np.where(enough, mean + middle, np.nan), np.where(enough & (count > 2), deviation, np.nan)
