"""Fisher information of designs: what runs that were (or will be) made say about parameters, and at best how well.

The Cramér-Rao bound on a standard error is `Information.std_error`. Information of independent runs adds up; what is
common to a run alone (its gain, its offset) is projected out, with a prior where its scatter is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

# A direction whose scaled information is below that of the best one by this factor is not determined.
_RANK = 1e-13


@dataclass(frozen=True, eq=False)
class Information:
    """Fisher information `matrix`, shape (k, k), about the k parameters `names`."""

    names: tuple[str, ...]
    matrix: np.ndarray

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        jacobian: np.ndarray,
        sigma: float | np.ndarray,
        nuisance: np.ndarray | None = None,
        prior: float | np.ndarray = math.inf,
    ) -> Information:
        """Return the information of n samples with independent normal errors.

        Parameters
        ----------
        jacobian
            Derivatives of what is measured by the parameters, shape (n, k); whitened, or with `sigma` for white errors.
        sigma
            Standard deviation of the errors: one, or shape (n,).
        nuisance
            Derivatives by what belongs to this run alone, shape (n, m).
        prior
            Standard deviation of each nuisance from run to run: one, or shape (m,); infinite where nothing is known.
        """
        weight = 1.0 / np.broadcast_to(np.asarray(sigma, dtype=float), jacobian.shape[:1])
        rows = jacobian * weight[:, None]
        matrix = rows.T @ rows
        if nuisance is not None and nuisance.size:
            own = nuisance * weight[:, None]
            known = own.T @ own + np.diag(1.0 / np.broadcast_to(np.asarray(prior, dtype=float), own.shape[1:]) ** 2)
            cross = own.T @ rows
            matrix = matrix - cross.T @ np.linalg.pinv(known, hermitian=True) @ cross
        return cls(tuple(names), 0.5 * (matrix + matrix.T))

    @classmethod
    def from_covariance(cls, names: Sequence[str], covariance: np.ndarray) -> Information:
        """Return the information behind a covariance, shape (k, k); an infinite variance is none at all."""
        matrix = np.zeros_like(covariance, dtype=float)
        known = np.isfinite(np.diag(covariance))
        matrix[np.ix_(known, known)] = np.linalg.pinv(covariance[np.ix_(known, known)], hermitian=True)
        return cls(tuple(names), matrix)

    def __add__(self, other: Information) -> Information:
        """Return the information of both; a parameter that only one of them knows is kept."""
        names = list(dict.fromkeys([*self.names, *other.names]))
        matrix = np.zeros((len(names), len(names)))
        for part in (self, other):
            places = [names.index(name) for name in part.names]
            matrix[np.ix_(places, places)] += part.matrix
        return Information(tuple(names), matrix)

    def __mul__(self, runs: float) -> Information:
        """Return the information of so many equal, independent runs."""
        return Information(self.names, runs * self.matrix)

    def std_error(self, gradient: Mapping[str, float] | str) -> float:
        """Return the least standard error of a parameter, or of a combination by its gradient; infinite if not determined.

        Examples
        --------
        >>> both = Information.of(("a", "b"), np.array([[1.0, 0.0], [0.0, 2.0]]), 1.0)
        >>> both.std_error("b"), round(both.std_error({"a": 1.0, "b": 2.0}), 6)
        (0.5, 1.414214)
        """
        wanted = {gradient: 1.0} if isinstance(gradient, str) else dict(gradient)
        along = np.array([wanted.get(name, 0.0) for name in self.names])
        size = np.sqrt(np.diag(self.matrix))
        if np.any((size == 0) & (along != 0)) or not along.any():
            return math.inf if along.any() else 0.0
        scale = np.where(size > 0, size, 1.0)
        values, vectors = np.linalg.eigh(self.matrix / np.outer(scale, scale))
        parts = vectors.T @ (along / scale)
        known = values > _RANK * max(float(values[-1]), 1e-300)
        if np.abs(parts[~known]).max(initial=0.0) > 1e-5 * float(np.linalg.norm(parts)):
            return math.inf
        return math.sqrt(float((parts[known] ** 2 / values[known]).sum()))
