"""How much later the protective unit samples than the control unit, from the phase of their cross-spectrum (rap.md, 3.10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Samples of a piece: 26 s at 20 Hz.
_PIECE = 512
# Lines from this frequency on are pulsation, Hz; steps and drifts lie below.
_LOWEST = 0.6
# A line is used where it stands this far over the median of its spectrum.
_OVER = 12.0


@dataclass(frozen=True)
class Skew:
    """Skew at the middle of the record (s), its standard error, its change per second, and the pieces that told it."""

    value: float
    error: float
    slope: float
    at: float
    pieces: int

    def at_times(self, time: np.ndarray) -> np.ndarray:
        """Return the skew at each of `time` (n,), s."""
        return self.value + self.slope * (time - self.at)


def skew_of(time: np.ndarray, control: np.ndarray, protective: np.ndarray) -> Skew | None:
    """Return the skew of two records at the same stamps; None where no pulsation tells it.

    Each piece of 512 samples gives one delay, weighted by its lines: the slope of the phase of the cross-spectrum over angular
    frequency. The median of the pieces stands against steps; a clock that runs away shows as a slope.

    Parameters
    ----------
    time, control, protective
        Stamps (s) and pressures (Pa), shape (n,).
    """
    step = float(np.median(np.diff(time)))
    size = _PIECE if time.size >= 4 * _PIECE else max(time.size // 4, 64)
    n = time.size // size
    if n < 1:
        return None
    pieces = time[: n * size].reshape(n, size)
    whole = np.abs(np.diff(pieces, axis=1) - step).max(axis=1) < 0.5 * step
    window = np.hanning(size)
    x, y = (
        np.fft.rfft((v - v.mean(axis=1, keepdims=True)) * window, axis=1)
        for v in (control[: n * size].reshape(n, size), protective[: n * size].reshape(n, size))
    )
    omega = 2.0 * np.pi * np.fft.rfftfreq(size, step)
    power = np.minimum(np.abs(x), np.abs(y))
    lines = (power > _OVER * np.median(power, axis=1, keepdims=True)) & (omega > 2.0 * np.pi * _LOWEST)
    lines[:, int(0.9 * omega.size) :] = False
    told = whole & (lines.sum(axis=1) >= 2)
    if told.sum() < 1:
        return None
    cross = np.where(lines, np.conj(x) * y, 0.0)[told]
    delay = _delays(cross, omega, step)
    middle = pieces[told].mean(axis=1)
    value = float(np.median(delay))
    spread = 1.4826 * float(np.median(np.abs(delay - value)))
    good = np.abs(delay - value) <= max(5.0 * spread, 1e-9)
    at = float(middle[good].mean())
    slope = 0.0
    if good.sum() >= 8:
        t = middle[good] - at
        slope = float(np.sum(t * delay[good]) / np.sum(t * t))
        slope_error = spread / np.sqrt(float(np.sum(t * t)))
        slope = slope if abs(slope) > 5.0 * slope_error else 0.0
        value = float(np.mean(delay[good]))
    error = float(np.std(delay[good], ddof=1) / np.sqrt(good.sum())) if good.sum() > 2 else float("nan")
    return Skew(value, error, slope, at, int(good.sum()))


def _delays(cross: np.ndarray, omega: np.ndarray, step: float) -> np.ndarray:
    """Return the delay of each row of `cross` (m, k): least squares of the phase, rotated back until it is small."""
    delay = np.zeros(cross.shape[0])
    for _ in range(4):
        turned = cross * np.exp(-1j * omega * delay[:, None])
        change = np.sum(omega * turned.imag, axis=1) / np.maximum(np.sum(omega**2 * np.abs(turned), axis=1), 1e-300)
        delay = np.clip(delay + change, -2.0 * step, 2.0 * step)
    return delay
