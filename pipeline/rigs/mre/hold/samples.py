"""Samples of a hold -> one number: mean and scatter, creep against log time, what still settles.

Lone wild samples are left out. What the numbers mean is the law's business.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.current_levels import Hold
from pipeline.rigs.mre.hold.law import FIRST_TIME

FEWEST = 4  # samples of a hold
_WILD = 6.0  # robust standard deviations
Window = tuple[float, float]
Signal = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Means:
    """One number a hold: mean of a channel, its standard deviation within the hold, samples; NaN where none. Shape (H,)."""

    mean: np.ndarray
    spread: np.ndarray
    count: np.ndarray

    def without(self, lost: np.ndarray) -> Means:
        """Return the means with some holds, shape (H,), counted as not measured."""
        return Means(np.where(lost, np.nan, self.mean), self.spread, np.where(lost, 0, self.count))


@dataclass(frozen=True, eq=False)
class Creep:
    """Creep within the holds: force against log10(t/t0) as one number of unit weight a hold, shape (H,) each.

    `force`, `log`, `current` and `time` are sums of w F, w log10(t/t0), w I and w t with w the centred log of unit norm.
    """

    force: np.ndarray
    log: np.ndarray
    current: np.ndarray
    time: np.ndarray


def window_of(time: np.ndarray, values: np.ndarray, window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Return finite samples of a window without lone wild ones."""
    rows = (time >= window[0]) & (time < window[1]) & np.isfinite(values)
    t, x = time[rows], values[rows]
    if t.size < 8:
        return t, x
    log = np.log10(np.maximum(t, 1e-3))
    trend = _line(log, x)
    off = np.abs(x - trend)
    scale = 1.4826 * float(np.median(off))
    kept = off <= max(_WILD * scale, 1e-9 * float(np.abs(x).max()))
    return (t[kept], x[kept]) if scale > 0 else (t, x)


def _line(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return a robust straight line through y(x): medians of the halves."""
    half = x.size // 2
    slope = float(np.median(y[half:]) - np.median(y[:half])) / max(
        float(np.median(x[half:]) - np.median(x[:half])), 1e-9
    )
    return np.asarray(np.median(y - slope * x) + slope * x)


def means_of(time: np.ndarray, values: np.ndarray, windows: Sequence[Window]) -> Means:
    """Return mean, spread and number of the samples in each window."""
    rows = []
    for window in windows:
        _, x = window_of(time, values, window)
        enough = x.size >= FEWEST
        rows.append((float(x.mean()), float(x.std(ddof=1)), x.size) if enough else (np.nan, np.nan, 0))
    mean, spread, count = np.array(rows, dtype=float).T
    return Means(mean, spread, count)


def log_times(signal: Signal, window: Window, age: float = 0.0) -> np.ndarray:
    """Return log10(t/t0) of the samples of a window, the gap closed `age` seconds before the log."""
    t, _ = window_of(*signal, window)
    return np.asarray(np.log10(np.maximum(t + age, 1e-3) / FIRST_TIME))


def creep_of(
    signal: Signal,
    windows: Sequence[Window],
    holds: Sequence[Hold],
    lost: np.ndarray,
    age: float = 0.0,
) -> Creep:
    """Return the creep numbers of each hold; NaN for holds that are `lost` or too short. `age` as in `log_times`."""
    rows = []
    for window, hold, gone in zip(windows, holds, lost, strict=True):
        t, F = window_of(*signal, window)
        log = np.log10(np.maximum(t + age, 1e-3) / FIRST_TIME)
        centred = log - log.mean() if log.size else log
        norm = float(np.linalg.norm(centred))
        if gone or t.size < 2 * FEWEST or norm == 0:
            rows.append((np.nan, np.nan, np.nan, np.nan))
            continue
        w = centred / norm
        current = hold.drift * (t - 0.5 * (hold.start + hold.stop)) / hold.duration
        rows.append((float(w @ F), norm, float(w @ current), float(w @ t)))
    return Creep(*np.array(rows, dtype=float).T)


def still_settling(signal: Signal, windows: Sequence[Window]) -> np.ndarray:
    """Return the mean force of the first quarter of each window less that of its last half, N, shape (H,)."""
    found = []
    for window in windows:
        t, F = window_of(*signal, window)
        n = t.size
        found.append(float(F[: n // 4].mean() - F[n // 2 :].mean()) if n >= 16 else np.nan)
    return np.array(found)
