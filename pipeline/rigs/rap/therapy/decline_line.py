"""Resistance of the membrane as a straight line over time, and K_0 and a from it with their errors (rap.md, 3.8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate
from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.rap.therapy.decline_errors import LineErrors, line_errors, student_two_sided


@dataclass(frozen=True, eq=False)
class Line:
    """Resistance c_0 + c_1 t/t_ref with its errors; `common` are errors of all values alike, as shares of (K_0, a)."""

    c: np.ndarray
    errors: LineErrors
    common_u: np.ndarray
    naive_sd: float

    @property
    def values(self) -> np.ndarray:
        """K_0 (m^3/(s Pa)) and a, (2,)."""
        return np.array([1.0 / self.c[0], self.c[1] / self.c[0]])

    @property
    def _random(self) -> np.ndarray:
        """Random standard errors of (K_0, a)."""
        J = _jacobian(self.c)
        return np.sqrt(np.maximum(np.diag(J @ self.errors.covariance @ J.T), 1e-300))

    @property
    def std_error(self) -> np.ndarray:
        """Standard errors of K_0 and a, random and common, (2,)."""
        return np.asarray(np.hypot(self._random, self.common_u))

    @property
    def dof(self) -> np.ndarray:
        """Degrees of freedom (Welch and Satterthwaite): the common part has none of its own."""
        return np.asarray(self.errors.dof * (self.std_error / self._random) ** 4)

    @property
    def p_no_decline(self) -> float:
        """Probability of so large a decline, or larger, where there is none."""
        return student_two_sided(float(self.values[1] / self.std_error[1]), float(self.dof[1]))

    def estimates(self, notes: str) -> tuple[Estimate, Estimate]:
        """Return K_0 and a with their intervals."""
        (K_0, a), (sd_K, sd_a), (dof_K, dof_a) = self.values, self.std_error, self.dof
        return (
            estimate("k_uf_initial", K_0, sd_K, dof=float(dof_K), reason=notes, type_b=float(self.common_u[0])),
            estimate("k_uf_decline", a, sd_a, dof=float(dof_a), reason=notes, type_b=float(self.common_u[1])),
        )

    def course(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return K (n,) and its 95 % band (n, 2), the common errors left out."""
        G = np.stack([np.ones(t.size), t], axis=1)
        r = G @ self.c
        half = t_quantile(self.errors.dof) * np.sqrt(np.einsum("ni,ij,nj->n", G, self.errors.covariance, G))
        return 1.0 / r, np.stack([1.0 / (r + half), 1.0 / np.maximum(r - half, 1e-3 * r)], axis=1)


def _jacobian(c: np.ndarray) -> np.ndarray:
    """Return d(K_0, a)/d(c_0, c_1)."""
    return np.array([[-1.0 / c[0] ** 2, 0.0], [-c[1] / c[0] ** 2, 1.0 / c[0]]])


def fitted_line(t: np.ndarray, r: np.ndarray, shape: np.ndarray, common: Sequence[np.ndarray], length: int) -> Line:
    """Fit the line."""
    X = np.stack([np.ones(t.size), t], axis=1)
    H = np.linalg.pinv(X)
    c = H @ r
    residual = r - X @ c
    J = _jacobian(c)
    u = np.sqrt(sum((J @ (H @ part)) ** 2 for part in common))
    naive = H @ H.T * float(residual @ residual) / max(t.size - 2, 1)
    errors = line_errors(residual, H, shape, length)
    return Line(c, errors, u, math.sqrt(float((J @ naive @ J.T)[1, 1])))
