"""One law fitted to one or several orbits at the same static load, in the displacement domain.

Residual: measured displacement minus the law's under the measured force, minus an offset and a drift of
second degree per run and axis (the offset is the equilibrium), which are projected out. Noise of the force
counts as well: orthogonal distance regression, by elimination of the true forces. What the result means is
told by `model_fit`; competing models are weighed in `selection`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.least_squares import Fit, Unknown, fit
from pipeline.rigs.tpjb.rotating.noise import Noise
from pipeline.rigs.tpjb.rotating.orbit import Orbit

_OUTER = 6
# A wrong model creeps along its valley; its last digits are not worth more.
_MOST_EVALUATIONS = 60
# Above this chi-square per degree of freedom its misfit is no noise of the force: plain weights, as measured.
_HOPELESS = 10.0


class Law(Protocol):
    """What can be fitted: free coefficients theta, shape (k,), that make a displacement of a force."""

    @property
    def name(self) -> str:
        """Short name."""

    @property
    def text(self) -> str:
        """What it holds, in a few words."""

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free coefficients."""

    @property
    def scale(self) -> np.ndarray:
        """Their typical sizes, shape (k,)."""

    def displacement(self, theta: np.ndarray, f: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
        """Return the displacement (m), shape (2, n); NaN where there is none."""

    def slopes(self, theta: np.ndarray, d: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return dd/dtheta, shape (2, k, n), and dd/df, shape (2, 2, n)."""


@dataclass(frozen=True, eq=False)
class Path:
    """One run as the law sees it.

    Attributes
    ----------
    run, time
        Name and stamps (s), shape (n,).
    displacement
        Of the law from the static equilibrium under the measured force, shape (2, n), m.
    offset, drift
        Equilibrium in the frame of the probes, shape (2,), and coefficients of tau and tau^2 - 1/3,
        shape (2, 2), m; tau runs from -1 to 1 over the run.
    residual
        Measured minus all that, shape (2, n), m.
    """

    run: str
    time: np.ndarray
    displacement: np.ndarray
    offset: np.ndarray
    drift: np.ndarray
    residual: np.ndarray


class _Run:
    """One run linearised about its true forces: weights, projector and what the force noise explains."""

    def __init__(self, orbit: Orbit, noise: Noise, law: Law) -> None:
        self.orbit, self.noise, self.law = orbit, noise, law
        self.force = orbit.force
        self.shift = np.zeros_like(orbit.force)
        self.near: np.ndarray | None = None
        self.last: tuple[np.ndarray, np.ndarray] | None = None
        self.nuisance = np.stack([np.ones(orbit.tau.size), orbit.tau, orbit.tau**2 - 1 / 3], axis=1)

    def relinearise(self, theta: np.ndarray, plain: bool = False) -> None:
        """Move the true forces to where `theta` wants them, and renew the weights; `plain`: as measured."""
        noise = 0.0 if plain else self.noise.force
        d = self.displacement(theta)
        _, compliance = self.law.slopes(theta, d, self.force)
        if not np.isfinite(compliance).all():
            raise InputError(self._past_fold())
        # What of sigma is due to the force is taken out of it first: both together make sigma.
        by_force = noise**2 * np.einsum("ijn,kjn->ikn", compliance, compliance)
        mean = np.einsum("iin->i", by_force) / by_force.shape[2]
        own = np.maximum(self.noise.sigma**2 - mean, 0.1 * self.noise.sigma**2)
        covariance = by_force.transpose(2, 0, 1) + np.diag(own)
        self.whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        full = np.zeros((2, self.nuisance.shape[0], 6))
        full[0, :, :3] = full[1, :, 3:] = self.nuisance
        columns = np.einsum("nij,jnk->nik", self.whiten, full).reshape(-1, 6)
        self.basis, self.triangle = np.linalg.qr(columns)
        self.shift = np.einsum("ijn,jn->in", compliance, self.orbit.force - self.force)
        left = self.project(self.weigh(self.orbit.displacement - d - self.shift)).reshape(-1, 2)
        back = np.einsum("nji,nj->in", self.whiten, left)
        moved = self.orbit.force + noise**2 * np.einsum("jin,jn->in", compliance, back)
        near = self.law.displacement(theta, moved, d)
        if np.isfinite(near).all():  # else the true force would lie past the fold: it stays where it was
            self.force, self.near, self.last = moved, near, None
            _, compliance = self.law.slopes(theta, near, moved)
        self.shift = np.einsum("ijn,jn->in", compliance, self.orbit.force - self.force)

    def displacement(self, theta: np.ndarray) -> np.ndarray:
        """Return the law's displacement under the true forces; the last one is kept for the Jacobian."""
        if self.last is None or not np.array_equal(self.last[0], theta):
            self.last = (theta.copy(), self.law.displacement(theta, self.force, self.near))
        return self.last[1]

    def weigh(self, rows: np.ndarray) -> np.ndarray:
        """Whiten (2, n) or (2, k, n) to (2 n,) or (2 n, k)."""
        if rows.ndim == 2:
            return np.asarray(np.einsum("nij,jn->ni", self.whiten, rows)).reshape(-1)
        return np.asarray(np.einsum("nij,jkn->nik", self.whiten, rows)).reshape(-1, rows.shape[1])

    def project(self, rows: np.ndarray) -> np.ndarray:
        return np.asarray(rows - self.basis @ (self.basis.T @ rows))

    def residual(self, theta: np.ndarray) -> np.ndarray:
        return self.project(self.weigh(self.displacement(theta) + self.shift - self.orbit.displacement))

    def jacobian(self, theta: np.ndarray) -> np.ndarray:
        d = self.displacement(theta)
        slopes, _ = self.law.slopes(theta, d, self.force)
        if not np.isfinite(slopes).all():
            raise InputError(self._past_fold())
        return self.project(self.weigh(slopes))

    def _past_fold(self) -> str:
        return (
            f"{self.law.name} is invalid at this load: the {self.orbit.rotation.size:.4g} N of run {self.orbit.run} lie past its "
            "fold, where it has no equilibrium"
        )

    def path(self, theta: np.ndarray) -> Path:
        """Return the run with its offset and drift, the law under the force as measured.

        From the true forces by the slope there: the measured one may lie past the fold by its noise.
        """
        d = self.displacement(theta) + self.shift
        left = self.orbit.displacement - d
        level = np.linalg.solve(self.triangle, self.basis.T @ self.weigh(left)).reshape(2, 3)
        residual = left - level @ self.nuisance.T
        return Path(self.orbit.run, self.orbit.time, d, level[:, 0], level[:, 1:], residual)


@dataclass(frozen=True, eq=False)
class Solution:
    """The optimum in the units of theta: values, least-squares fit (scaled unknowns), paths, weighted rows.

    `rows` tells which weighted residuals belong to which run, one slice a run; they alternate x, y.
    """

    theta: np.ndarray
    fit: Fit
    paths: tuple[Path, ...]
    rows: tuple[slice, ...]


def settle(orbits: Sequence[Orbit], noises: Sequence[Noise], law: Law) -> tuple[Path, ...]:
    """Return the runs as a law without free coefficients sees them: only offset and drift are fitted."""
    paths = []
    for orbit, noise in zip(orbits, noises, strict=True):
        run = _Run(orbit, noise, law)
        run.relinearise(np.zeros(0))
        paths.append(run.path(np.zeros(0)))
    return tuple(paths)


def solve(
    orbits: Sequence[Orbit],
    noises: Sequence[Noise],
    law: Law,
    start: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
) -> Solution:
    """Fit a law to orbits with common coefficients, each run with its own offset, drift and noise.

    Parameters
    ----------
    start, bounds
        Of theta, shape (k,) each; every run must have an equilibrium at the start.

    Raises
    ------
    InputError
        If that is not so, or the search ends at the fold of the law.

    Notes
    -----
    Inner fit at given weights and true forces by `estimation.least_squares` with the analytic
    Jacobian; trial coefficients past the fold of any sample are refused. Outer loop: true forces and
    effective variances (Orear 1982) until theta moves by less than a fiftieth of its error.
    """
    runs = [_Run(orbit, noise, law) for orbit, noise in zip(orbits, noises, strict=True)]
    scale = law.scale

    def unpacked(values: Mapping[str, float]) -> np.ndarray:
        return np.asarray(np.array([values[name] for name in law.free]) * scale)

    low, high = (bound / scale for bound in bounds)
    theta = np.clip(start / scale, low, high)
    hopeless = False
    for _ in range(_OUTER):
        for run in runs:
            run.relinearise(theta * scale, plain=hopeless)
        found = fit(
            lambda values: np.concatenate([run.residual(unpacked(values)) for run in runs]),
            [Unknown(*row) for row in zip(law.free, theta.tolist(), low.tolist(), high.tolist(), strict=True)],
            jacobian=lambda values: np.concatenate([run.jacobian(unpacked(values)) for run in runs]) * scale,
            noise="known",
            max_evaluations=_MOST_EVALUATIONS,
        )
        before, theta = theta, np.array([found.values[name] for name in law.free])
        spread = np.nan_to_num(found.covariance.std_error, nan=np.inf)
        if hopeless or np.all(np.abs(theta - before) < 0.02 * spread):
            break
        hopeless = found.chi2 > _HOPELESS * found.dof
    ends = np.cumsum([0, *(2 * run.orbit.time.size for run in runs)])
    rows = tuple(slice(a, b) for a, b in pairwise(ends.tolist()))
    return Solution(theta * scale, found, tuple(run.path(theta * scale) for run in runs), rows)
