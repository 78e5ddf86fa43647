"""The clearance polygon as it stands in the orbit: support function, number and rotation of the sides.

Nothing of forces here: the sides found are those at the force of the orbit, compliance included.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tpjb.axes import pad_directions
from pipeline.rigs.tpjb.bump.contact import centred, side_normals

_QUANTILE = 0.999
_GRID = 181
_PASSES = 4


@dataclass(frozen=True, eq=False)
class Polygon:
    """A polygon around an orbit. SI.

    Attributes
    ----------
    pad_angles
        Shape (N,), rad.
    rotation
        alpha, rad, within half a side.
    sides
        q_i, from the zero of the probes, shape (N,).
    near
        Share of the samples that lie at each side, shape (N,).
    misfit
        rms distance of the orbit from the polygon's edge, m.
    """

    pad_angles: np.ndarray
    rotation: float
    sides: np.ndarray
    near: np.ndarray
    misfit: float

    @property
    def n_pads(self) -> int:
        """Number of sides."""
        return int(self.sides.size)

    @property
    def normals(self) -> np.ndarray:
        """Outward normals, shape (N, 2)."""
        return side_normals(self.pad_angles, self.rotation)

    @property
    def centre(self) -> np.ndarray:
        """Normalised centre d0, shape (2,), m."""
        return centred(self.sides, self.normals)[0]

    @property
    def clearances(self) -> np.ndarray:
        """Normalised distances c_i, shape (N,), m."""
        return centred(self.sides, self.normals)[1]


def fit_polygon(displacement: np.ndarray, pad_angles: np.ndarray, near: float = 0.5e-6) -> Polygon:
    """Return the polygon of sides across the pads that lies closest round an orbit.

    The support function ``c_i(alpha) = 99.9 % quantile of n_i(alpha).(d - m)`` is summed over the
    sides; alpha is where the sum is least, sought all over half a side either way. A robust loss
    alone would also take the polygon turned by 180/N deg whose sides touch the corners. Each side is
    then moved to the median of the samples within `near` (tpjb.md, section 5, T1).

    Parameters
    ----------
    displacement
        Shape (n, 2), m, finite.
    pad_angles
        Directions of the pads, rad, shape (N,).
    """
    middle = 0.5 * (displacement.max(axis=0) + displacement.min(axis=0))
    d = displacement - middle
    half = math.pi / pad_angles.size
    grid = np.linspace(-half, half, _GRID)
    total = [_support(d, pad_angles, alpha).sum() for alpha in grid]
    best = int(np.argmin(total))
    step = grid[1] - grid[0]
    rotation = _least(lambda alpha: float(_support(d, pad_angles, alpha).sum()), grid[best] - step, grid[best] + step)
    rotation = (rotation + half) % (2 * half) - half
    sides = _support(d, pad_angles, rotation)
    along = d @ side_normals(pad_angles, rotation).T
    for _ in range(_PASSES):
        for i in range(sides.size):
            close = np.abs(along[:, i] - sides[i]) < near
            if close.any():
                sides[i] += float(np.median(along[close, i] - sides[i]))
    inside = (along - sides).max(axis=1)
    return Polygon(
        pad_angles,
        float(rotation),
        sides + side_normals(pad_angles, rotation) @ middle,
        (np.abs(along - sides) < near).mean(axis=0),
        float(np.sqrt(np.mean(inside**2))),
    )


def _support(d: np.ndarray, pad_angles: np.ndarray, rotation: float) -> np.ndarray:
    return np.asarray(np.quantile(d @ side_normals(pad_angles, rotation).T, _QUANTILE, axis=0))


def _least(function: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import minimize_scalar

    return float(minimize_scalar(function, bounds=(low, high), method="bounded", options={"xatol": 1e-7}).x)


@dataclass(frozen=True)
class Count:
    """How well each number of pads fits one orbit: misfit (m) by number, and the number the orbit shows."""

    misfits: dict[int, float]
    found: int | None


def count_pads(displacement: np.ndarray, candidates: Sequence[int], near: float = 0.5e-6) -> Count:
    """Tell how many sides an orbit has: the fewest that lie as close as any.

    More sides than there are can always be laid through the corners, so that a smaller misfit alone
    says nothing; None where even the best polygon misses the orbit by more than a fiftieth of its size.
    """
    size = float(np.ptp(displacement, axis=0).max())
    misfits = {n: fit_polygon(displacement, pad_directions(n), near).misfit for n in candidates}
    best = min(misfits.values())
    alike = [n for n, misfit in sorted(misfits.items()) if misfit <= max(2 * best, 0.004 * size)]
    return Count(misfits, alike[0] if best < 0.02 * size else None)
