"""Fisher information of bench runs about ring, tread and sensor: of those that were fitted, and of runs not made yet.

Runs are independent but for what all share (gauges, radii); each run's own angle, load error and unevenness are integrated
out with their priors. What is proposed on it is in `advise`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.bench.ring_model import NAMES, RingModel, Unknowns
from pipeline.rigs.tire.bench.ring_run import Known, RingRun, Scatter
from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.ring import grid
from pipeline.rigs.tire.ring.sensor import Sensor, flex_shape, voltage_slope

SOURCES = ("pressure", "load_gain", "belt_radius", "outer_radius")
_STEP = 1e-3


@dataclass(frozen=True, eq=False)
class RingInformation:
    """What runs tell about the shared coordinates of the fit (logarithms, or values in their size).

    Attributes
    ----------
    matrix
        Fisher information, all else integrated out, shape (9, 9).
    pulls
        What each source that all runs share (`SOURCES`) adds to the right-hand side per relative change, shape (9, 4): the
        coordinates follow it by ``inv(matrix) @ pulls``.
    """

    matrix: np.ndarray
    pulls: np.ndarray

    def __add__(self, other: RingInformation) -> RingInformation:
        """Return the information of the runs of both."""
        return RingInformation(self.matrix + other.matrix, self.pulls + other.pulls)

    def __mul__(self, factor: float) -> RingInformation:
        """Return the information of so many times the runs."""
        return RingInformation(factor * self.matrix, factor * self.pulls)

    def covariance(self, sources: np.ndarray) -> np.ndarray:
        """Return the covariance of the coordinates for relative standard uncertainties of `SOURCES`, shape (9, 9)."""
        size = 1.0 / np.sqrt(np.diag(self.matrix))
        plain = np.linalg.pinv(self.matrix * np.outer(size, size), rcond=1e-14, hermitian=True) * np.outer(size, size)
        slopes = plain @ self.pulls * sources
        return np.asarray(plain + slopes @ slopes.T)


def shared_changes(model: RingModel, x: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Return what a relative change of each of `SOURCES` does to the residual, shape (rows, 4)."""
    known = model.known
    rows = sum(w.size for w in model.weights) + len(model.heights)
    found = np.zeros((J.shape[0], len(SOURCES)))
    found[:rows, 0] = J[:rows, NAMES.index("belt_width")]
    found[:rows, 1] = J[:rows, [model.own(i).start + 1 for i in range(len(model.runs))]].sum(axis=1)
    here = model.residual(x)
    found[:, 2] = (model.changed(R=known.R * (1.0 + _STEP)).residual(x) - here) / _STEP
    found[:, 3] = (model.changed(Ro=known.Ro * (1.0 + _STEP)).residual(x) - here) / _STEP
    return found


def information_of(model: RingModel, x: np.ndarray, priors: bool = True) -> RingInformation:
    """Return what the runs of a model tell at the coordinates x; without what is known beforehand unless `priors`."""
    J = model.jacobian(x)
    kept = np.ones(J.shape[0], dtype=bool)
    if not priors:
        first = J.shape[0] - len(model.priors)
        kept[[first + j for j, (at, _, _) in enumerate(model.priors) if at < len(NAMES)]] = False
    changes = shared_changes(model, x, J)[kept]
    J = J[kept]
    shared, own = J[:, : len(NAMES)], J[:, len(NAMES) :]
    basis = np.linalg.qr(own / np.linalg.norm(own, axis=0))[0]
    free = shared - basis @ (basis.T @ shared)
    return RingInformation(free.T @ free, -free.T @ changes)


@dataclass(frozen=True)
class Bench:
    """How a bench measures: what a run not made yet would be like.

    Attributes
    ----------
    noise
        Standard error of R2 at R0 by angle in a run as the others, ohm; it grows with the inverse slope of the divider.
    load_se
        Relative standard error of a run's mean load.
    R0, supply_voltage, divider_resistance
        Of the divider, ohm, V, ohm.
    bins
        Angles of an averaged waveform.
    """

    noise: float
    load_se: float
    R0: float
    supply_voltage: float
    divider_resistance: float
    bins: int

    def run(self, values: Unknowns, known: Known, load: float, speed: float, pressure: float) -> RingRun:
        """Return the waveform of a run at load (N), speed (m/s) and pressure (Pa), without noise, with its errors."""
        contact = pressed(compliance(values.ring(known.R, pressure)), values.tread_stiffness, known.Ro, load)
        sensor = Sensor(values.sensor_gain, self.R0, values.sensor_length, values.sensor_lag)
        rotation = speed / known.R
        theta = grid(self.bins)
        R2 = self.R0 + flex_shape(contact.shape, sensor, known.R, rotation).at(theta)
        flat, bent = (voltage_slope(np.asarray(R), self.supply_voltage, self.divider_resistance) for R in (self.R0, R2))
        return RingRun(
            "proposed", theta, R2, self.noise * flat / bent, load, self.load_se * load, rotation, pressure, load, speed
        )


def of_proposed(
    bench: Bench, values: Unknowns, known: Known, scatter: Scatter, point: tuple[float, float, float]
) -> RingInformation:
    """Return what one run at (load, speed, pressure) would tell beside runs that are there."""
    model = RingModel([bench.run(values, known, *point)], known, scatter)
    x = np.zeros(model.size)
    x[: len(NAMES)] = values.coordinates()
    return information_of(model, x, priors=False)
