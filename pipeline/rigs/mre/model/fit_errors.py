"""Standard errors and degrees of freedom of a fitted dynamic model, with and without run scatter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.scatter import GainVectors, Scatter
from pipeline.estimation.separable import covariance_of
from pipeline.estimation.uncertainty import clustered

# A bound that is physics (a parameter may truly lie there), not the edge of the search.
PHYSICAL_BOUNDS = {"n_bw": 1.0, "c_bw": 0.5}
_INCREMENT = "_increment"


def increment_of(name: str) -> str:
    """Return the name of what a current adds to a shared coefficient."""
    return name + _INCREMENT


def shared_name(name: str) -> str:
    """Return the name of the coefficient that an increment adds to; any other name as it is."""
    return name.removesuffix(_INCREMENT)


@dataclass(frozen=True)
class Key:
    """A free parameter: its name in the findings and, for field terms, the current (A)."""

    name: str
    current: float | None = None

    @property
    def text(self) -> str:
        """Name for matrices and messages."""
        return self.name if self.current is None else f"{self.name} at {self.current:g} A"

    @property
    def at(self) -> dict[str, float | str | bool]:
        """Operating point."""
        return {} if self.current is None else {"coil_current": self.current}


@dataclass(frozen=True, eq=False)
class Errors:
    """Covariance of the parameters (p, p) and how well it is known.

    `pull` (p, runs) is d(parameter)/d(gain of a run) times the gain's part in the fit: with a run
    scatter s the covariance moves by pull pull^T per s^2, so an error's degrees of freedom follow from
    the variance of s^2 (Satterthwaite 1946); they are `dof` at most.
    """

    covariance: np.ndarray
    pull: np.ndarray
    variance_of_square: float
    dof: float = math.inf

    def of(self, gradient: np.ndarray) -> tuple[float, float]:
        """Return standard error and degrees of freedom of a function with that gradient, shape (p,)."""
        variance = max(float(gradient @ self.covariance @ gradient), 0.0)
        moved = float(((gradient @ self.pull) ** 2).sum())
        if moved == 0 or self.variance_of_square == 0:
            return math.sqrt(variance), self.dof
        return math.sqrt(variance), min(max(2 * variance**2 / (moved**2 * self.variance_of_square), 1.0), self.dof)

    def through(self, function: Callable[[np.ndarray], float], values: np.ndarray) -> tuple[float, float, float]:
        """Return value, standard error and degrees of freedom of a function of the parameters."""
        sd = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        gradient = np.zeros(values.size)
        for i in np.flatnonzero(sd):
            step = np.zeros(values.size)
            step[i] = min(0.1 * sd[i], 1e-3 * abs(values[i]) or math.inf)
            gradient[i] = (function(values + step) - function(values - step)) / (2 * step[i])
        return function(values), *self.of(gradient)


def errors_with_scatter(
    jacobian: np.ndarray,
    V: GainVectors,
    scatter: Scatter,
    factor: float,
    held: np.ndarray,
    level_variance: np.ndarray | None = None,
) -> Errors:
    """Return the errors of a (generalised) least-squares fit whose weights are estimates.

    `jacobian` (rows, p) and the gain vectors `V` are whitened, `factor` multiplies the covariance (Birge), `held` (p,)
    marks parameters at a bound: the others take them as known. `level_variance` (rows,) is the relative variance of the
    noise's level behind each row, the same for real and imaginary part (rows i and i + rows/2).

    Notes
    -----
    Weights that chance made too large take a fit to their rows and call it sure. To first order the covariance C grows by
    2 C [sum_i W_i (Q_i - P_i C P_i)] C over the variance components (Kenward and Roger, Biometrics 53, 1997, 983): W_i
    the component's variance, P_i = J^T D_i J and Q_i = J^T D_i D_i J with D_i the change of the rows' covariance with it.
    """
    covariance = covariance_of(jacobian)[0] * factor
    if held.any():
        own = np.where(held, np.diag(covariance), 0.0)
        covariance = np.diag(own)
        covariance[np.ix_(~held, ~held)] = covariance_of(jacobian[:, ~held])[0] * factor
    free = np.where(held, 0.0, jacobian)
    variance = covariance
    if level_variance is not None:
        half = free.shape[0] // 2
        pairs = np.stack([free[:half], free[half:]], axis=1)  # of each harmonic
        moved = pairs @ covariance
        left = np.eye(2) - moved @ pairs.transpose(0, 2, 1) / factor
        grown = np.sqrt(2 * level_variance[:half, None, None] / factor) * (_root(left) @ moved)
        grown = grown.reshape(-1, free.shape[1])
        variance = variance + grown.T @ grown
    if scatter.value == 0:
        return Errors(variance, np.zeros((jacobian.shape[1], 0)), 0.0)
    across = V.across(free)
    pull = covariance @ across.T
    # As a (p, p) matrix in standard errors: of many runs the square one of all never stands.
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    reach, through = pull / sd[:, None], pull @ across / sd[:, None]
    grown = _root((reach * V.squares) @ reach.T - through @ covariance @ through.T / factor) * sd
    return Errors(variance + 2 * scatter.variance_of_square * grown.T @ grown, pull, scatter.variance_of_square)


def _root(matrices: np.ndarray) -> np.ndarray:
    """Return R with R^T R the symmetric matrices (..., k, k), of which rounding may make eigenvalues negative."""
    values, vectors = np.linalg.eigh(matrices)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[..., None] * np.swapaxes(vectors, -1, -2))


def errors_of_wrong_model(jacobian: np.ndarray, residual: np.ndarray, runs: np.ndarray, dof: int) -> Errors:
    """Return the errors of plain least squares whose residual is not noise.

    The larger of the covariance scaled by chi2/dof and the sandwich over runs; the degrees of freedom
    are those of the runs, since their residuals are anything but independent.
    """
    covariance = covariance_of(jacobian)[0] * max(float(residual @ residual) / max(dof, 1), 1.0)
    number = np.unique(runs).size
    try:
        spread = np.sqrt(np.diag(clustered(jacobian, residual, runs).matrix) / np.diag(covariance))
    except (ValueError, np.linalg.LinAlgError):
        spread = np.ones(covariance.shape[0])
    wider = np.maximum(np.nan_to_num(spread, nan=1.0), 1.0)
    return Errors(covariance * np.outer(wider, wider), np.zeros((wider.size, 0)), 0.0, max(number - 1.0, 1.0))
