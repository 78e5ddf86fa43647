"""Take a strong line of the shaft out of the displacement: where sampling folds it, no orbit has anything.

One-second samples that are no means carry the whole runout of the shaft at its alias (0.333 Hz for
16.667 Hz). Its phase wanders, so a band is taken out and not a sine.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.tpjb.rotating.noise import alias, alias_line, orbit_noise
from pipeline.rigs.tpjb.rotating.orbit import Orbit
from pipeline.signals.resampling import interpolated

# Amplitude over the noise beside it from which the line is taken out, and half width of the band, Hz by step.
_STRONG, _HALF_WIDTH = 4.0, 0.06


def without_shaft_line(orbit: Orbit) -> tuple[Orbit, float | None]:
    """Return the orbit without the shaft's line and the line's amplitude (m); the orbit itself and None where it is weak."""
    try:
        residual = orbit_noise(orbit).residual
    except InputError:
        return orbit, None
    line = alias_line(orbit, residual)
    if line is None or orbit.shaft_frequency is None:
        return orbit, None
    amplitude, _ = line
    beside = float(np.sqrt(max((residual**2).mean() - 0.5 * amplitude**2, 0.0)))
    if amplitude < _STRONG * beside:
        return orbit, None
    band = _band(orbit, residual, alias(orbit.shaft_frequency, orbit.step))
    return replace(orbit, displacement=orbit.displacement - band), amplitude


def _band(orbit: Orbit, residual: np.ndarray, at: float) -> np.ndarray:
    """Return what of a residual, shape (2, n), lies in the band about `at` (Hz), at the stamps of the orbit."""
    grid = np.arange(orbit.time[0], orbit.time[-1] + 0.5 * orbit.step, orbit.step)
    even = np.nan_to_num([interpolated(orbit.time, row, grid, np.inf, linear=True) for row in residual])
    spectrum = np.fft.rfft(even, axis=1)
    spectrum[:, np.abs(np.fft.rfftfreq(grid.size, orbit.step) - at) > _HALF_WIDTH / orbit.step] = 0.0
    band = np.fft.irfft(spectrum, grid.size, axis=1)
    return np.stack([np.interp(orbit.time, grid, row) for row in band])
