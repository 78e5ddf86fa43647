"""Nonlinear least squares with named parameters, bounds and units (lmfit underneath).

Levenberg-Marquardt, or a trust region where there are bounds, then Gauss-Newton with central
differences until the digits stand. For models that are linear in most of their parameters use
`separable`. Noise on the input biases every method here: smooth it or weight the residuals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.search import Search, Unknown, Values
from pipeline.estimation.uncertainty import Covariance

__all__ = ["Fit", "Noise", "Unknown", "fit"]

Noise = Literal["estimated", "known", "larger"]


@dataclass(frozen=True, eq=False)
class Fit:
    """The optimum and what the data say about it.

    Attributes
    ----------
    values
        All parameters by name, the fixed ones too, SI.
    names
        The free ones, k of them: order of `covariance` and of the columns of `jacobian`.
    covariance
        Shape (k, k); rows of parameters at a bound are NaN, of undetermined ones infinite.
    residual, jacobian
        At the optimum, shapes (n,) and (n, k).
    at_bound
        Free parameters that ended on a bound: their interval needs the profile likelihood.
    converged
        Whether the last Gauss-Newton step was a small part of the standard errors.
    """

    unknowns: tuple[Unknown, ...]
    values: dict[str, float]
    names: tuple[str, ...]
    covariance: Covariance
    residual: np.ndarray
    jacobian: np.ndarray
    at_bound: tuple[str, ...]
    converged: bool
    evaluations: int

    @property
    def chi2(self) -> float:
        """Sum of squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def dof(self) -> int:
        """Residuals minus free parameters."""
        return self.residual.size - len(self.names)

    @property
    def sigma(self) -> float:
        """Standard deviation of the residual; NaN without degrees of freedom."""
        return math.sqrt(self.chi2 / self.dof) if self.dof > 0 else math.nan

    @property
    def std_error(self) -> dict[str, float]:
        """Standard errors by name."""
        return dict(zip(self.names, self.covariance.std_error.tolist(), strict=True))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation matrix of the free parameters, shape (k, k)."""
        sd = self.covariance.std_error
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance.matrix / np.outer(sd, sd))

    def estimates(self, at: Mapping[str, float | str | bool] | None = None) -> list[Estimate]:
        """Return the free parameters with their 95 % intervals, or the reason why there is none.

        Intervals are Student's; those of logarithmic parameters symmetric in the logarithm.
        """
        logarithmic = {u.name for u in self.unknowns if u.logarithmic}
        found = []
        for name, sd in self.std_error.items():
            if name in self.at_bound:
                reason = (
                    f"the fit ends at its bound, {self.values[name]:.6g}; only the profile likelihood can tell more"
                )
                found.append(undetermined(name, reason, at))
            elif not math.isfinite(sd):
                found.append(undetermined(name, "the data do not determine it, alone or beside the others", at))
            else:
                dof, log = self.covariance.dof, name in logarithmic
                found.append(estimate(name, self.values[name], sd, dof=dof, at=at, logarithmic=log))
        return found

    def with_covariance(self, covariance: Covariance) -> Fit:
        """Return the same fit with another covariance (Newey-West, clusters, jackknife)."""
        return replace(self, covariance=covariance)


def fit(
    residual: Callable[[Values], np.ndarray],
    unknowns: Sequence[Unknown],
    *,
    jacobian: Callable[[Values], np.ndarray] | None = None,
    noise: Noise = "estimated",
    step: float | None = None,
    starts: int = 1,
    seed: int = 0,
    max_evaluations: int | None = None,
) -> Fit:
    """Minimise the sum of squares of ``residual(values)``.

    Parameters
    ----------
    residual
        ``residual(values by name) -> shape (n,)``, divided by the noise where that is known. NaN or
        infinite away from the start means "not here".
    unknowns
        What to find, at least one of them free.
    jacobian
        ``jacobian(values by name) -> shape (n, k)``, derivatives of the residual with respect to the
        free parameters in their order.
    noise
        "estimated": the covariance is scaled with chi2/dof, intervals are Student's; "known": it is
        not; "larger": it is where chi2/dof exceeds 1.
    step
        Relative step of the differences; raise it (1e-4) where the residual comes from an adaptive
        solver and is not smooth.
    starts
        How many starts to try: the given one, then a Latin hypercube over the bounds (without them
        over ten times the start, or a decade for logarithmic ones, either side); smallest chi2 wins.
    seed
        Of the hypercube.
    max_evaluations
        Of the residual in each search, those for differences not counted; by default 2000 a
        parameter.

    Raises
    ------
    InputError
        If there are fewer residuals than free parameters, or none is finite at any start.

    Examples
    --------
    >>> x = np.linspace(0, 2, 21)
    >>> y = 3 * np.exp(-1.5 * x)
    >>> found = fit(lambda p: p["a"] * np.exp(-p["b"] * x) - y, [Unknown("a", 1.0), Unknown("b", 1.0)])
    >>> round(found.values["a"], 9), round(found.values["b"], 9)
    (3.0, 1.5)
    """
    search = Search(residual, tuple(unknowns), jacobian, step)
    best: np.ndarray | None = None
    for start in search.starts(starts, seed):
        end = search.descend(start, max_evaluations)
        if end is not None and (best is None or search.cost(end) < search.cost(best)):
            best = end
    if best is None:
        shown = ", ".join(f"{u.name} = {u.start:.6g}" for u in unknowns)
        raise InputError(f"the model gives no finite numbers at the starting values ({shown}); give other ones.")
    return _result(search, *search.polished(best), noise)


def _result(search: Search, z: np.ndarray, r: np.ndarray, J: np.ndarray, converged: bool, noise: Noise) -> Fit:
    """Return the fit with its covariance in SI."""
    values = search.values(z)
    inner = np.array([values[u.name] if u.logarithmic else s for u, s in zip(search.free, search.scale, strict=True)])
    jacobian = J / inner
    held = search.held(z, J.T @ r)
    dof = r.size - len(search.free)
    variance = float(r @ r) / dof if dof > 0 else math.nan
    factor = {"estimated": variance, "known": 1.0, "larger": max(1.0, variance)}[noise]
    matrix = np.full((z.size, z.size), np.nan)
    matrix[np.ix_(~held, ~held)] = factor * _inverse_information(jacobian[:, ~held])
    names = tuple(u.name for u in search.free)
    return Fit(
        search.unknowns,
        values,
        names,
        Covariance(matrix, math.inf if noise == "known" else dof, f"least squares, noise {noise}"),
        r,
        jacobian,
        tuple(name for name, is_held in zip(names, held, strict=True) if is_held),
        converged,
        search.evaluations,
    )


def _inverse_information(jacobian: np.ndarray) -> np.ndarray:
    """Return (J'J)^-1, infinite for parameters that take part in a direction without information."""
    if not jacobian.shape[1]:
        return np.zeros((0, 0))
    norms = np.sqrt((jacobian**2).sum(axis=0))
    scale = np.where(norms > 0, norms, 1.0)
    _, singular, directions = np.linalg.svd(jacobian / scale, full_matrices=False)
    known = singular > 1e-13 * singular[0]
    root = directions[known] / singular[known][:, None]
    out = root.T @ root / np.outer(scale, scale)
    lost = np.abs(directions[~known]).max(axis=0, initial=0.0) > 1e-6
    out[lost] = 0.0
    out[:, lost] = 0.0
    out[lost, lost] = math.inf
    return np.asarray(out)
