"""Robust regression on few columns with scatter beyond the own errors: Huber's, with an interval that counts alike neighbours.

For numbers of runs in their order; not for signals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import effective_size

_HUBER = 1.345  # 95 % efficiency for normal scatter
_ROUNDING = 1e-9  # of numbers about 1: less is no scatter
_MAD = 0.674489750196
# Finite-sample factors of the median absolute deviation (Croux and Rousseeuw, COMPSTAT 1992, 411), for 2 to 9 numbers.
_MAD_FACTORS = (1.196, 1.495, 1.363, 1.206, 1.200, 1.140, 1.129, 1.107)


@dataclass(frozen=True, eq=False)
class RobustFit:
    """A weighted Huber regression: design (n, p), coefficients, standard deviation of each run, what is left over.

    `left` is the residual in standard deviations, `free` the share of its variance that the fit left it (1 - leverage).
    """

    design: np.ndarray
    beta: np.ndarray
    sd: np.ndarray
    scatter: float
    left: np.ndarray
    free: np.ndarray
    errors_known: bool

    @classmethod
    def of(cls, values: np.ndarray, error: np.ndarray, design: np.ndarray, member: np.ndarray) -> RobustFit:
        """Fit `values` of about 1 with own errors `error` (0: not known), shape (n,), by `design`, whose first columns are the groups of `member`."""
        n, p = design.shape
        beta: np.ndarray = np.zeros(p)
        for group in range(int(member.max()) + 1):
            beta[group] = np.median(values[member == group])
        free = np.ones(n)
        scatter = 0.0
        sd: np.ndarray = np.ones(n)
        for _ in range(50):
            before = beta
            residual = values - design @ beta
            scatter = _scatter(residual, error, free, p)
            sd = np.hypot(scatter, error)
            sd = np.maximum(sd, _ROUNDING)
            z = np.abs(residual) / sd
            weight = np.sqrt(_HUBER / np.maximum(z, _HUBER)) / sd
            rows = design * weight[:, None]
            beta = np.linalg.lstsq(rows, values * weight, rcond=1e-10)[0]
            free = _free(design / sd[:, None])
            if np.all(np.abs(design @ (beta - before)) <= 1e-7 * sd):
                break
        return cls(design, beta, sd, scatter, (values - design @ beta) / sd, free, bool(error.all()))

    @property
    def psi(self) -> np.ndarray:
        """What is left over, held to Huber's limit."""
        return np.asarray(np.clip(self.left, -_HUBER, _HUBER))

    def covariance(self, slow: int) -> tuple[np.ndarray, float]:
        """Return the covariance of the coefficients, shape (p, p), and its degrees of freedom; `slow` columns run over all.

        Huber's (Robust Statistics, 1981, eq. 6.6), times the number of runs over their effective number.
        """
        n, p = self.design.shape
        rows = self.design / self.sd[:, None]
        inverse = np.linalg.pinv(rows.T @ rows, rcond=1e-12, hermitian=True)
        if n <= p:
            return (inverse if self.errors_known else np.full_like(inverse, np.nan)), 1.0
        inside = max(float((np.abs(self.left) < _HUBER).mean()), 0.1)
        correction = 1 + p / n * (1 - inside) / inside
        variance = float((self.psi**2).sum()) / (n - p) * (correction / inside) ** 2
        alike = memory(self.psi, slow)
        return inverse * variance * alike, max((n - p) / alike, 1.0)


def huber(z: np.ndarray) -> np.ndarray:
    """Return Huber's loss of residuals in standard deviations: half the square of small ones, linear beyond his limit."""
    size = np.abs(z)
    return np.asarray(np.where(size < _HUBER, size**2 / 2, _HUBER * size - _HUBER**2 / 2))


def memory(psi: np.ndarray, slow: int) -> float:
    """Return how many neighbouring runs count as one."""
    # Two autocorrelations of n independent numbers sum to this, in standard deviations.
    return max(psi.size / effective_size(psi, slow, math.sqrt(2 / psi.size)), 1.0)


def _free(rows: np.ndarray) -> np.ndarray:
    """Return one less the leverage of each run; 0 where it alone determines a coefficient."""
    Q = basis(rows)
    free = 1 - (Q**2).sum(axis=1)
    return np.where(free > 1e-9, free, 0.0)


def basis(rows: np.ndarray) -> np.ndarray:
    """Return orthonormal columns that span those of `rows`, shape (n, rank)."""
    U, singular, _ = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(U[:, singular > 1e-10 * singular[:1]])


def _scatter(residual: np.ndarray, error: np.ndarray, free: np.ndarray, p: int) -> float:
    """Return the standard deviation beyond `error` that makes the median of residuals that of normal ones; 0 for none."""
    judged = free > 0
    size, error = np.abs(residual[judged]) / np.sqrt(free[judged]), error[judged]
    size = np.where(size > _ROUNDING, size, 0.0)
    # Where groups are of two or three runs, many residuals are small because they were fitted.
    fitted = int(min(2 * p / max(size.size, 1), 1.0) * min(p - 1, size.size - 1))
    n = size.size - fitted
    if n < 2:
        return 0.0
    usual = _MAD / (_MAD_FACTORS[n - 2] if n < 10 else n / (n - 0.8))

    def too_large(scatter: float) -> bool:
        sd = np.hypot(scatter, error)
        return bool(np.median(np.sort(size / np.where(sd > 0, sd, 1e-300))[fitted:]) > usual)

    if not too_large(0.0):
        return 0.0
    low, high = 0.0, float(size.max()) / usual
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if too_large(middle) else (low, middle)
    return high
