"""Means of pressures and flow over whole strokes, in windows of 10 s within the levels of a run (rap.md, 5.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.pressures.levels import Level
from pipeline.rigs.rap.pulsation.harmonics import harmonics
from pipeline.rigs.rap.pulsation.passages import find_passages
from pipeline.rigs.rap.pulsation.windows import Windows, cut, joined, stacks
from pipeline.rigs.rap.tables import Signal

LENGTH = 10.0
_FEWEST = 20


@dataclass(frozen=True, eq=False)
class LevelMeans:
    """Windows of all steady levels, shape (w,).

    Attributes
    ----------
    windows
        On the clock of the signals.
    level
        Number of the level.
    turning
        Whether the pump turns.
    frequency
        Of the strokes, Hz; NaN where the pump stands.
    mean
        By name of the signal, its unit; NaN where it cannot be told.
    """

    windows: Windows
    level: np.ndarray
    turning: np.ndarray
    frequency: np.ndarray
    mean: Mapping[str, np.ndarray]

    def of(self, kept: np.ndarray) -> LevelMeans:
        """Return the windows at `kept`, a mask of shape (w,)."""
        mean = {name: values[kept] for name, values in self.mean.items()}
        return LevelMeans(self.windows.of(kept), self.level[kept], self.turning[kept], self.frequency[kept], mean)


def level_means(signals: Mapping[str, Signal], strokes: Signal, levels: Sequence[Level]) -> LevelMeans:
    """Return the means of signals of one clock.

    Parameters
    ----------
    signals
        By name.
    strokes
        The pressure in which the passages are looked for.
    levels
        Stretches of the run on the same clock; those that are not steady are left out.
    """
    parts, numbers = [], []
    for i, level in enumerate(levels):
        if level.steady:
            length = min(LENGTH, level.end - level.start)
            parts.append(cut(level.start, level.end, length))
            numbers += [i] * parts[-1].size
    windows, number = joined(parts), np.array(numbers, dtype=int)
    turning = np.array([levels[i].turning for i in number], dtype=bool)
    frequency = np.full(windows.size, np.nan)
    if turning.any():
        passages = find_passages(strokes.time, strokes.values, windows.of(turning))
        frequency[turning] = passages.frequency
    mean = {}
    for name, one in signals.items():
        values = _plain(one, windows)
        if turning.any():
            values = np.where(turning, _over_strokes(one, windows, frequency), values)
        mean[name] = values
    return LevelMeans(windows, number, turning, frequency, mean)


def _over_strokes(signal: Signal, windows: Windows, frequency: np.ndarray) -> np.ndarray:
    """Return the mean of each window without its strokes, shape (w,); NaN where these cannot be fitted.

    Strokes are fitted and taken off, so that lost samples do no harm; Hann's weights then take out what the single rollers
    differ by: lines at parts of the frequency, of which a window cuts a cycle.
    """
    strokes = harmonics(signal.time, signal.values, windows, frequency, (1.0, 2.0, 3.0))
    mean = np.full(windows.size, np.nan)
    for stack in stacks(signal.time, signal.values, windows):
        length = (windows.end - windows.start)[stack.rows, None]
        weight = stack.weight * (1.0 + np.cos(2.0 * np.pi * stack.offset / length))
        angle = 2.0 * np.pi * np.nan_to_num(frequency[stack.rows, None]) * stack.offset
        left = stack.values.copy()
        for order, amplitude in zip(strokes.orders, np.nan_to_num(strokes.coefficients[stack.rows]).T, strict=True):
            left -= (amplitude[:, None] * np.exp(1j * order * angle)).real
        mean[stack.rows] = (weight * left).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-300)
    return np.where(np.isfinite(strokes.mean), mean, np.nan)


def _plain(signal: Signal, windows: Windows) -> np.ndarray:
    """Return the mean of the samples of each window, NaN where there are few, shape (w,)."""
    first, last = np.searchsorted(signal.time, windows.start), np.searchsorted(signal.time, windows.end)
    sums = np.r_[0.0, np.cumsum(signal.values - signal.values.mean())]
    count = last - first
    least = np.minimum(_FEWEST, 0.5 * signal.rate * (windows.end - windows.start))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(
            count >= np.maximum(least, 1), (sums[last] - sums[first]) / count + signal.values.mean(), np.nan
        )
