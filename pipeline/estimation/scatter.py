"""Run-to-run gain scatter: each run's data share one relative error that repeated samples do not show.

The covariance of run g is diag(sd^2) + s^2 v_g v_g^T with v the *model's prediction*. With the data in
its place every gain would come out low (Peelle's puzzle). All arrays here are weighted (divided by sd).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


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


def gain_vectors(prediction: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return the prediction split by run, shape (m, runs): column g is zero outside of run g."""
    member = groups[:, None] == np.arange(int(groups.max()) + 1)
    return np.where(member, prediction[:, None], 0.0)


def whitening(V: np.ndarray, scatter: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the map that makes rows of covariance I + s^2 V V^T independent with unit variance.

    Inverse square root by Sherman-Morrison: along v_g the rows shrink by 1/sqrt(1 + s^2 |v_g|^2). The
    columns of V (m, runs) have disjoint support. The map takes arrays of shape (m, ...).
    """
    length = np.linalg.norm(V, axis=0)
    unit = V / np.where(length > 0, length, 1.0)
    shrink = 1 - 1 / np.sqrt(1 + (scatter * length) ** 2)

    def whiten(rows: np.ndarray) -> np.ndarray:
        flat = rows.reshape(rows.shape[0], -1)
        return np.asarray((flat - (unit * shrink) @ (unit.T @ flat)).reshape(rows.shape))

    return whiten


def estimate_scatter(
    residual: np.ndarray,
    V: np.ndarray,
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
        Gain vectors (m, runs) of `gain_vectors`, weighted.
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
    JJ, JV, Jr = J.T @ J, J.T @ V, J.T @ residual
    JJ = JJ + 1e-14 * np.eye(JJ.shape[0])  # directions that nothing determines
    Vr, vv, rr = V.T @ residual, (V**2).sum(axis=0), float(residual @ residual)

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
    K = np.diag(vv / (1 + square * vv))
    if restricted:
        K = K - JSV.T @ np.linalg.solve(M, JSV)
    return Scatter(
        value=s,
        variance_of_square=2 / max(float((K**2).sum()), 1e-300),
        upper=math.exp(above[0]) if above else cap,
        ratio=none - best,
        at_cap=s > 0.99 * cap,
        deviance=best,
    )
