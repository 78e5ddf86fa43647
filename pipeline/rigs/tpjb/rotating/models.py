"""The competing models of the bearing: each lets some of the ten coefficients of `law` free.

A model is a linear map from its free coefficients to the ten, so that a law written in other axes (the
pads') is fitted by the same machinery. What fits them is in `displacement_fit`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tpjb.rotating import law
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS, SCALE


@dataclass(frozen=True, eq=False)
class Model:
    """A model by name, its free coefficients, and the map from them to the ten, shape (10, k).

    `text` says in a few words what it holds. Columns of stiffnesses (N/m) come first.
    """

    name: str
    free: tuple[str, ...]
    matrix: np.ndarray
    text: str

    @property
    def size(self) -> int:
        """Number of free coefficients."""
        return len(self.free)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the free coefficients."""
        return tuple("N/m" if self._is_linear(j) else "N/m^2" for j in range(self.size))

    @property
    def scale(self) -> np.ndarray:
        """Typical size of each free coefficient, shape (k,), for well-scaled searches."""
        return np.array([SCALE[0] if self._is_linear(j) else SCALE[-1] for j in range(self.size)])

    @property
    def is_linear(self) -> bool:
        """Whether the force is proportional to the displacement."""
        return not self.matrix[4:].any()

    def _is_linear(self, column: int) -> bool:
        return not self.matrix[4:, column].any()

    def coefficients(self, theta: np.ndarray) -> np.ndarray:
        """Return the ten coefficients, shape (10,), of the free ones, shape (k,)."""
        return np.asarray(self.matrix @ theta)

    def covariance(self, covariance: np.ndarray) -> np.ndarray:
        """Return the covariance of the ten, shape (10, 10), from that of the free ones, shape (k, k)."""
        return np.asarray(self.matrix @ covariance @ self.matrix.T)

    def displacement(self, theta: np.ndarray, f: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
        """Return the displacement (m), shape (2, n), under the force `f`; see `law.equilibrium`."""
        return law.equilibrium(self.coefficients(theta), f, near)

    def slopes(self, theta: np.ndarray, d: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # noqa: ARG002 - other laws need it
        """Return dd/dtheta, shape (2, k, n), and dd/df, shape (2, 2, n), at equilibria `d` under `f`, (2, n)."""
        p = self.coefficients(theta)
        return np.einsum("ikn,kj->ijn", law.sensitivity(p, d), self.matrix), law.compliance(p, d)

    def holds(self, other: Model) -> bool:
        """Tell whether every law of the other model is one of this."""
        rank = np.linalg.matrix_rank
        return bool(rank(np.hstack([self.matrix, other.matrix])) == rank(self.matrix))


def _of(name: str, free: str, text: str) -> Model:
    names = tuple(free.split())
    matrix = np.zeros((len(COEFFICIENTS), len(names)))
    matrix[[COEFFICIENTS.index(n) for n in names], range(len(names))] = 1.0
    return Model(name, names, matrix, text)


def along_pads(name: str, directions: Sequence[float], letters: Sequence[str], text: str) -> Model:
    """Return the model in which each pad pushes along its own direction n: f = sum n (k q + k2 q^2), q = n d.

    Parameters
    ----------
    directions
        Angles of the pads from x, rad; opposite ones differ in the sign of k2.
    letters
        One a pad: coefficients are called kuu and kuu2 for "u".

    Examples
    --------
    Two pads at 45 and 135 deg that follow the same law (tpjb.md, two-pad picture):

    >>> p = M3P.coefficients(np.array([1.0, 1.0, 1.0, 1.0]))
    >>> np.round(p * np.array([1, 1, 1, 1, *[2**0.5] * 6]), 9) + 0.0  # kyy2 = kyx2 = a/sqrt2, kxxy = sqrt2 a
    array([1., 0., 0., 1., 0., 0., 1., 1., 2., 0.])
    """
    columns = []
    for angle in directions:
        c, s = math.cos(angle), math.sin(angle)
        columns.append([c * c, c * s, c * s, s * s, *[0.0] * 6])
    for angle in directions:
        c, s = math.cos(angle), math.sin(angle)
        columns.append([0.0] * 4 + [c**3, c * s * s, c * c * s, s**3, 2 * c * c * s, 2 * c * s * s])
    free = tuple(f"k{z}{z}" for z in letters) + tuple(f"k{z}{z}2" for z in letters)
    return Model(name, free, np.array(columns).T, text)


M1 = _of("M1", "kxx kyy", "linear, direct terms only")
M2 = _of("M2", "kxx kxy kyx kyy", "linear with cross coupling")
M3 = _of("M3", "kxx kyy kxx2 kyy2", "direct terms, linear and quadratic")
M4 = _of("M4", "kxx kxy kyx kyy kxx2 kyy2", "cross coupling, direct quadratic terms")
M5 = _of("M5", "kxx kxy kyx kyy kxx2 kxy2 kyx2 kyy2", "the paper's eqs (3) and (4)")
M6 = _of("M6", " ".join(COEFFICIENTS), "eqs (3) and (4) with the mixed terms dx dy")
M3P = along_pads("M3p", (math.pi / 4, 3 * math.pi / 4), ("u", "v"), "two pads, each with its own quadratic law")
MODELS = (M1, M2, M3, M4, M5, M6, M3P)


def model(name: str) -> Model:
    """Return one of `MODELS` by name; KeyError if there is none."""
    return {m.name: m for m in MODELS}[name]
