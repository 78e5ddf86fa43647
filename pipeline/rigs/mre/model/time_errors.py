"""Covariance of a fit in time, whose residual is noise of any colour."""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimation.separable import covariance_of
from pipeline.estimation.uncertainty import Covariance, clustered, effective_size, newey_west

_STRETCHES = 60  # of a record, whose scatter is held against its coloured noise
_BY_CHANCE = 1.4  # times the errors: what stretches of unequal weight scatter by chance, their own error up to 17 %
_LEAST_LEFT = 0.2  # share of the noise that the fit leaves around a frequency, below which it is not scaled up further
_FEWEST = 2000  # rows for a spectrum


def coloured(jacobian: np.ndarray, residual: np.ndarray, memory: int) -> Covariance:
    """Return the covariance for stationary noise of any colour, no parameter surer than stretches of the record scatter.

    A change of the noise along the record, and noise of the displacement, which goes through w and is remembered over
    cycles and amplitudes, is in that scatter only. It is held against chance: the larger of two estimates would be too
    large on average.

    Parameters
    ----------
    jacobian
        Of the physical parameters, offsets and the like projected out, shape (n, k).
    residual
        Shape (n,).
    memory
        Rows over which the noise of the low-passed displacement hangs together, for records too short for a spectrum.
    """
    if residual.size < max(_STRETCHES * memory, _FEWEST):
        return newey_west(jacobian, residual, memory)
    found = stationary(jacobian, residual)
    groups = np.arange(residual.size) * _STRETCHES // residual.size
    try:
        ratio = clustered(jacobian, residual, groups).std_error / found.std_error
    except (ValueError, np.linalg.LinAlgError):
        return found
    if not np.any(ratio > _BY_CHANCE):
        return found
    wider = np.where(ratio > _BY_CHANCE, ratio, 1.0)
    return Covariance(found.matrix * np.outer(wider, wider), min(found.dof, _STRETCHES - 1.0), found.method)


def stationary(jacobian: np.ndarray, residual: np.ndarray) -> Covariance:
    """Return the sandwich covariance with the noise's spectrum, a running mean of the residual's periodogram.

    B (sum_f S(f) j(f) j(f)^H) B with j the transform of the rows and B = (J^T J)^-1. Parameters that move at some frequencies feel the
    noise there, which no window over lags shorter than their period can tell from that around. What the fit took out of
    the residual around a frequency is given back.

    Examples
    --------
    The error of the mean of white noise is its textbook one:

    >>> noise = np.random.default_rng(1).normal(size=10000)
    >>> error = stationary(np.ones((10000, 1)), noise).std_error[0]
    >>> bool(abs(error / 0.01 - 1) < 0.1)
    True
    """
    n, k = jacobian.shape
    scale = np.linalg.norm(jacobian, axis=0)
    columns = jacobian / scale
    basis = np.linalg.qr(columns)[0]
    taken = (np.abs(np.fft.rfft(basis, axis=0, norm="ortho")) ** 2).sum(axis=1)
    half = max(round(math.sqrt(n) / 4), 1)
    left = np.maximum(1 - _running_mean(taken, half), _LEAST_LEFT)
    noise = _running_mean(np.abs(np.fft.rfft(residual, norm="ortho")) ** 2, half) / left
    transform = np.fft.rfft(columns, axis=0, norm="ortho")
    twice = np.full(noise.size, 2.0)  # each ordinate stands for two, but for the first and, of an even number, the last
    twice[0] = 1.0
    if n % 2 == 0:
        twice[-1] = 1.0
    meat = ((transform * (twice * noise)[:, None]).conj().T @ transform).real
    bread = covariance_of(columns)[0]
    dof = max(effective_size(residual, k) - k, 1.0)
    return Covariance(bread @ meat @ bread / np.outer(scale, scale), dof, "spectrum of the residual")


def _running_mean(values: np.ndarray, half: int) -> np.ndarray:
    """Return the mean over `half` ordinates to both sides, mirrored at the ends."""
    half = min(half, values.size - 1)
    mirrored = np.concatenate([values[half:0:-1], values, values[-2 : -half - 2 : -1]])
    total = np.cumsum(np.concatenate([[0.0], mirrored]))
    return np.asarray((total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1))
