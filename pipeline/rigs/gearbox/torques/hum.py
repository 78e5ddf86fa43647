"""Mains hum in a torque channel: one frequency that stands all through the log, whatever the shafts do, taken off where it is strong.

What turns or meshes changes with the speed of the shafts and stays as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.gearbox.record import TORQUES, Record, Signal

# Grids and how far their frequency may be off; hum comes with its first multiples.
_GRIDS, _OFF, _MULTIPLES = (50.0, 60.0), 0.01, (1, 2, 3)
# Amplitude and phase of hum change slower than this, s. Noise is told from lines so far beside it, Hz.
_PIECE, _BESIDE = 1.0, (3.0, 4.0, 6.0, 7.0)
# Hum stands in that share of the pieces so far out of the noise, and as strong in all of them.
_SHARE, _STANDS, _EVEN = 0.9, 4.0, 3.0
# Less than that share of the noise from sample to sample does no harm.
_HARM = 0.5


@dataclass(frozen=True)
class Hum:
    """Strongest line of the mains in a channel: frequency, Hz, and amplitude, N m."""

    frequency: float
    amplitude: float


def without_hum(record: Record) -> tuple[Record, Mapping[str, Hum]]:
    """Return the record without strong hum in its torques, and what was taken off, by channel."""
    time, found, values = record.torque.time, {}, dict(record.torque.values)
    for name in TORQUES:
        lines = [hum for grid in _GRIDS for k in _MULTIPLES if (hum := hum_at(time, values[name], k * grid))]
        for hum in lines:
            values[name] = values[name] - wave(time, values[name], hum.frequency)
        if lines:
            found[name] = max(lines, key=lambda hum: hum.amplitude)
    return (replace(record, torque=Signal(time, values)) if found else record), found


def hum_at(time: np.ndarray, values: np.ndarray, near: float) -> Hum | None:
    """Return the line within 1 % of a frequency that stands in every piece of a log; None where there is none.

    Parameters
    ----------
    time, values
        s and N m, shape (n,).
    near
        Where to look, Hz.
    """
    step = float(np.median(np.diff(time)))
    size = round(_PIECE / step)
    count = time.size // size
    if count < 5 or near * (1 + _OFF) > 0.4 / step:
        return None
    t, x = time[: count * size].reshape(count, size), values[: count * size].reshape(count, size)
    x = (x - x.mean(axis=1, keepdims=True)) * np.hanning(size)
    # Pieces of a second have bins of 1 Hz: whether anything stands there at all is told quickly.
    spectrum, centre = np.abs(np.fft.rfft(x, axis=1)), round(near * size * step)
    top = spectrum[:, centre - 2 : centre + 3].max(axis=1)
    if np.mean(top > 0.75 * _STANDS * np.median(spectrum[:, centre - 8 : centre + 9], axis=1)) < _SHARE:
        return None
    frequencies = near * (1.0 + _OFF * np.linspace(-1.0, 1.0, 41))
    power = [float(np.sum(_amplitudes(t, x, f) ** 2)) for f in frequencies]
    frequency = float(frequencies[int(np.argmax(power))])
    own = _amplitudes(t, x, frequency)
    beside = np.median([_amplitudes(t, x, frequency + side * d) for d in _BESIDE for side in (-1, 1)], axis=0)
    stands = np.mean(own > _STANDS * beside)
    low, middle, high = np.percentile(own, [10, 50, 90])
    noise = float(np.std(np.diff(values))) / np.sqrt(2.0)
    # A strong line is noise from sample to sample as well.
    line = float(middle) * np.sqrt(2.0) * np.sin(np.pi * frequency * step)
    noise = float(np.sqrt(max(noise**2 - line**2, 0.0)))
    if stands < _SHARE or high > _EVEN * low or middle < _HARM * noise:
        return None
    return Hum(frequency, float(middle))


def wave(time: np.ndarray, values: np.ndarray, frequency: float) -> np.ndarray:
    """Return the wave of a frequency in a log, its amplitude and phase followed over a second, N m, shape (n,)."""
    from scipy.signal import fftconvolve

    size = round(_PIECE / float(np.median(np.diff(time))))
    window = np.hanning(size)
    turn = np.exp(-2j * np.pi * frequency * time)
    weight = fftconvolve(np.ones(time.size), window, "same")
    mean = fftconvolve(values, window, "same") / weight
    amplitude = 2.0 * fftconvolve((values - mean) * turn, window, "same") / weight
    return np.asarray((amplitude * turn.conj()).real)


def _amplitudes(time: np.ndarray, windowed: np.ndarray, frequency: float) -> np.ndarray:
    """Return the amplitude of a frequency in each piece, N m, shape (pieces,)."""
    sums = np.sum(windowed * np.exp(-2j * np.pi * frequency * time), axis=1)
    return np.asarray(2.0 * np.abs(sums) / np.hanning(time.shape[1]).sum())
