"""Honest standard errors: what coloured residuals and run-to-run scatter do to a covariance."""

from __future__ import annotations

import numpy as np


def autocovariance(residual: np.ndarray, lags: int) -> np.ndarray:
    """Return the autocovariance at lags 0..`lags`, shape (lags + 1,), mean removed, by FFT (biased form)."""
    centred = residual - residual.mean()
    size = 1 << int(np.ceil(np.log2(centred.size + lags + 1)))
    spectrum = np.fft.rfft(centred, size)
    return np.asarray(np.fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[: lags + 1] / centred.size)


def effective_size(residual: np.ndarray) -> float:
    """Return how many independent samples carry as much on the mean as these correlated ones.

    Sum of the autocorrelation over Geyer's initial positive sequence (Statistical Science 7, 1992,
    473): pairs of lags are added until a pair is no longer positive. Never above the actual number.

    Examples
    --------
    >>> white = np.random.default_rng(1).normal(size=4000)
    >>> bool(effective_size(white) > 3500)
    True
    >>> bool(80 < effective_size(np.cumsum(white)[::1] * 0 + np.repeat(white[:100], 40)) < 130)
    True
    """
    n = residual.size
    if n < 4:
        return float(n)
    covariance = autocovariance(residual, n // 2)
    if covariance[0] <= 0:
        return float(n)
    correlation = covariance / covariance[0]
    pairs = correlation[:-1:2] + correlation[1::2]
    stop = int(np.argmax(pairs <= 0)) if np.any(pairs <= 0) else pairs.size
    time = 2 * float(np.minimum.accumulate(pairs[:stop]).sum()) - 1
    return float(n / max(time, 1.0))
