"""Averaged power and cross spectra on a grid with gaps, and hum from the mains.

A thin layer: amplitudes of known lines come from `pipeline.estimation.harmonic`, which needs no grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError


@dataclass(frozen=True, eq=False)
class Spectra:
    """One-sided spectral densities of two signals, shape (frequencies,).

    `pxx` and `pyy` in unit^2/Hz, `pxy` = conj(X) Y complex; `averages` is the number of independent
    segments that their overlap amounts to.
    """

    frequency: np.ndarray
    pxx: np.ndarray
    pyy: np.ndarray
    pxy: np.ndarray
    averages: float

    @property
    def coherence(self) -> np.ndarray:
        """Magnitude-squared coherence, 0..1; NaN where a signal has no power."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.abs(self.pxy) ** 2 / (self.pxx * self.pyy))

    def coherence_threshold(self, level: float = 0.95) -> float:
        """Return what the coherence of independent signals stays below with probability `level`.

        Carter, Knapp and Nuttall, IEEE Trans. Audio Electroacoust. 21, 1973, 337.
        """
        return float(1 - (1 - level) ** (1 / (self.averages - 1))) if self.averages > 1 else 1.0


def welch(x: np.ndarray, y: np.ndarray, rate: float, segment: int) -> Spectra:
    """Average Hann-windowed segments that overlap by half (Welch 1967).

    Parameters
    ----------
    x, y
        On the same uniform grid, shape (n,); the same array twice for a power spectrum only.
        Segments that hold a NaN are left out.
    rate
        Samples per second (or per radian: then the frequency is an order over 2 pi).
    segment
        Samples of one segment.

    Raises
    ------
    InputError
        If no whole segment is left.
    """
    if segment < 4 or x.size < segment:
        raise InputError(f"{x.size} samples hold no segment of {segment}; use shorter segments or log longer.")
    hop = segment // 2
    windows = [np.lib.stride_tricks.sliding_window_view(signal, segment)[::hop] for signal in (x, y)]
    whole = np.isfinite(windows[0]).all(axis=1) & np.isfinite(windows[1]).all(axis=1)
    if not whole.any():
        raise InputError(f"every segment of {segment} samples has a gap; use shorter segments.")
    hann = np.hanning(segment + 1)[:-1]
    X, Y = (np.fft.rfft((w[whole] - w[whole].mean(axis=1, keepdims=True)) * hann, axis=1) for w in windows)
    one_sided = np.full(X.shape[1], 2.0)
    one_sided[0] = 1.0
    if segment % 2 == 0:
        one_sided[-1] = 1.0
    scale = one_sided / (rate * (hann**2).sum())
    # Neighbours share a sixth of their windowed values: K segments count as K / (1 + 2/36) (1 - 1/K).
    count = int(whole.sum())
    return Spectra(
        np.fft.rfftfreq(segment, 1 / rate),
        scale * (np.abs(X) ** 2).mean(axis=0),
        scale * (np.abs(Y) ** 2).mean(axis=0),
        scale * (np.conj(X) * Y).mean(axis=0),
        count / (1 + 2 / 36 * (1 - 1 / count)),
    )


@dataclass(frozen=True)
class Hum:
    """A line at a multiple of the mains frequency: its amplitude and that of the noise beside it."""

    frequency: float
    amplitude: float
    noise: float

    @property
    def present(self) -> bool:
        """Tell whether the line stands out; by chance it does about once in 2000."""
        return self.amplitude > 3.03 * self.noise


def hum(time: np.ndarray, residual: np.ndarray, mains: float = 50.0, multiples: int = 3) -> list[Hum]:
    """Measure the lines at multiples of the mains frequency in what a model left over.

    Parameters
    ----------
    time, residual
        Stamps (s) and residual, shape (n,); NaN do not count.
    mains
        50 or 60 Hz.
    multiples
        How many; those above 0.45 of the sampling rate are left out.

    Returns
    -------
    One entry a line, largest amplitude found within 0.1 % (or a line width 1/T) of it.
    """
    kept = np.isfinite(residual) & np.isfinite(time)
    t, r = time[kept], residual[kept] - (residual[kept].mean() if kept.any() else 0.0)
    if t.size < 16:
        return []
    resolution = 1 / (t[-1] - t[0])
    highest = 0.45 / float(np.median(np.diff(t)))

    def amplitude(frequency: float) -> float:
        return float(2 * abs(np.exp(-2j * np.pi * frequency * t) @ r) / t.size)

    found = []
    for multiple in range(1, multiples + 1):
        line = multiple * mains
        if line > highest:
            break
        search = np.arange(-1, 1.01, 0.25) * max(1e-3 * line, resolution)
        values = [amplitude(line + shift) for shift in search]
        beside = [amplitude(line + k * resolution + np.sign(k) * search[-1]) for k in range(-12, 13) if abs(k) > 2]
        best = int(np.argmax(values))
        found.append(Hum(float(line + search[best]), values[best], float(np.sqrt(np.mean(np.square(beside))))))
    return found


def near_mains(frequencies: np.ndarray, duration: float, mains: float = 50.0) -> np.ndarray:
    """Tell which frequencies (Hz) lie within 2/T of a multiple of the mains frequency, shape as given.

    Examples
    --------
    >>> near_mains(np.array([45.0, 49.9, 100.1, 75.0]), 10.0)
    array([False,  True,  True, False])
    """
    nearest = np.maximum(np.rint(frequencies / mains), 1.0) * mains
    return np.asarray(np.abs(frequencies - nearest) < 2 / duration)
