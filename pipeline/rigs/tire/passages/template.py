"""The waveform of a passage as its harmonics, and what it is on a fine grid of angles (tire.md, 5.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FINE = 4096
# Orders that a template keeps: above, only noise is left of any sensor longer than 15 mm.
ORDERS = 200


@dataclass(frozen=True, eq=False)
class Template:
    """A periodic waveform: values and derivative by angle on `FINE` even angles from -pi, shape (FINE,) each."""

    harmonics: np.ndarray
    values: np.ndarray
    slope: np.ndarray

    def turned(self, angle: float) -> Template:
        """Return the waveform with what stood at `angle` (rad) at zero."""
        return from_harmonics(self.harmonics * np.exp(1j * np.arange(self.harmonics.size) * angle))

    @property
    def top(self) -> float:
        """The angle of the highest value, rad."""
        i = int(np.argmax(self.values))
        before, here, after = self.values[i - 1], self.values[i], self.values[(i + 1) % FINE]
        bend = before - 2.0 * here + after
        shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
        return float((i + shift - FINE // 2) * 2.0 * np.pi / FINE)

    @property
    def skewness(self) -> float:
        """Third moment over the cube of the standard deviation; 0 of a flat waveform."""
        square = float(np.mean(self.values**2))
        return float(np.mean(self.values**3)) / square**1.5 if square > 0.0 else 0.0

    @property
    def height(self) -> float:
        """Highest value over the mean, which is zero."""
        return float(self.values.max())


def from_harmonics(harmonics: np.ndarray) -> Template:
    """Return the template of harmonics f_0..f_M: sum of f_n exp(i n theta), one-sided."""
    spectrum = np.zeros(FINE // 2 + 1, dtype=complex)
    spectrum[: harmonics.size] = harmonics
    orders = np.arange(spectrum.size)
    values, slope = np.fft.irfft([spectrum, 1j * orders * spectrum], FINE) * FINE
    return Template(harmonics, np.fft.fftshift(values), np.fft.fftshift(slope))


def from_bins(means: np.ndarray, orders: int = ORDERS) -> Template:
    """Return the template through the means of even bins of angle, shape (bins,), less their mean.

    Empty bins (NaN) are bridged; bins are even angles from -pi.
    """
    filled = bridged(means)
    harmonics = np.fft.rfft(np.fft.ifftshift(filled)) / filled.size
    harmonics = harmonics[: min(orders, filled.size // 2 - 1) + 1]
    harmonics[0] = 0.0
    return from_harmonics(harmonics)


def from_values(values: np.ndarray) -> Template:
    """Return the template through values on `FINE` even angles from -pi, less their mean."""
    harmonics = np.fft.rfft(np.fft.ifftshift(values))[: ORDERS + 1] / values.size
    harmonics[0] = 0.0
    return from_harmonics(harmonics)


def bridged(means: np.ndarray) -> np.ndarray:
    """Return periodic values with NaN bridged by straight lines; ValueError where all are NaN."""
    known = np.flatnonzero(np.isfinite(means))
    if known.size == means.size:
        return means
    if known.size == 0:
        raise ValueError("no bin holds a sample")
    return np.asarray(np.interp(np.arange(means.size), known, means[known], period=means.size))


def mean_of(values: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the mean by bin over revolutions, levels that differ taken out first; NaN where empty.

    Parameters
    ----------
    values, count
        Mean and number of the samples of each revolution and bin, shape (m, bins) each; values where there are none
        do not count.
    """
    there = count > 0
    weight = count.sum(axis=0)
    known = np.where(there, values, 0.0)
    heavy = known * count
    present, each = there.astype(float), np.maximum(there.sum(axis=1), 1)
    level = np.zeros(values.shape[0])
    mean = np.zeros(weight.size)
    for _ in range(2):
        total = heavy.sum(axis=0) - level @ count
        mean = np.divide(total, weight, out=np.full(weight.size, np.nan), where=weight > 0)
        level = (known.sum(axis=1) - present @ np.nan_to_num(mean)) / each
    return mean
