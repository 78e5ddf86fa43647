"""What is aperiodic in a signal, on a grid, and how two such courses correlate at every lag.

Pulsation is alike at every stroke and tells no lag by itself: starts, stops and steps of the set-points do (rap.md, 5.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.alignment.pair import Pair
from pipeline.rigs.rap.tables import Signal

STEP = 0.1
"""Grid of the courses, s."""
# Standard deviation of the Gaussian that passes 0.3 Hz with 0.707, s; it leaves 1/2000 of a 1.4 Hz pulsation.
_WIDTH = 0.1325 / 0.3
# A gap longer than so many steps and seconds is not bridged.
_GAP_STEPS, _GAP = 2.5, 0.5


@dataclass(frozen=True, eq=False)
class Course:
    """Slope of a smoothed signal on a grid of `step` seconds from `start`, shape (n,); zero where `known` is False."""

    start: float
    step: float
    slope: np.ndarray
    known: np.ndarray
    level: np.ndarray


def course(signal: Signal, step: float = STEP) -> Course:
    """Return the slope of a signal below 0.3 Hz (or a third of its rate, where that is lower).

    Each bin holds the mean of the polygon through the samples over it, so that any rate and any jitter give the same
    course; bins in gaps are unknown.
    """
    time, values = signal.time, signal.values - float(np.median(signal.values))
    between = np.diff(time)
    usual = float(np.median(between))
    count = max(int((time[-1] - time[0]) / step), 1)
    edges = time[0] + step * np.arange(count + 1)
    area = np.r_[0.0, np.cumsum(0.5 * between * (values[1:] + values[:-1]))]
    level = _integral(time, values, area, edges)
    level = np.diff(level) / step
    known = np.ones(count, dtype=bool)
    for k in np.flatnonzero(between > max(_GAP_STEPS * usual, _GAP)):
        known[max(int((time[k] - time[0]) / step), 0) : int((time[k + 1] - time[0]) / step) + 1] = False
    width = max(_WIDTH, usual) / step
    half = int(4 * width) + 1
    at = np.arange(-half, half + 1)
    bell = np.exp(-0.5 * (at / width) ** 2)
    bell /= bell.sum()
    padded = np.pad(level, half, mode="edge")
    smooth = np.convolve(padded, bell, mode="valid")
    # The convolution turns its kernel round: the derivative of the bell is -t/w^2 of it.
    slope = np.convolve(padded, -at * bell / (width**2 * step), mode="valid")
    # Beyond the ends nothing is known either.
    unknown = np.pad(~known, half, constant_values=True)
    known = np.convolve(unknown, np.ones(2 * half + 1), mode="valid") < 0.5
    return Course(float(time[0] + 0.5 * step), step, np.where(known, slope, 0.0), known, smooth)


def _integral(time: np.ndarray, values: np.ndarray, area: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the integral of the polygon through the samples up to `at`, shape (m,)."""
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
    ahead = at - time[k]
    slope = (values[k + 1] - values[k]) / (time[k + 1] - time[k])
    return np.asarray(area[k] + ahead * (values[k] + 0.5 * slope * ahead))


def step_gain(pair: Pair, lag: float) -> float:
    """Return how large steps of the device are over those of the bench, 1; NaN where nothing steps."""
    device, bench = course(pair.device), course(pair.bench)
    at = bench.start + bench.step * np.arange(bench.slope.size) - lag
    grid = device.start + device.step * np.arange(device.slope.size)
    seen = np.interp(at, grid, device.slope, left=0.0, right=0.0)
    usual = float(np.median(np.abs(bench.slope)))
    steps = (np.abs(bench.slope) > 8.0 * usual) & bench.known & (at > grid[0]) & (at < grid[-1])
    power = float(bench.slope[steps] @ bench.slope[steps])
    return float(seen[steps] @ bench.slope[steps]) / power if power > 0 else float("nan")


def correlation(device: Course, bench: Course, lowest: float, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return lags (s) from `lowest` to `highest` and the correlation of two courses over what overlaps, shape (m,).

    NaN where less than half of the shorter course, or less than a quarter of the power of either, overlaps.
    """
    from scipy.signal import fftconvolve

    step = device.step
    x, y = device.slope, bench.slope
    offset = bench.start - device.start

    def together(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.asarray(fftconvolve(b, a[::-1]))

    lags = offset + step * np.arange(-(x.size - 1), y.size)
    product = together(x, y)
    power_x = np.maximum(together(x**2, bench.known.astype(float)), 0.0)
    power_y = np.maximum(together(device.known.astype(float), y**2), 0.0)
    shared = np.minimum.reduce(
        [np.arange(1, lags.size + 1), np.arange(lags.size, 0, -1), np.full(lags.size, min(x.size, y.size))]
    )
    total_x, total_y = float(x @ x), float(y @ y)
    enough = (shared >= 0.5 * min(x.size, y.size)) & (power_x > 0.25 * total_x) & (power_y > 0.25 * total_y)
    if x.size > 1.5 * y.size:
        enough = (shared >= 0.5 * y.size) & (power_y > 0.25 * total_y) & (power_x > 0.0)
    elif y.size > 1.5 * x.size:
        enough = (shared >= 0.5 * x.size) & (power_x > 0.25 * total_x) & (power_y > 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.where(enough, product / np.sqrt(power_x * power_y), np.nan)
    inside = (lags >= lowest - 0.5 * step) & (lags <= highest + 0.5 * step)
    return lags[inside], value[inside]
