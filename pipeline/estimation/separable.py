"""Separable least squares by variable projection: y ~ A(q) c, where only q is searched.

For every q the linear coefficients c are solved for, so the search has as many unknowns as there are
nonlinear parameters and needs no start values for c (Golub-Pereyra, SIAM J. Numer. Anal. 10, 1973, 413).
Nothing here knows what the columns stand for; models that are not linear in any parameter belong elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

# How A c changes with q at fixed c: dA/dq of shape (k, m, p), or a function c -> (m, k) where most of it is 0.
Slopes = np.ndarray | Callable[[np.ndarray], np.ndarray]
# Columns at q: A of shape (m, p) and its slopes; real or complex.
Columns = Callable[[np.ndarray], tuple[np.ndarray, Slopes]]
# A linear map of the rows (whitening), applied to arrays of shape (rows, ...).
RowMap = Callable[[np.ndarray], np.ndarray]

# Beyond this condition number the normal equations lose too many digits and an SVD takes over.
_NO_COLUMN = 1e-140  # norm of a column that counts as zeros: its square must not overflow
_CHOLESKY_CONDITION = 1e3


@dataclass(frozen=True, eq=False)
class SeparableFit:
    """Result of a separable fit.

    Attributes
    ----------
    q, c
        Nonlinear parameters (k,) and linear coefficients (p,).
    residual, jacobian
        Weighted, real: (y - A c) and d(A c)/d[q, c], shapes (m,) and (m, k + p), m counting real and
        imaginary parts.
    chi2, dof
        Sum of squares of `residual` and m - k - p.
    covariance
        Of [q, c] for unit variance of the weighted data; multiply by chi2/dof where the weights are
        only relative. Directions that the data do not see have a huge, not an infinite variance.
    correlation, condition
        Correlation matrix of [q, c]; condition number of the Jacobian with columns scaled to unit norm.
    at_bound
        Which q lie at a bound, shape (k,).
    converged, evaluations
        Whether the search ended by its own tolerance, and how often the columns were computed.
    """

    q: np.ndarray
    c: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    chi2: float
    dof: int
    covariance: np.ndarray
    correlation: np.ndarray
    condition: float
    at_bound: np.ndarray
    converged: bool
    evaluations: int


def fit_separable(
    columns: Columns,
    y: np.ndarray,
    q0: np.ndarray,
    *,
    lower: np.ndarray | None = None,
    upper: np.ndarray | None = None,
    scale: np.ndarray | None = None,
    weights: np.ndarray | None = None,
    whiten: RowMap | None = None,
    tolerance: float = 1e-10,
    max_evaluations: int = 200,
) -> SeparableFit:
    """Minimise ``|W (y - A(q) c)|^2`` over q and c with the analytic Jacobian of Kaufman.

    Parameters
    ----------
    columns
        ``columns(q) -> (A, dA)`` with shapes (m, p) and (k, m, p), or in place of dA a function
        ``c -> d(A c)/dq`` of shape (m, k) for those that are mostly zero.
    y
        Data, shape (m,), real or complex (real and imaginary parts then count as data).
    q0, lower, upper, scale
        Start, bounds and typical step of each q, shape (k,); no bounds and unit steps by default.
    weights
        One over the standard deviation of each datum (of the real and of the imaginary part).
    whiten
        Further linear map of the weighted real rows [Re; Im], for data that are correlated.

    Raises
    ------
    ValueError
        If there are fewer data than parameters, or the columns are not finite at the start.

    Notes
    -----
    Kaufman's Jacobian -(I - P) dA c leaves out the term of Golub and Pereyra that lies in the range of
    A: the gradient is the same and the derivative of A+ is not needed (BIT 15, 1975, 49).

    Examples
    --------
    >>> x = np.linspace(0, 2, 30)
    >>> def decay(q):
    ...     e = np.exp(-q[0] * x)
    ...     return e[:, None], (-x * e)[None, :, None]
    >>> fit = fit_separable(decay, 3 * np.exp(-1.7 * x), np.array([1.0]))
    >>> [round(float(v), 6) for v in (*fit.q, *fit.c)]
    [1.7, 3.0]
    """
    from scipy.optimize import least_squares

    problem = _Projected(columns, np.asarray(y), weights, whiten)
    q0 = np.asarray(q0, dtype=float)
    lower = np.full(q0.size, -np.inf) if lower is None else np.asarray(lower, dtype=float)
    upper = np.full(q0.size, np.inf) if upper is None else np.asarray(upper, dtype=float)
    scale = np.ones(q0.size) if scale is None else np.asarray(scale, dtype=float)
    found = least_squares(
        problem.residual,
        np.clip(q0, lower, upper),
        problem.reduced_jacobian,
        bounds=(lower, upper),
        method="trf",
        x_scale=scale,
        ftol=tolerance,
        xtol=tolerance,
        gtol=1e-14,
        max_nfev=max_evaluations,
    )
    near = 1e-4 * scale
    at_bound = (found.x - lower < near) | (upper - found.x < near)
    return problem.result(found.x, at_bound, bool(found.status > 0))


def linear_fit(
    A: np.ndarray, y: np.ndarray, *, weights: np.ndarray | None = None, whiten: RowMap | None = None
) -> SeparableFit:
    """Solve the linear part alone: the same result with no nonlinear parameter."""
    empty = np.zeros(0)
    problem = _Projected(lambda _q: (A, np.zeros((0, *A.shape), A.dtype)), np.asarray(y), weights, whiten)
    return problem.result(empty, np.zeros(0, dtype=bool), True)


def multi_start(
    fit: Callable[[np.ndarray], SeparableFit],
    starts: Sequence[np.ndarray],
    acceptable: Callable[[SeparableFit], bool] = lambda _fit: True,
) -> tuple[SeparableFit, int, int]:
    """Fit from every start and return the best, how many agree with it, and how many were tried.

    An unacceptable end point is taken only where there is no acceptable one. Starts that fail (columns
    not finite) are passed over.

    Raises
    ------
    ValueError
        If every start fails; the last reason is told.
    """
    ends: list[SeparableFit] = []
    failure: ValueError | None = None
    for q0 in starts:
        try:
            ends.append(fit(np.asarray(q0, dtype=float)))
        except ValueError as error:
            failure = error
    if not ends:
        raise ValueError(f"no start led to a fit: {failure}")
    best = min([end for end in ends if acceptable(end)] or ends, key=lambda end: end.chi2)
    agreeing = sum(end.chi2 <= best.chi2 * (1 + 1e-4) and acceptable(end) == acceptable(best) for end in ends)
    return best, agreeing, len(ends)


def per_group(
    A: np.ndarray, dA: np.ndarray, labels: np.ndarray, own: Sequence[int], groups: int
) -> tuple[np.ndarray, np.ndarray]:
    """Give the columns `own` a coefficient per group of rows; the others stay shared by all rows.

    Parameters
    ----------
    A, dA
        Columns (m, p) and derivatives (k, m, p).
    labels
        Group 0..groups-1 of each row, shape (m,).
    own
        Columns that get a coefficient per group.

    Returns
    -------
    Shared columns first, then those of `own` group by group; the derivatives likewise.
    """
    shared = [j for j in range(A.shape[1]) if j not in own]
    member = labels[:, None] == np.arange(groups)  # (m, groups)
    blocks = [A[:, shared]] + [A[:, list(own)] * member[:, [g]] for g in range(groups)]
    slopes = [dA[:, :, shared]] + [dA[:, :, list(own)] * member[None, :, [g]] for g in range(groups)]
    return np.concatenate(blocks, axis=1), np.concatenate(slopes, axis=2)


class _Projected:
    """The least-squares problem left after the linear coefficients are solved for."""

    def __init__(self, columns: Columns, y: np.ndarray, weights: np.ndarray | None, whiten: RowMap | None) -> None:
        self.columns, self.weights, self.whiten = columns, weights, whiten
        self.y = self._rows(y)
        self.evaluations = 0
        self._at: np.ndarray | None = None

    def _rows(self, values: np.ndarray) -> np.ndarray:
        """Return weighted real rows of an array of shape (m, ...)."""
        if self.weights is not None:
            values = values * self.weights.reshape(-1, *[1] * (values.ndim - 1))
        if np.iscomplexobj(values):
            values = np.concatenate([values.real, values.imag])
        return np.asarray(values if self.whiten is None else self.whiten(values))

    def _solve(self, q: np.ndarray) -> None:
        """Compute columns, basis of their range, coefficients and residual at q, once."""
        if self._at is not None and np.array_equal(q, self._at):
            return
        A, self.slopes = self.columns(q)
        if not np.all(np.isfinite(A)):
            raise ValueError(f"the columns are not finite at {q}")
        self.evaluations += 1
        self.A = self._rows(A)
        self.basis, self.c = _range_and_solution(self.A, self.y)
        self.r = self.y - self.A @ self.c
        self._at = q.copy()

    def _slopes(self) -> np.ndarray:
        """Return the weighted d(A c)/dq, shape (m, k)."""
        slopes = self.slopes(self.c) if callable(self.slopes) else (self.slopes @ self.c).T
        if not np.all(np.isfinite(slopes)):
            raise ValueError("the derivatives of the columns are not finite")
        return self._rows(slopes)

    def residual(self, q: np.ndarray) -> np.ndarray:
        self._solve(q)
        return np.asarray(self.r)

    def reduced_jacobian(self, q: np.ndarray) -> np.ndarray:
        self._solve(q)
        slopes = self._slopes()
        return np.asarray(self.basis @ (self.basis.T @ slopes) - slopes)

    def result(self, q: np.ndarray, at_bound: np.ndarray, converged: bool) -> SeparableFit:
        self._solve(q)
        jacobian = np.hstack([self._slopes(), self.A]) if q.size else self.A
        if jacobian.shape[0] < jacobian.shape[1]:
            raise ValueError(f"{jacobian.shape[0]} data cannot determine {jacobian.shape[1]} parameters")
        covariance, condition = covariance_of(jacobian)
        spread = np.sqrt(np.diag(covariance))
        return SeparableFit(
            q=np.asarray(q, dtype=float).copy(),
            c=self.c,
            residual=self.r,
            jacobian=jacobian,
            chi2=float(self.r @ self.r),
            dof=jacobian.shape[0] - jacobian.shape[1],
            covariance=covariance,
            correlation=covariance / np.outer(spread, spread),
            condition=condition,
            at_bound=at_bound,
            converged=converged,
            evaluations=self.evaluations,
        )


def covariance_of(jacobian: np.ndarray) -> tuple[np.ndarray, float]:
    """Return (J^T J)^-1 and the condition number of J with columns of unit norm, by SVD.

    A column of zeros, or singular values below 1e-13 of the largest, count as that small value.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    norms = np.where(norms > _NO_COLUMN, norms, 1.0)
    _, s, vt = np.linalg.svd(np.linalg.qr(jacobian / norms, mode="r"), full_matrices=False)
    s = np.maximum(s, 1e-13 * s[0])
    half = vt.T / s / norms[:, None]
    return half @ half.T, float(s[0] / s[-1])


def _range_and_solution(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return an orthonormal basis of the range of A, shape (m, rank), and the least-squares solution."""
    norms = np.linalg.norm(A, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    scaled = A / norms
    gram = scaled.T @ scaled
    try:
        factor = np.linalg.cholesky(gram)
        diagonal = np.diag(factor)
        if diagonal.min() > diagonal.max() / _CHOLESKY_CONDITION:
            basis = np.linalg.solve(factor, scaled.T).T
            return basis, np.linalg.solve(factor.T, basis.T @ y) / norms
    except np.linalg.LinAlgError:
        pass  # columns all but dependent: the SVD below tells the rank
    u, s, vt = np.linalg.svd(scaled, full_matrices=False)
    rank = int(np.sum(s > s[0] * 1e-13))
    basis = u[:, :rank]
    return basis, vt[:rank].T @ ((basis.T @ y) / s[:rank]) / norms
