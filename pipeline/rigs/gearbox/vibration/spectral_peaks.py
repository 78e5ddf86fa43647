"""Strong lines of a spectrogram as points in time and frequency: what a reader looks for in one."""

from __future__ import annotations

import numpy as np

_WINDOW = 0.2
# A line stands out where its power is that many times the median of its window (10 dB).
_LEAST = 10.0
_MOST = 6


def spectral_peaks(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time (s), frequency (Hz) and power over the median of the window, shape (n,), of the strongest lines.

    Parameters
    ----------
    time, values
        s and m/s^2, shape (n,), evenly spaced but for jitter.
    """
    rate = (time.size - 1) / float(time[-1] - time[0])
    size = max(round(_WINDOW * rate), 32)
    count = time.size // size
    if count < 1:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    blocks = values[: count * size].reshape(count, size)
    power = np.abs(np.fft.rfft((blocks - blocks.mean(axis=1, keepdims=True)) * np.hanning(size), axis=1)) ** 2
    contrast = power / np.maximum(np.median(power, axis=1, keepdims=True), 1e-300)
    inner = contrast[:, 1:-1]
    top = (inner > contrast[:, :-2]) & (inner >= contrast[:, 2:]) & (inner > _LEAST)
    rank = np.argsort(np.argsort(-np.where(top, inner, 0.0), axis=1), axis=1)
    window, line = np.nonzero(top & (rank < _MOST))
    centres = time[: count * size].reshape(count, size).mean(axis=1)
    return centres[window], (line + 1) * rate / size, inner[window, line]
