"""What one more column would find in the residual of a fit in time, and by how much it would shift the parameters.

Columns are those of faults that the model does not hold: a gain that changes, a mass, a curved sensor, a pad that
hardens. One linearised step each; nothing is refitted here, and nothing judged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.separable import SeparableFit
from pipeline.rigs.mre.model.time_columns import Segment
from pipeline.rigs.mre.model.time_model import TimeModel

_STRETCHES = 60  # of the record, whose scatter is the error of what is found: residuals are coloured
_PLACES, _ENDS = 99, 5  # in the record, at which a step is looked for, and those next to its ends that are left out
_STEP = 1e-3  # share of the displacement by which it is bent for a derivative

PAD, LOAD_CELL, DISPLACEMENT = "pad", "load cell", "displacement sensor"


@dataclass(frozen=True, eq=False)
class Evidence:
    """Coefficient of a column with its standard error, and what of the squared residual it takes away.

    `shift` is what the physical parameters (n_shape + terms,) would change by if the column were fitted along, the
    first two, tau and rho, as logarithms.
    """

    size: float
    std_error: float
    share: float
    shift: np.ndarray

    @property
    def times_error(self) -> float:
        """Size over its standard error, without sign."""
        return abs(self.size) / self.std_error if self.std_error > 0 else 0.0


def modelled(model: TimeModel, fit: SeparableFit) -> np.ndarray:
    """Return the force of the physical terms at the usable rows, N: no offset, drift or hum."""
    terms = len(model.terms)
    return np.asarray(fit.jacobian[:, model.n_shape : model.n_shape + terms] @ fit.c[:terms])


def evidence(column: np.ndarray, model: TimeModel, fit: SeparableFit) -> Evidence:
    """Return what one more column, shape (rows,), would find in the residual of `fit`."""
    basis, triangle = np.linalg.qr(fit.jacobian)
    inside = basis.T @ column
    rest = column - basis @ inside
    physical = model.n_shape + len(model.terms)
    power = float(rest @ rest)
    if power <= 1e-12 * float(column @ column):
        return Evidence(0.0, math.inf, 0.0, np.zeros(physical))
    size = float(rest @ fit.residual) / power
    left = rest * (fit.residual - size * rest)
    stretches = np.add.reduceat(left, np.arange(_STRETCHES) * left.size // _STRETCHES)
    error = math.sqrt(float(stretches @ stretches) * _STRETCHES / (_STRETCHES - 1)) / power
    shift = -size * np.linalg.lstsq(triangle, inside, rcond=None)[0][:physical]
    return Evidence(size, error, size**2 * power / fit.chi2 if fit.chi2 > 0 else 0.0, shift)


def changing_gain(model: TimeModel, fit: SeparableFit, here: np.ndarray) -> Evidence:
    """Return by which share the force of a run (`here` among the usable rows) changes from start to end."""
    grows = np.where(here, modelled(model, fit), 0.0)
    grows[here] *= np.linspace(-0.5, 0.5, int(here.sum()))
    return evidence(grows, model, fit)


def viscous(model: TimeModel, fit: SeparableFit) -> Evidence:
    """Return what a dashpot beside the others (N s/m) would find, nothing where there is one."""
    return evidence(np.concatenate([part.velocity for part in model.segments])[model.usable], model, fit)


def stepping_zero(model: TimeModel, fit: SeparableFit) -> tuple[float, Evidence]:
    """Return when (s) one step of the force's zero would explain most, and its evidence (N)."""
    time = np.concatenate([part.time for part in model.segments])[model.usable]
    edges = np.linspace(time[0], time[-1], _PLACES + 2)[_ENDS:-_ENDS]
    after = (time[:, None] >= edges).astype(float)
    basis = np.linalg.qr(fit.jacobian)[0]
    rest = after - basis @ (basis.T @ after)
    power = np.maximum((rest**2).sum(axis=0), 1e-9 * time.size)
    best = int(np.argmax((rest.T @ fit.residual) ** 2 / power))
    return float(edges[best]), evidence(after[:, best], model, fit)


def curves(model: TimeModel, fit: SeparableFit) -> Mapping[str, Evidence]:
    """Return what a cubic of each sensor, and of the pad, would find.

    Sizes are the share by which the sensor is off at the largest excursion (positive: it reads too much there), and
    for the pad the cubic stiffness, N/m^3.
    """
    force = modelled(model, fit)
    force = force - 0.5 * (force.max() + force.min())
    x = np.concatenate([part.x for part in model.segments])[model.usable]
    middle, reach = 0.5 * (x.max() + x.min()), 0.5 * float(np.ptp(x))
    columns = {
        PAD: (x - middle) ** 3,
        LOAD_CELL: force * (force / np.abs(force).max()) ** 2,
        DISPLACEMENT: -_bent(model, fit, middle, reach),
    }
    return {name: evidence(column, model, fit) for name, column in columns.items()}


def _bent(model: TimeModel, fit: SeparableFit, middle: float, reach: float) -> np.ndarray:
    """Return the change of the model's force where the displacement is bent by a cubic, over the share of that, N."""
    bent = TimeModel([_cubed(part, middle, reach) for part in model.segments], model.options, model.usable)
    straight = model.restricted(model.usable)
    terms = len(model.terms)
    force = (bent(fit.q)[0][:, :terms] - straight(fit.q)[0][:, :terms]) @ fit.c[:terms]
    return np.asarray(force / _STEP)


def _cubed(part: Segment, middle: float, reach: float) -> Segment:
    strayed = (part.x - middle) / reach
    x = part.x + _STEP * reach * strayed**3
    velocity = part.velocity * (1 + 3 * _STEP * strayed**2)
    return replace(part, x=x, velocity=velocity, acceleration=np.gradient(velocity, part.time))
