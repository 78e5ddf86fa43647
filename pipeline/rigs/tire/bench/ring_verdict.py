"""Does the ring model hold on these runs? A verdict on the residual of the joint fit; parameters of a model that does not are no truth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.rigs.in_words import times_noise
from pipeline.rigs.tire.bench.ring_result import RingFit

Level = Literal["ok", "doubt", "rejected"]

# Mean squared weighted residual that good averages stay below: over all angles, and over the orders that the sensor feels.
_LARGEST = 2.0
_LARGEST_BAND = 4.0
_DOUBTFUL_BAND = 1.6
_CORRELATED = 1.5
_RISE = 4.0
# By how much runs of one bench may differ (relative) before it is told, and before it is a fault.
_TOLD_SCATTER, _MOST_SCATTER = 5e-4, 0.03


@dataclass(frozen=True)
class RingVerdict:
    """How well the model fits.

    Attributes
    ----------
    level
        "rejected" where no parameter may be taken as truth, "doubt" where the intervals were widened for it.
    misfit
        Rms of the residual over the rms of the noise in it, in excess; relative to the highest peak.
    load_trend, speed_trend
        By how many standard errors the misfit rises with load or speed; NaN where there is only one.
    statement
        In a sentence or three.
    """

    level: Level
    chi2_reduced: float
    band_chi2_reduced: float
    correlation_length: float
    misfit: float
    load_trend: float
    speed_trend: float
    statement: str

    @property
    def fits(self) -> bool:
        """Tell whether parameters may be told."""
        return self.level != "rejected"


def judged(fit: RingFit) -> RingVerdict:
    """Return the verdict on a joint fit.

    Notes
    -----
    A residual that is larger than its noise and correlated from angle to angle is a wrong model. One that is only
    larger is noise that was told too small, for which the intervals are widened.
    """
    chi2, band, length = fit.chi2_reduced, fit.band_chi2_reduced, fit.correlation_length
    coloured = length > _CORRELATED
    load_trend = _trend(fit, [run.load for run in fit.runs])
    speed_trend = _trend(fit, [run.rotation for run in fit.runs])
    rising = max(load_trend, speed_trend) > _RISE if fit.runs else False
    level: Level = "ok"
    if (coloured and (chi2 > _LARGEST or band > _LARGEST_BAND)) or fit.scatter.size > _MOST_SCATTER:
        level = "rejected"
    elif chi2 > _LARGEST or band > _DOUBTFUL_BAND or fit.scatter.size > _TOLD_SCATTER or not fit.converged:
        level = "doubt"
    misfit = _misfit(fit)
    size = f"rms residual {times_noise(chi2)}, {times_noise(band)} in the orders that the sensor feels"
    if level == "ok":
        said = f"The ring model fits: what it leaves is as large as the scatter of the averages ({size})."
    elif level == "rejected" and fit.scatter.size > _MOST_SCATTER:
        said = (
            f"The runs contradict each other: load, sensor gain or pressure would have to differ from run to run by {100.0 * fit.scatter.size:.1f} %. Look at "
            "the loads, the pressure before and behind each run and the bond."
        )
    elif level == "rejected":
        said = (
            f"The model does not fit ({size}): it leaves {100.0 * misfit:.2f} % of the peak, correlated over {length:.0f} angles. "
            "Parameters of a model that does not fit are not told. Look for creep of the sensor, a wrong load, pressure "
            "or sensor length, a bond that yields, or a first harmonic."
        )
    elif not coloured and chi2 > _LARGEST:
        said = f"The residual is white but larger than the standard errors tell ({size}); the intervals are widened for it."
    elif fit.scatter.size > _TOLD_SCATTER:
        said = (
            f"The ring model fits ({size}) once load, sensor gain and pressure may differ from run to run by {100.0 * fit.scatter.size:.2f} %, more than their noise "
            "explains (friction, temperature, pressure reset between runs); the intervals hold that."
        )
    elif not fit.converged:
        said = f"The search did not end by its own tolerance ({size}); take the numbers with doubt."
    else:
        said = f"The model leaves a little more than noise ({size}, {100.0 * misfit:.2f} % of the peak); the intervals are widened."
    if level != "ok" and rising:
        kind = "load" if not speed_trend > load_trend else "speed"
        said += f" The misfit rises with {kind}."
    return RingVerdict(level, chi2, band, length, misfit, load_trend, speed_trend, said)


def _misfit(fit: RingFit) -> float:
    """Return the rms of the residual in excess of its noise over the highest peak."""
    worst = 0.0
    for run in fit.runs:
        residual = run.residual[np.isfinite(run.residual)]
        share = max(1.0 - 1.0 / run.chi2_reduced, 0.0) if run.chi2_reduced > 0.0 else 0.0
        height = float(np.nanmax(run.model) - run.resistance)
        worst = max(worst, math.sqrt(share * float(np.mean(residual**2))) / height if height > 0.0 else 0.0)
    return worst


def _trend(fit: RingFit, against: list[float]) -> float:
    """Return by how many standard errors ln of the runs' mean squared residual rises with ln of `against`."""
    x = np.log(np.array(against))
    if x.size < 3 or np.ptp(x) < 0.1:
        return math.nan
    y = np.log([max(run.band_chi2_reduced, 1e-12) for run in fit.runs])
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    bins = fit.runs[0].residual.size / 8.0
    return slope * math.sqrt(float(centred @ centred)) / math.sqrt(2.0 / bins)
