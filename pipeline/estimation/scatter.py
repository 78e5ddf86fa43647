"""Run-to-run gain scatter: each run's data share one relative error that repeated samples do not show.

The covariance of run g is diag(sd^2) + s^2 v_g v_g^T with v the *model's prediction*. With the data in
its place every gain would come out low (Peelle's puzzle). All arrays here are weighted (divided by sd).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

_BLOCK = 256  # runs; the square matrix of all runs never stands as a whole


@dataclass(frozen=True)
class Scatter:
    """Estimated gain scatter.

    Attributes
    ----------
    value
        s, relative, 1 sigma; 0 where the data do not ask for any.
    variance_of_square
        Variance of s^2 by the information of the (restricted) likelihood.
    upper
        Upper 95 % limit of s from the likelihood, up to the cap.
    ratio
        Twice the gain in log-likelihood over s = 0.
    at_cap
        Whether the cap held s down.
    deviance
        -2 ln(likelihood) at `value`, constants of the weights left out.
    """

    value: float
    variance_of_square: float
    upper: float
    ratio: float
    at_cap: bool
    deviance: float

    @property
    def dof(self) -> float:
        """Degrees of freedom of s^2 (Satterthwaite)."""
        return 2 * self.value**4 / self.variance_of_square if self.value > 0 else math.inf


@dataclass(frozen=True, eq=False)
class GainVectors:
    """The prediction split by run: column g is zero outside of run g, so that only its rows are kept.

    Attributes
    ----------
    prediction
        Weighted prediction, shape (m,); the columns side by side would be (m, runs).
    groups
        Run 0..runs-1 of each row, shape (m,).
    runs
        Number of columns.
    """

    prediction: np.ndarray
    groups: np.ndarray
    runs: int

    @cached_property
    def squares(self) -> np.ndarray:
        """Squared length of each column, shape (runs,)."""
        return np.bincount(self.groups, self.prediction**2, self.runs)

    def across(self, rows: np.ndarray) -> np.ndarray:
        """Return V^T rows, shape (runs, ...), for rows of shape (m, ...)."""
        flat = rows.reshape(rows.shape[0], -1)
        sums = [np.bincount(self.groups, self.prediction * column, self.runs) for column in flat.T]
        return np.array(sums).T.reshape(self.runs, *rows.shape[1:])

    def along(self, coefficients: np.ndarray) -> np.ndarray:
        """Return V coefficients, shape (m, ...), for coefficients of shape (runs, ...)."""
        return np.asarray(self.prediction.reshape(-1, *[1] * (coefficients.ndim - 1)) * coefficients[self.groups])

    def columns(self, runs: Sequence[int]) -> np.ndarray:
        """Return the columns of a few runs, shape (m, k)."""
        return np.where(self.groups[:, None] == np.asarray(runs, dtype=int), self.prediction[:, None], 0.0)

    def without(self, runs: Sequence[int]) -> GainVectors:
        """Return the vectors with the columns of some runs zero."""
        return replace(self, prediction=np.where(np.isin(self.groups, runs), 0.0, self.prediction))

    def shrunk(self, scatter: float) -> GainVectors:
        """Return the vectors after `whitening` with themselves."""
        return replace(self, prediction=self.prediction / np.sqrt(1 + scatter**2 * self.squares)[self.groups])


def gain_vectors(prediction: np.ndarray, groups: np.ndarray) -> GainVectors:
    """Return the prediction (m,) split by run, `groups` (m,)."""
    return GainVectors(prediction, groups, int(groups.max()) + 1)


def whitening(V: GainVectors, scatter: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the map that makes rows of covariance I + s^2 V V^T independent with unit variance.

    Inverse square root by Sherman-Morrison: along v_g the rows shrink by 1/sqrt(1 + s^2 |v_g|^2). The map takes
    arrays of shape (m, ...).
    """
    squares = V.squares
    shrink = (1 - 1 / np.sqrt(1 + scatter**2 * squares)) / np.where(squares > 0, squares, 1.0)

    def whiten(rows: np.ndarray) -> np.ndarray:
        along = V.across(rows)
        return np.asarray(rows - V.along(shrink.reshape(-1, *[1] * (along.ndim - 1)) * along))

    return whiten


def estimate_scatter(
    residual: np.ndarray,
    V: GainVectors,
    jacobian: np.ndarray,
    *,
    cap: float = 0.02,
    restricted: bool = True,
) -> Scatter:
    """Estimate s by maximum marginal likelihood, from a weighted fit at or near its optimum.

    Parameters
    ----------
    residual, jacobian
        Weighted residual y - f (m,) and df/dtheta (m, p) of the fit; theta is refitted, to first order,
        for every s tried.
    V
        Gain vectors, weighted.
    cap
        Largest s considered; more than that is no gain error but a wrong model.
    restricted
        REML: account for the parameters that were fitted to the same runs (else s is too small by
        about the square root of gains left over runs). Plain likelihood compares models.

    Notes
    -----
    Minimises r^T S^-1 r + ln det S [+ ln det J^T S^-1 J] with S = I + s^2 V V^T.
    """
    from scipy.optimize import minimize_scalar

    norms = np.linalg.norm(jacobian, axis=0)
    J = jacobian / np.where(norms > 0, norms, 1.0)
    JJ, JV, Jr = J.T @ J, V.across(J).T, J.T @ residual
    JJ = JJ + 1e-14 * np.eye(JJ.shape[0])  # directions that nothing determines
    Vr, vv, rr = V.across(residual), V.squares, float(residual @ residual)

    def deviance(square: float) -> float:
        D = square / (1 + square * vv)
        M = JJ - (JV * D) @ JV.T
        g = Jr - JV @ (D * Vr)
        chi2 = rr - float(Vr @ (D * Vr)) - float(g @ np.linalg.solve(M, g))
        logdet = float(np.log1p(square * vv).sum())
        return chi2 + logdet + (float(np.linalg.slogdet(M)[1]) if restricted else 0.0)

    def at(logarithm: float) -> float:
        return deviance(math.exp(2 * logarithm))

    none = deviance(0.0)
    lowest, highest = math.log(cap * 1e-4), math.log(cap)
    trial = np.linspace(lowest, highest, 25)
    values = [at(v) for v in trial]
    i = int(np.argmin(values))
    found = minimize_scalar(at, bounds=(trial[max(i - 1, 0)], trial[min(i + 1, 24)]), method="bounded")
    s, best = math.exp(found.x), float(found.fun)
    if best >= none - 1e-9:
        s, best = 0.0, none
    above = [v for v in np.linspace(math.log(max(s, cap * 1e-4)), highest, 60) if at(v) > best + 3.84]
    square = s * s
    D = square / (1 + square * vv)
    M = JJ - (JV * D) @ JV.T
    JSV = JV / (1 + square * vv)  # J^T S^-1 V
    own = vv / (1 + square * vv)
    fitted = np.linalg.solve(M, JSV) if restricted else np.zeros_like(JSV)
    spread = 0.0  # of V^T P V, squared and summed
    for start in range(0, V.runs, _BLOCK):
        block = slice(start, start + _BLOCK)
        K = -JSV[:, block].T @ fitted
        K[np.arange(K.shape[0]), np.arange(K.shape[0]) + start] += own[block]
        spread += float((K**2).sum())
    return Scatter(
        value=s,
        variance_of_square=2 / max(spread, 1e-300),
        upper=math.exp(above[0]) if above else cap,
        ratio=none - best,
        at_cap=s > 0.99 * cap,
        deviance=best,
    )
