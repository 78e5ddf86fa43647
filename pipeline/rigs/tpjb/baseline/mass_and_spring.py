"""Force over acceleration of a stator on springs: R(w) = m_s - k_s/w^2, tone by tone and in one fit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Ratios:
    """Force over acceleration, kg, complex, shape (n,): one for each tone, axis and excitation.

    `std_error` is that of the real and of the imaginary part, known with `dof` degrees of freedom.
    """

    frequency: np.ndarray
    axis: tuple[str, ...]
    value: np.ndarray
    std_error: np.ndarray
    dof: np.ndarray


def ratio(force: np.ndarray, acceleration: np.ndarray) -> tuple[complex, float]:
    """Return the ratio of coherent means and the standard error of its real (and imaginary) part.

    Parameters
    ----------
    force, acceleration
        Complex amplitudes of B blocks, shape (B,).
    """
    F, A = force.mean(), acceleration.mean()
    R = F / A
    left = force - R * acceleration
    spread = float((np.abs(left - left.mean()) ** 2).sum()) / (left.size * (left.size - 1))
    return complex(R), math.sqrt(spread / 2) / abs(A)


@dataclass(frozen=True, eq=False)
class MassAndSpring:
    """m_s (kg), k_s (N/m), their covariance, chi-square of the fit with its 99 % point; k_s is what was stated where not fitted."""

    mass: float
    stiffness: float
    covariance: np.ndarray
    chi2: float
    dof: int
    limit: float
    residual: np.ndarray

    @property
    def widening(self) -> float:
        """By how much errors grow where the model is rejected, so that the scatter about it is theirs."""
        return 1.0 if self.chi2 <= self.limit or self.dof < 1 else math.sqrt(self.chi2 / self.dof)

    @property
    def std_errors(self) -> np.ndarray:
        """Standard errors of m_s and k_s, widened, shape (2,)."""
        return np.asarray(self.widening * np.sqrt(np.diag(self.covariance)))


def fit(ratios: Ratios, *, spring: bool = True, stated: float = 0.0) -> MassAndSpring:
    """Fit Re R = m_s - k_s/w^2 by weighted least squares; without `spring` with the `stated` k_s (N/m).

    Examples
    --------
    >>> w = 2 * np.pi * np.array([21.0, 29.0, 41.0])
    >>> exact = Ratios(w / 2 / np.pi, ("u",) * 3, 900 - 5e6 / w**2 + 0j, np.full(3, 0.1), np.full(3, 20.0))
    >>> found = fit(exact)
    >>> round(found.mass, 6), round(found.stiffness, 3)
    (900.0, 5000000.0)
    """
    from pipeline.rigs.tpjb.dynamic.laws import chi2_limit

    w = 2 * np.pi * ratios.frequency
    # Noise hardly differs between axes and excitations: their errors are pooled tone by tone for the weights.
    weight = np.empty(w.size)
    for tone in np.unique(ratios.frequency):
        same = ratios.frequency == tone
        weight[same] = np.sqrt(np.mean(ratios.std_error[same] ** 2))
    columns = np.stack([np.ones_like(w), -1 / w**2], axis=1)[:, : 2 if spring else 1] / weight[:, None]
    norm = np.linalg.norm(columns, axis=0)
    gain = np.linalg.pinv(columns / norm) / norm[:, None] / weight
    target = ratios.value.real if spring else ratios.value.real + stated / w**2
    solution = gain @ target
    left = target / weight - columns @ solution
    covariance = np.zeros((2, 2))
    covariance[: solution.size, : solution.size] = (gain * ratios.std_error**2) @ gain.T
    limit = chi2_limit(w.size, solution.size, 2 * ratios.dof)
    return MassAndSpring(
        float(solution[0]),
        float(solution[1]) if spring else stated,
        covariance,
        float(left @ left),
        w.size - solution.size,
        limit,
        left * weight,
    )
