"""What the joint ring fit returns: values with their covariances, influences that all runs share, and each run's part."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.bench.ring_information import RingInformation
from pipeline.rigs.tire.bench.ring_model import NAMES, SIZES, Unknowns
from pipeline.rigs.tire.bench.ring_run import Known, Scatter
from pipeline.rigs.tire.ring.ring import Ring
from pipeline.rigs.tire.ring.sensor import Sensor

_ALIKE = Scatter()


@dataclass(frozen=True, eq=False)
class RunFit:
    """One run in the joint fit. SI.

    Attributes
    ----------
    nominal_load, nominal_speed, rotation
        N, m/s, rad/s.
    angle
        Where the patch's centre lies on the run's angles, rad.
    resistance, resistance_se
        R0, ohm.
    load
        Load that the fit takes the run to have, N: the measured one within its standard error.
    model, residual
        R2 of the model and measured less model, ohm, shape (n,); the residual is NaN where nothing was measured.
    chi2_reduced, band_chi2_reduced
        Mean square of the weighted residual, of all of it and of the orders that the sensor can feel.
    contact_length, contact_length_se, front, rear
        Lc, m; where the contact begins and ends on the run's angles, rad.
    loaded_radius
        Height of the hub over the road, m.
    """

    run: str
    nominal_load: float
    nominal_speed: float
    rotation: float
    angle: float
    resistance: float
    resistance_se: float
    load: float
    model: np.ndarray
    residual: np.ndarray
    chi2_reduced: float
    band_chi2_reduced: float
    contact_length: float
    contact_length_se: float
    front: float
    rear: float
    loaded_radius: float


@dataclass(frozen=True)
class Influence:
    """An error that all runs share: its relative standard uncertainty and d(coordinates)/d ln(source), shape (9,)."""

    source: str
    relative: float
    slopes: np.ndarray


@dataclass(frozen=True, eq=False)
class RingFit:
    """Result of the joint fit; whether its numbers may be told is another question (`identifiability.told`).

    Attributes
    ----------
    values
        EI, b, kw, kv, kt, c, eta, tau_f, Ls.
    covariance
        Type A, widened by misfit and correlation of the residual; of logarithms, except loss factor and lag (SI); (9, 9).
    influences
        Type B.
    chi2_reduced, band_chi2_reduced
        Of all runs.
    widening
        Factor on the covariance.
    correlation_length
        Bins over which the residual is correlated; 1 where it is white.
    singular
        Singular values of the Jacobian of the nine with columns of unit length.
    at_bound
        Names that ended at a bound.
    left_out
        Runs that were not used, with the reason.
    scale_held
        Whether the scale of stiffnesses and gain rests on a guess of the belt's width.
    information
        What the runs tell about the nine, as wide as the covariance is; with priors.
    held
        What of the information about the belt's width is a guess; 0 unless `scale_held`.
    noise, load_se
        Of a typical run: standard error of an angle's R2 at R0, ohm; relative one of the load.
    scatter
        By how much load, gain and pressure differ from run to run beyond their noise; none where none was looked for.
    """

    values: Unknowns
    covariance: np.ndarray
    influences: tuple[Influence, ...]
    known: Known
    runs: tuple[RunFit, ...]
    chi2_reduced: float
    band_chi2_reduced: float
    widening: float
    correlation_length: float
    singular: np.ndarray
    at_bound: tuple[str, ...]
    converged: bool
    evaluations: int
    loads: int
    speeds: int
    left_out: dict[str, str]
    scale_held: bool
    information: RingInformation
    held: float
    noise: float
    load_se: float
    scatter: Scatter = _ALIKE

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the findings, the sensor's length last; order of the matrices."""
        return NAMES

    @property
    def combined(self) -> np.ndarray:
        """Covariance with type B, units as in `covariance`, shape (9, 9)."""
        shared = [(i.relative * i.slopes) for i in self.influences]
        return np.asarray(self.covariance + sum((np.outer(s, s) for s in shared), np.zeros_like(self.covariance)))

    @property
    def log_covariance(self) -> np.ndarray:
        """Type A covariance of the logarithms, shape (9, 9)."""
        scale = np.array([1.0 / (abs(getattr(self.values, n)) or 1e-30) if n in SIZES else 1.0 for n in NAMES])
        return np.asarray(self.covariance * np.outer(scale, scale))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of `covariance`, shape (9, 9)."""
        sd = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(sd, sd))

    def std_error(self, name: str, combined: bool = True) -> float:
        """Return the standard error in SI."""
        i = NAMES.index(name)
        sd = math.sqrt((self.combined if combined else self.covariance)[i, i])
        return sd if name in SIZES else sd * float(getattr(self.values, name))

    def ring(self, pressure: float) -> Ring:
        """Return the fitted ring under `pressure` (Pa)."""
        return self.values.ring(self.known.R, pressure)

    def sensor(self, R0: float, VIN: float = 3.3, R1: float = 1e4) -> Sensor:
        """Return the fitted flex sensor."""
        v = self.values
        return Sensor(v.sensor_gain, R0, v.sensor_length, v.sensor_lag, VIN, R1)
