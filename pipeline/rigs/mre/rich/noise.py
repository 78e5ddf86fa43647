"""How much a fit of a record leaves where nothing but the sensors' white noise is left. No judgement here."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.mre.rich.fits import RichFit


def white(values: np.ndarray) -> float:
    """Return the standard deviation of white noise by third differences, in the unit of `values`."""
    return float(np.median(np.abs(np.diff(values, 3))) / 0.6745 / np.sqrt(20))


def expected_residual(fit: RichFit) -> float:
    """Return the rms (N) that noise of force and displacement leave after thinning and low-pass of the batch fit."""
    series, compared = fit.usable.series, fit.batch.series[fit.run]
    rate = 1 / float(np.median(np.diff(series.time)))
    step = round(rate * float(np.median(np.diff(compared["time"]))))
    of_force = white(series.F) * (np.sqrt(0.8 / step) if step > 1 else 1.0)
    stiffness = float(np.std(compared["force"]) / max(float(np.std(compared["displacement"])), 1e-300))
    of_motion = white(series.x) * stiffness * np.sqrt(min(2 * fit.batch.cutoff / rate, 1.0))
    return float(np.hypot(of_force, of_motion))
