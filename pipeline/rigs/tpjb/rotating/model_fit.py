"""What a fitted model says: the ten coefficients with honest errors, and those that the data cannot tell.

The noise that reaches the coefficients is that of low frequency, so the covariance is scaled with the
residual's spectrum between 0.4 and 20 orders of the rotation; coloured residuals get Newey and West's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.identifiability import Combination, Identifiability, assess
from pipeline.estimation.uncertainty import Covariance, newey_west
from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.displacement_fit import Law, Path, Solution, settle, solve
from pipeline.rigs.tpjb.rotating.force_domain import below_fold, force_domain
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.models import Model
from pipeline.rigs.tpjb.rotating.noise import Noise, low_band, orbit_noise
from pipeline.rigs.tpjb.rotating.orbit import Orbit

# Orders that the coefficients listen to most, and by how much the noise there may exceed that of the
# whole band (variances) before the residual counts as coloured.
_NEAR = (0.4, 4.0)
_COLOURED = 2.0
_STIFFEST, _SOFTEST = 1e11, 1e7
# Two loads whose sizes differ by this factor tell the mean shift without a dwell.
_APART = 1.2
MEAN_SHIFT = (("kxx2", "kxy2"), ("kyx2", "kyy2"))
_WEAK = "one circular orbit without a stretch at zero force cannot tell it: {a} + {b} acts through the mean shift only"


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law fitted to orbits at one static load.

    Attributes
    ----------
    law
        What was fitted.
    theta, covariance
        Free coefficients, shape (k,), SI, and their covariance.
    orbits, noises, paths
        One entry a run.
    low_sigma
        Noise of low frequency over the one assumed, per run and axis, shape (runs, 2).
    at_bound
        Free coefficients that ended on a bound.
    converged
        Whether the search came to rest.
    """

    law: Law
    theta: np.ndarray
    covariance: Covariance
    orbits: tuple[Orbit, ...]
    noises: tuple[Noise, ...]
    paths: tuple[Path, ...]
    low_sigma: np.ndarray
    at_bound: tuple[str, ...]
    converged: bool

    @property
    def name(self) -> str:
        """Name of the law."""
        return self.law.name

    @property
    def size(self) -> int:
        """Number of free coefficients."""
        return len(self.law.free)

    @property
    def n_data(self) -> int:
        """Number of displacement samples, both axes."""
        return sum(path.residual.size for path in self.paths)

    @property
    def rms(self) -> float:
        """Root mean square of the residual over runs and axes, m."""
        return math.sqrt(sum(float((path.residual**2).sum()) for path in self.paths) / self.n_data)

    @property
    def nrmse(self) -> float:
        """Rms residual over rms of the displacement about each run's mean."""
        moved = sum(
            float(((d := o.displacement) - d.mean(axis=1, keepdims=True)).ravel() @ d.ravel()) for o in self.orbits
        )
        return self.rms / math.sqrt(moved / self.n_data)

    @property
    def chi2(self) -> float:
        """Sum of squared residuals over the noise of their run and axis."""
        return sum(
            float(((path.residual / noise.sigma[:, None]) ** 2).sum())
            for path, noise in zip(self.paths, self.noises, strict=True)
        )

    @property
    def chi2_reduced(self) -> float:
        """`chi2` per degree of freedom; the noise is that which no smooth function of the force explains."""
        return self.chi2 / max(self.n_data - self.size - 6 * len(self.paths), 1)


@dataclass(frozen=True, eq=False)
class ModelFit(LawFit):
    """One of the models M1 to M6, M3p fitted to orbits at one static load."""

    model: Model

    @property
    def p(self) -> np.ndarray:
        """The ten coefficients, shape (10,)."""
        return self.model.coefficients(self.theta)

    @property
    def p_covariance(self) -> np.ndarray:
        """Covariance of the ten, shape (10, 10); rows of those that are not free are zero."""
        return self.model.covariance(self.covariance.matrix)

    @property
    def K(self) -> np.ndarray:
        """Stiffness at the equilibrium, shape (2, 2), N/m."""
        return self.p[:4].reshape(2, 2)

    @property
    def fold_margin(self) -> float:
        """Least det J/det K over all runs."""
        return min(law.fold_margin(self.p, path.displacement) for path in self.paths)

    @property
    def mean_shift_seen(self) -> bool:
        """Whether the runs tell the mean shift: a dwell at zero force, or loads of different sizes."""
        sizes = [orbit.rotation.size for orbit in self.orbits]
        return any(orbit.rotation.has_dwell for orbit in self.orbits) or max(sizes) > _APART * min(sizes)

    def mean_shift(self, size: float) -> np.ndarray:
        """Return the mean position under a turning force of `size` (N) from the equilibrium, shape (2,), m."""
        angle = 2 * np.pi * np.arange(128) / 128
        return np.asarray(law.equilibrium(self.p, size * np.stack([np.cos(angle), np.sin(angle)])).mean(axis=1))

    @cached_property
    def identifiability(self) -> Identifiability:
        """Which free coefficients the data tell one by one, and which combinations else."""
        values = dict(zip(self.model.free, self.theta.tolist(), strict=True))
        linear = max(abs(v) for v, s in zip(self.theta, self.model.scale, strict=True) if s == law.SCALE[0])
        quadratic = [abs(v) for v, s in zip(self.theta, self.model.scale, strict=True) if s != law.SCALE[0]]
        sizes = {
            name: max(quadratic) if unit == "N/m^2" else max(abs(values[name]), 0.1 * linear)
            for name, unit in zip(self.model.free, self.model.units, strict=True)
        }
        scale = self.model.scale
        matrix = np.nan_to_num(self.covariance.matrix / np.outer(scale, scale), nan=0.0, posinf=0.0)
        held = np.array([name in self.at_bound for name in self.model.free])
        matrix[held, held] = np.diag(matrix)[held] + 1e6  # a bound is no measurement
        information = np.linalg.cholesky(np.linalg.inv(matrix)).T / scale
        units = dict(zip(self.model.free, self.model.units, strict=True))
        return assess(values, information, sizes=sizes, units=units)

    @property
    def combinations(self) -> tuple[Combination, ...]:
        """What can be told of coefficients that cannot be told one by one."""
        found = list(self.identifiability.combinations)
        for a, b in self._weak_pairs:
            i, j = self.model.free.index(a), self.model.free.index(b)
            C = self.covariance.matrix
            error = math.sqrt(max(C[i, i] + C[j, j] - 2 * C[i, j], 0.0))
            text = f"{a} - {b}"
            if not any(c.text == text for c in found):
                found.append(Combination(text, (a, b), float(self.theta[i] - self.theta[j]), error))
        return tuple(found)

    @property
    def _weak_pairs(self) -> list[tuple[str, str]]:
        if self.mean_shift_seen:
            return []
        return [(a, b) for a, b in MEAN_SHIFT if a in self.model.free and b in self.model.free]

    @property
    def estimates(self) -> dict[str, Estimate]:
        """The ten coefficients by name: value, standard error and interval, or the reason why there is none."""
        C = np.sqrt(np.maximum(np.diag(np.nan_to_num(self.p_covariance)), 0.0))
        return {
            name: undetermined(name, reason)
            if (reason := self._reason(name, j))
            else estimate(name, self.p[j], C[j], dof=self.covariance.dof)
            for j, name in enumerate(COEFFICIENTS)
        }

    def _reason(self, name: str, row: int) -> str:
        """Return why a coefficient has no value; empty where it has one."""
        parts = [free for free, part in zip(self.model.free, self.model.matrix[row], strict=True) if part]
        if not parts:
            return f"the data do not ask for it: {self.name} ({self.model.text}) does without"
        for part in parts:
            if part in self.at_bound:
                return f"the fit of {self.name} ends at the bound of {part}"
        for a, b in self._weak_pairs:
            if name in (a, b):
                return _WEAK.format(a=a, b=b)
        for part in parts:
            if part in self.identifiability.undetermined:
                told = [c.text for c in self.identifiability.combinations if part in c.members]
                return f"the orbits do not tell {part}" + (f", only {told[0]}" if told else "")
        return ""


def fit_model(
    orbits: Sequence[Orbit],
    model: Model,
    noises: Sequence[Noise] | None = None,
    start: np.ndarray | None = None,
) -> ModelFit:
    """Fit a model to all orbits at one static load, coefficients in common.

    Parameters
    ----------
    orbits
        Runs at different load ratios, or one.
    noises
        From `orbit_noise`, one a run; found here if not given.
    start
        Free coefficients to start from, shape (k,); by default those of the force domain.

    Raises
    ------
    InputError
        If a run has too few samples or no turning load.
    """
    noises = [orbit_noise(orbit) for orbit in orbits] if noises is None else noises
    if start is None:
        start = force_domain(max(orbits, key=lambda orbit: orbit.rotation.size), model)
    linear = model.scale == law.SCALE[0]
    stiffest = float(np.abs(start[linear]).max())
    # One axis alone folds at eta = 4 k2 F/k^2 = 1; mixed terms may be sqrt 2 times as large.
    fold = 2 * stiffest**2 / (4 * max(orbit.rotation.size for orbit in orbits))
    high = np.where(linear, min(_STIFFEST, 10 * stiffest), fold)
    low = -high
    direct = np.array([name[1] == name[2] and len(name) == 3 for name in model.free])
    low[direct & (start > 0)] = min(_SOFTEST, 0.01 * stiffest)
    high[direct & (start < 0)] = -min(_SOFTEST, 0.01 * stiffest)
    start = below_fold(orbits, model, np.clip(start, low, high))
    solution = solve(orbits, noises, model, start, (low, high))
    covariance, low_sigma = _covariance(solution, model, orbits)
    return ModelFit(
        law=model,
        theta=solution.theta,
        covariance=covariance,
        orbits=tuple(orbits),
        noises=tuple(noises),
        paths=solution.paths,
        low_sigma=low_sigma,
        at_bound=solution.fit.at_bound,
        converged=solution.fit.converged,
        model=model,
    )


def fit_law(
    orbits: Sequence[Orbit],
    noises: Sequence[Noise],
    fitted: Law,
    start: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
) -> LawFit:
    """Fit any law (the load-dependent forms) to orbits at one static load; see `fit_model`."""
    if not fitted.free:
        none = np.zeros((0, 0))
        paths, level = settle(orbits, noises, fitted), np.full((len(orbits), 2), np.nan)
        return LawFit(fitted, start, Covariance(none), tuple(orbits), tuple(noises), paths, level, (), True)
    solution = solve(orbits, noises, fitted, start, bounds)
    covariance, low_sigma = _covariance(solution, fitted, orbits)
    return LawFit(
        fitted,
        solution.theta,
        covariance,
        tuple(orbits),
        tuple(noises),
        solution.paths,
        low_sigma,
        solution.fit.at_bound,
        solution.fit.converged,
    )


def _covariance(solution: Solution, fitted: Law, orbits: Sequence[Orbit]) -> tuple[Covariance, np.ndarray]:
    """Return the covariance of theta for the noise that the residual shows, and that noise per run and axis."""
    J, r = solution.fit.jacobian / fitted.scale, solution.fit.residual
    sigma = np.empty((len(orbits), 2))
    weights = np.empty(r.size)
    dof, coloured = 0.0, False
    for i, (orbit, rows) in enumerate(zip(orbits, solution.rows, strict=True)):
        own = r[rows].reshape(-1, 2).T
        told = (orbit.time, own, orbit.rotation.frequency, orbit.shaft_frequency)
        sigma[i], own_dof = low_band(*told)
        near, near_dof = low_band(*told, band=_NEAR)
        share = near_dof / max(near_dof - 0.5 * len(fitted.free) / len(orbits), 1.0)  # what the fit took from there
        coloured |= bool((near**2).sum() * share > _COLOURED * (sigma[i] ** 2).sum())
        dof += 2 * own_dof
        weights[rows] = np.tile(sigma[i] ** 2, own.shape[1])
    free = np.array([name not in solution.fit.at_bound for name in fitted.free])
    matrix = np.zeros((free.size, free.size))
    k = int(free.sum())
    if coloured:
        order = np.concatenate(
            [np.r_[rows.start : rows.stop : 2, rows.start + 1 : rows.stop : 2] for rows in solution.rows]
        )
        found = newey_west(J[order][:, free], r[order])
        matrix[np.ix_(free, free)] = found.matrix
        return Covariance(matrix, found.dof, f"residual coloured: {found.method}"), sigma
    scaled = J[:, free] * fitted.scale[free]
    bread = np.linalg.pinv(scaled.T @ scaled)
    meat = (scaled * weights[:, None]).T @ scaled * (dof / max(dof - k, 1.0))
    matrix[np.ix_(free, free)] = bread @ meat @ bread * np.outer(fitted.scale[free], fitted.scale[free])
    return Covariance(matrix, max(dof - k, 1.0), "residual spectrum, 0.4 to 20 orders of the rotation"), sigma
