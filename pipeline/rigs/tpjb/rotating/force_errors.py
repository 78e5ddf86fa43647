"""What stands in the measured forces beside the film's: a delay against the motion, or friction that the load cells carry.

Under a steady turning load both look like cross coupling; ramps and unrest of the load tell them apart: a delay
counts in proportion to the force's rate, friction does not. Nothing is taken off here (see `mending`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.estimation.uncertainty import Covariance
from pipeline.rigs.tpjb.axes import FROM_UV
from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit
from pipeline.rigs.tpjb.rotating.noise import low_band
from pipeline.rigs.tpjb.rotating.orbit import Orbit

Kind = Literal["delay", "friction", "actuators"]
KINDS: tuple[Kind, ...] = ("delay", "friction", "actuators")
# Chi-square by which a cause must explain the residual better than none, and better than its rival, to be told.
_SURE, _CLEARER = 25.0, 9.0
# Turn of the force (rad), or share of it, from which a cause matters.
MATTERS = 0.005


@dataclass(frozen=True, eq=False)
class Cause:
    """One cause fitted to the residual of a law.

    Attributes
    ----------
    kind
        "delay": s, one for all runs; "friction": N against the motion, one a run; "actuators": N against
        the motion of u and of v, two a run.
    values, sd
        Sizes and standard errors, shape (m,).
    effects
        By how much a unit of each moves the free coefficients if it is left in, shape (k, m).
    chi2
        Of what it leaves over.
    share
        Turn of the force that it makes, rad: the cross coupling over the stiffness.
    """

    kind: Kind
    values: np.ndarray
    sd: np.ndarray
    effects: np.ndarray
    chi2: float
    share: float


@dataclass(frozen=True, eq=False)
class Doubt:
    """Something that turns the force, of which the log does not tell whether it is the one or the other."""

    delay: Cause
    friction: Cause


def cause_in(fit: ModelFit) -> Cause | Doubt | None:
    """Return what stands in the forces of a fit; None where nothing that is sure and matters does."""
    table = _Residual(fit)
    causes = [table.cause(kind) for kind in KINDS]
    # Friction that pushes along is none.
    physical = [cause for cause in causes if cause.kind == "delay" or cause.values.sum() > 0]
    best = min(physical, key=lambda cause: cause.chi2)
    if table.alone - best.chi2 < _SURE + 2 * best.values.size or best.share < MATTERS:
        return None
    delay = causes[0]
    friction = min(causes[1:], key=lambda cause: cause.chi2)
    rival = friction.chi2 if best.kind == "delay" else delay.chi2
    return best if rival - best.chi2 > _CLEARER else Doubt(delay, friction)


def explained(fit: ModelFit) -> bool:
    """Tell whether no mixture of the causes finds anything more in the forces."""
    table = _Residual(fit)
    return table.alone - table.together < _SURE


def doubt_of(fit: ModelFit) -> Doubt:
    """Return delay and friction beside each other, where one alone does not explain all."""
    delay, *friction = (cause_of(fit, kind) for kind in KINDS)
    return Doubt(delay, min(friction, key=lambda cause: cause.chi2))


def cause_of(fit: ModelFit, kind: Kind) -> Cause:
    """Return one cause, whether or not it is there."""
    return _Residual(fit).cause(kind)


def friction_of(fit: ModelFit, place: int, kind: Kind, sizes: np.ndarray) -> np.ndarray:
    """Return what friction of that size adds to the load cells of a run, shape (2, n), N: along the motion."""
    forces = _forces(fit.orbits[place], _velocity(fit, place), kind)
    return np.asarray(np.tensordot(sizes, np.stack(forces), axes=1))


def widened(fit: ModelFit, kind: Kind, spread: dict[str, np.ndarray]) -> ModelFit:
    """Return a fit whose covariance holds errors of a cause as well.

    Parameters
    ----------
    spread
        Standard error of the cause by run, shape (1,) or (2,); a delay is the same in all.
    """
    effects = _Residual(fit).effects(kind)
    runs = [orbit.run for orbit in fit.orbits]
    sd = spread[runs[0]] if kind == "delay" else np.concatenate([spread[run] for run in runs])
    moved = effects * sd
    own = fit.covariance
    return replace(fit, covariance=Covariance(own.matrix + moved @ moved.T, own.dof, own.method))


def _velocity(fit: ModelFit, place: int) -> np.ndarray:
    """Return how fast the stator moves under the force, shape (2, n), m/s."""
    orbit = fit.orbits[place]
    compliance = law.compliance(fit.p, fit.paths[place].displacement)
    return np.asarray(np.einsum("ijn,jn->in", compliance, np.gradient(orbit.force, orbit.time, axis=1)))


def _forces(orbit: Orbit, velocity: np.ndarray, kind: Kind) -> list[np.ndarray]:
    """Return unit forces of friction along the motion, shape (2, n) each, x and y; zero where the stator stands."""
    width = max(round(1.0 / (25.0 * abs(orbit.rotation.frequency) * orbit.step)), 1)
    padded = np.pad(velocity, ((0, 0), (width // 2, width - 1 - width // 2)), mode="edge")
    smooth = np.stack([np.convolve(row, np.ones(width) / width, mode="valid") for row in padded])
    speed = np.hypot(*smooth)
    still = 0.1 * float(np.median(speed[orbit.rotation.steady]))
    if kind == "friction":
        return [smooth / np.hypot(speed, still)]
    along = FROM_UV.T @ smooth
    sign = along / np.hypot(along, still)
    return [np.outer(FROM_UV[:, axis], sign[axis]) for axis in (0, 1)]


class _Residual:
    """The residual of all runs of a fit over their noise, and what the law's own freedom leaves of it."""

    def __init__(self, fit: ModelFit) -> None:
        self.fit = fit
        self.sigma = [float(np.sqrt((noise.sigma**2).mean())) for noise in fit.noises]
        sizes = [2 * orbit.time.size for orbit in fit.orbits]
        self.rows = [slice(end - size, end) for size, end in zip(sizes, np.cumsum(sizes).tolist(), strict=True)]
        k, n = fit.size, sum(sizes)
        own = np.zeros((n, k + 6 * len(sizes)))
        left = np.empty(n)
        for place, (orbit, path, rows) in enumerate(zip(fit.orbits, fit.paths, self.rows, strict=True)):
            slopes, _ = fit.law.slopes(fit.theta, path.displacement, orbit.force)
            own[rows, :k] = self._weighed(place, slopes.transpose(0, 2, 1) * fit.law.scale).reshape(-1, k)
            level = np.stack([np.ones_like(orbit.tau), orbit.tau, orbit.tau**2], axis=1)
            both = np.kron(np.eye(2), level)
            own[rows, k + 6 * place : k + 6 * place + 6] = both / self.sigma[place]
            left[rows] = self._weighed(place, path.residual).reshape(-1)
        self.known = np.isfinite(own).all(axis=1) & np.isfinite(left)
        own[~self.known], left[~self.known] = 0.0, 0.0
        self.norm = np.sqrt((own**2).sum(axis=0))
        self.norm[self.norm == 0] = 1.0
        self.own = own / self.norm
        self.basis = np.linalg.svd(self.own, full_matrices=False)[0]
        self.left = self._projected(left)
        every = self._columns("delay") + self._columns("friction") + self._columns("actuators")
        _, rest = self._solved(np.stack(every, axis=1))
        free = max(int(self.known.sum()) - own.shape[1] - len(every), 1)
        self.variance = float(rest @ rest) / free * self._coloured(rest)
        self.together = float(rest @ rest) / self.variance + 2 * len(every)
        self.alone = float(self.left @ self.left) / self.variance

    def cause(self, kind: Kind) -> Cause:
        X = np.stack(self._columns(kind), axis=1)
        values, rest = self._solved(X)
        projected = self._projected(X)
        sd = np.sqrt(self.variance * np.diag(np.linalg.pinv(projected.T @ projected)))
        rotation = max((orbit.rotation for orbit in self.fit.orbits), key=lambda r: r.size)
        share = abs(float(values[0])) * 2 * math.pi * abs(rotation.frequency)
        if kind != "delay":
            sizes = np.repeat([o.rotation.size for o in self.fit.orbits], values.size // len(self.fit.orbits))
            share = float(np.abs(values / sizes).max())
        return Cause(kind, values, sd, self.effects(kind), float(rest @ rest) / self.variance, share)

    def effects(self, kind: Kind) -> np.ndarray:
        """Return how a unit of a cause moves the coefficients, shape (k, m)."""
        k = self.fit.size
        X = np.stack(self._columns(kind), axis=1)
        taken = np.linalg.lstsq(self.own, X, rcond=1e-9)[0] / self.norm[:, None]
        return np.asarray(taken[:k] * self.fit.law.scale[:, None])

    def _columns(self, kind: Kind) -> list[np.ndarray]:
        columns = []
        for place, (orbit, path, rows) in enumerate(zip(self.fit.orbits, self.fit.paths, self.rows, strict=True)):
            velocity = _velocity(self.fit, place)
            compliance = law.compliance(self.fit.p, path.displacement)
            moved = (
                [velocity]
                if kind == "delay"
                else [-np.einsum("ijn,jn->in", compliance, f) for f in _forces(orbit, velocity, kind)]
            )
            for motion in moved:
                column = np.zeros(self.known.size)
                column[rows] = self._weighed(place, motion).reshape(-1)
                columns.append(np.where(self.known, column, 0.0))
        return [np.sum(columns, axis=0)] if kind == "delay" else columns

    def _solved(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        projected = self._projected(X)
        values = np.linalg.lstsq(projected, self.left, rcond=1e-9)[0]
        return values, self.left - projected @ values

    def _projected(self, rows: np.ndarray) -> np.ndarray:
        return np.asarray(rows - self.basis @ (self.basis.T @ rows))

    def _weighed(self, place: int, rows: np.ndarray) -> np.ndarray:
        return np.asarray(rows / self.sigma[place])

    def _coloured(self, rest: np.ndarray) -> float:
        """Return by how much the noise at the frequencies that matter exceeds that of the whole band (variances)."""
        most = 1.0
        for orbit, rows in zip(self.fit.orbits, self.rows, strict=True):
            own = rest[rows].reshape(2, -1)
            low, _ = low_band(orbit.time, own, orbit.rotation.frequency, orbit.shaft_frequency)
            most = max(most, float((low**2).mean() / max((own**2).mean(), 1e-300)))
        return most
