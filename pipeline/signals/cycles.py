"""A record cut into strokes at its turning points, or into cycles of a known period.

Cycles are compared with each other after taking out of each its mean, and the slope that the means
of its neighbours give: a drifting mean does not hide that the motion repeats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.signals.periodogram import block_means
from pipeline.signals.resampling import interpolated

# Points of a resampled cycle: enough for the shape up to the tenth harmonic.
_POINTS = 48


def turning_points(values: np.ndarray, height: float) -> np.ndarray:
    """Return the indices where strokes of more than `height` begin, the first one included.

    A reversal counts once the signal has come back by `height`, so noise below it makes none. The
    number of indices is the number of strokes.

    Examples
    --------
    >>> turning_points(np.array([0.0, 1, 2, 1.9, 2.1, 1, 0, 0.1]), 0.5).tolist()
    [0, 4]
    """
    inner = np.flatnonzero(np.diff(np.sign(np.diff(values))) != 0) + 1
    pivots: list[int] = []
    direction, low, high = 0, 0, 0
    for i in [*inner.tolist(), values.size - 1]:
        x = values[i]
        if x > values[high]:
            high = i
        if x < values[low]:
            low = i
        if direction >= 0 and values[high] - x > height:
            pivots.append(high)
            direction, low = -1, i
        elif direction <= 0 and x - values[low] > height:
            pivots.append(low)
            direction, high = 1, i
    return np.array(pivots, dtype=int)


@dataclass(frozen=True, eq=False)
class Cycles:
    """Whole cycles of one period, N of them, each on the same phases.

    Attributes
    ----------
    start, period
        Where the first cycle begins, s, and how long each takes, s.
    mean
        Of each cycle, shape (N,); NaN where a gap falls into it.
    shape
        What is left of each after its mean and the drift of the means are taken out, shape
        (N, phases).
    """

    start: float
    period: float
    mean: np.ndarray
    shape: np.ndarray

    @property
    def count(self) -> int:
        """Number of whole cycles, those with gaps included."""
        return int(self.mean.size)

    @property
    def amplitude(self) -> np.ndarray:
        """Root mean square of each cycle's shape times sqrt 2: the amplitude of a sine, shape (N,)."""
        return np.asarray(np.sqrt(2 * (self.shape**2).mean(axis=1)))

    @property
    def similarity(self) -> float:
        """Correlation of neighbouring cycles; NaN where there are no two."""
        before, after = self.shape[:-1], self.shape[1:]
        both = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
        power = np.sqrt((before[both] ** 2).sum() * (after[both] ** 2).sum())
        return float((before[both] * after[both]).sum() / power) if power > 0 else float("nan")

    @property
    def simple_share(self) -> float:
        """Share of the first cycle's power that three harmonics hold, a straight drift set aside."""
        phase = (np.arange(self.shape.shape[1]) + 0.5) / self.shape.shape[1]
        turning = 2 * np.pi * phase[:, None] * np.arange(1, 4)
        drift = np.stack([np.ones_like(phase), phase], axis=1)
        wave = self.shape[0]
        left = [
            wave - columns @ np.linalg.lstsq(columns, wave, rcond=None)[0]
            for columns in (drift, np.hstack([drift, np.cos(turning), np.sin(turning)]))
        ]
        return float(1 - (left[1] @ left[1]) / max(left[0] @ left[0], 1e-300))

    @property
    def likeness(self) -> np.ndarray:
        """Correlation of each cycle with the mean shape of all, shape (N,); NaN at gaps."""
        size = np.sqrt((self.shape**2).sum(axis=1, keepdims=True))
        with np.errstate(invalid="ignore", divide="ignore"):
            unit = self.shape / size
        # Cycles that hardly move have no shape of their own.
        counted = np.isfinite(size[:, 0]) & (size[:, 0] > 0.1 * np.nanmax(size))
        common = unit[counted].mean(axis=0)
        return np.asarray(unit @ common / max(float(np.linalg.norm(common)), 1e-300))

    @property
    def common_share(self) -> float:
        """Share of the motion that all cycles have in common, whatever their size: 1 for periodic."""
        size = np.sqrt((self.shape**2).sum(axis=1))
        counted = np.isfinite(size) & (size > 0.1 * np.nanmax(size))
        return float(((self.shape[counted] / size[counted, None]).mean(axis=0) ** 2).sum())


def cut(time: np.ndarray, values: np.ndarray, start: float, end: float, frequency: float, waves: int = 1) -> Cycles:
    """Cut the stretch from `start` to `end` (s) into whole cycles, correcting the frequency on the way.

    Parameters
    ----------
    time, values
        Stamps (s, increasing) and finite samples, shape (n,).
    frequency
        Hz, to better than half a cycle over the stretch.
    waves
        How many times finer than usual a cycle is resampled: for cycles that hold several waves.
    """
    cycles = _resampled(time, values, start, end, frequency, waves * _POINTS)
    for _ in range(3):
        correction = _frequency_error(cycles)
        if abs(correction) * (end - start) < 1e-4:
            break
        frequency += correction
        cycles = _resampled(time, values, start, end, frequency, waves * _POINTS)
    return cycles


def _resampled(time: np.ndarray, values: np.ndarray, start: float, end: float, frequency: float, points: int) -> Cycles:
    step = float(np.median(np.diff(time)))
    thin_time, thin_values = block_means(time, values, int(1 / (step * 2 * points * frequency)))
    # The last cycle may lack a hair: the record ends one step early, the frequency is rounded.
    count = max(int((end - start + step) * frequency + 0.02), 1)
    phase = (np.arange(points) + 0.5) / points
    at = start + (np.arange(count)[:, None] + phase) / frequency
    # A gap of a quarter cycle spoils a cycle; the last instants may lie beyond the last sample.
    wave = interpolated(thin_time, thin_values, np.minimum(at, thin_time[-1]), 0.25 / frequency + 2 * step)
    mean = wave.mean(axis=1)
    slope = np.nan_to_num(np.gradient(mean)) if count > 1 else np.zeros(1)
    return Cycles(start, 1 / frequency, mean, wave - mean[:, None] - slope[:, None] * (phase - 0.5))


def _frequency_error(cycles: Cycles) -> float:
    """Return by how much the frequency is wrong, Hz, from the phase gained from cycle to cycle."""
    points = cycles.shape.shape[1]
    phase = (np.arange(points) + 0.5) / points
    whole = np.isfinite(cycles.shape).all(axis=1)
    # The strongest of the first orders: the fundamental may be weak.
    lines = cycles.shape @ np.exp(-2j * np.pi * phase[:, None] * np.arange(1, 5))
    order = int(np.argmax((np.abs(lines[whole]) ** 2).sum(axis=0))) + 1 if whole.any() else 1
    line = lines[:, order - 1]
    both = whole[1:] & whole[:-1]
    gained = (line[1:][both] * np.conj(line[:-1][both])).sum()
    return float(np.angle(gained) / (2 * np.pi * cycles.period * order)) if abs(gained) > 0 else 0.0
