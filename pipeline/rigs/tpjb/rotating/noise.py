"""How large the noise of an orbit is, before any bearing law is fitted, and at the frequencies that matter.

The reference is a polynomial of the force: whatever quasi-static law the bearing has, its displacement is a
smooth function of the force, so what such a polynomial and a slow drift leave over is noise. Laws that
leave more do not hold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.tpjb.rotating.harmonics import harmonics
from pipeline.rigs.tpjb.rotating.orbit import Orbit
from pipeline.signals.resampling import interpolated

# The coefficients listen to these orders of the rotation only (0.004 to 0.2 Hz at 0.01 Hz).
BAND = (0.4, 20.0)
_DEGREE = 8


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of one run.

    Attributes
    ----------
    sigma
        Standard deviation of the displacement along x and y, shape (2,), m, alias line of the shaft and
        noise of the force included.
    dof
        Degrees of freedom behind each.
    force
        Standard deviation of the force signal per axis, N.
    residual
        What the reference leaves over, shape (2, n), m.
    """

    sigma: np.ndarray
    dof: float
    force: float
    residual: np.ndarray


def orbit_noise(orbit: Orbit) -> Noise:
    """Return the noise of a run from a polynomial of the force and a drift of second degree.

    Raises
    ------
    InputError
        If there are fewer than 40 samples.
    """
    n = orbit.time.size
    if n < 40:
        raise InputError(f"run {orbit.run}: {n} samples are too few for an orbit; at least 40 are needed.")
    f = orbit.force / np.abs(orbit.force).max()
    degree = max(m for m in range(2, _DEGREE + 1) if m == 2 or (m + 1) * (m + 2) / 2 + 2 < n / 5)
    powers = [f[0] ** (total - j) * f[1] ** j for total in range(degree + 1) for j in range(total + 1)]
    columns = np.stack([*powers, orbit.tau, orbit.tau**2], axis=1)
    solution, _, rank, _ = np.linalg.lstsq(columns, orbit.displacement.T, rcond=1e-10)
    residual = (orbit.displacement.T - columns @ solution).T
    dof = n - int(rank)
    sigma = np.sqrt((residual**2).sum(axis=1) / dof)
    smallest = 1e-9 * np.abs(orbit.displacement).max() + 1e-300  # data without any noise
    return Noise(np.maximum(sigma, smallest), float(dof), _force_noise(orbit), residual)


def _force_noise(orbit: Orbit) -> float:
    """Return the standard deviation of the force signal: as given, or from third differences of its residual."""
    if orbit.force_noise is not None:
        return orbit.force_noise
    steady = orbit.part(orbit.rotation.steady)
    try:
        z = harmonics(steady.time, steady.force, orbit.rotation.frequency).residual
    except InputError:
        z = steady.force[0] + 1j * steady.force[1]
    third = np.diff(z, 3)
    # A median, so that single jumps of the load do not count; |.|^2 of two axes has the median 2 ln 2 sigma^2.
    return math.sqrt(float(np.median(np.abs(third) ** 2)) / (2 * math.log(2)) / 20)


def low_band(
    time: np.ndarray,
    residual: np.ndarray,
    rotation: float,
    shaft: float | None = None,
    band: tuple[float, float] = BAND,
) -> tuple[np.ndarray, float]:
    """Return the noise of the frequencies that reach the coefficients, as the sigma of white noise as large.

    Parameters
    ----------
    time, residual
        Stamps (s), shape (n,), and residual, shape (2, n), in any unit.
    rotation
        Frequency of the load, Hz; `band` counts in multiples of it.
    shaft
        Shaft frequency, Hz; the place to which sampling folds it does not count.

    Returns
    -------
    sigma of each axis, shape (2,), and the degrees of freedom of each.
    """
    step = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1] + 0.5 * step, step)
    if grid.size != time.size or np.abs(grid - time).max() > 0.1 * step:
        residual = np.stack([interpolated(time, row, grid, np.inf, linear=True) for row in residual])
        residual = np.nan_to_num(residual)
    n = residual.shape[1]
    power = np.abs(np.fft.rfft(residual, axis=1)) ** 2 / n
    frequency = np.fft.rfftfreq(n, step)
    low, high = (edge * abs(rotation) for edge in band)
    inside = (frequency >= low) & (frequency <= min(high, 0.45 / step))
    if shaft is not None:
        inside &= np.abs(frequency - alias(shaft, step)) > 4 / (n * step)
    if inside.sum() < 3:
        return np.sqrt((residual**2).mean(axis=1)), float(n)
    return np.sqrt(power[:, inside].mean(axis=1)), 2.0 * float(inside.sum())


def alias(frequency: float, step: float) -> float:
    """Return where a frequency (Hz) shows after sampling every `step` seconds, means of a step alike.

    Examples
    --------
    >>> round(alias(1000 / 60, 1.0), 3)
    0.333
    """
    return abs(frequency - round(frequency * step) / step)


def alias_line(orbit: Orbit, residual: np.ndarray) -> tuple[float, float] | None:
    """Return the amplitude (m) of the shaft's line in a residual, shape (2, n), and where it shows, Hz.

    The whole line, which wanders in phase: from the power above the floor beside it. None where the
    shaft frequency is not known or folds into the band of the orbit.
    """
    if orbit.shaft_frequency is None:
        return None
    at = alias(orbit.shaft_frequency, orbit.step)
    n = residual.shape[1]
    frequency = np.fft.rfftfreq(n, orbit.step)
    power = (np.abs(np.fft.rfft(residual, axis=1)) ** 2).sum(axis=0) / n
    width = max(0.03, 6 / (n * orbit.step))
    near = np.abs(frequency - at) < width
    beside = (np.abs(frequency - at) < 3 * width) & ~near & (frequency > 6 * abs(orbit.rotation.frequency))
    if at < BAND[1] * abs(orbit.rotation.frequency) or not near.any() or beside.sum() < 4:
        return None
    excess = float(power[near].sum() - near.sum() * np.median(power[beside]) / math.log(2))
    return math.sqrt(max(2 * excess / n, 0.0)), at
