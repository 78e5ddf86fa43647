"""The quasi-static law of the bearing (tpjb.md, eqs 3 and 4): force from displacement, and back by Newton.

The displacement counts from the static equilibrium, the force is the dynamic part; damping is left out
(it turns a 0.01 Hz orbit by 0.03 deg). Not a frequency response. SI; coefficients in one order everywhere.
"""

from __future__ import annotations

import numpy as np

COEFFICIENTS = ("kxx", "kxy", "kyx", "kyy", "kxx2", "kxy2", "kyx2", "kyy2", "kxxy", "kyxy")
LINEAR, QUADRATIC = slice(0, 4), slice(4, 10)
# N/m and N/m^2: in these units all coefficients of a large bearing are of the size of one.
SCALE = np.array([1e9] * 4 + [1e12] * 6)

_NEWTON_STEPS = 12
# Load steps of the first pass, and of the second for the samples that the first lost.
_LOAD_STEPS = (4, 40)


def force(p: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the force (N), shape (2, ...), that holds the stator at `d`, eqs (3) and (4) with mixed terms.

    Parameters
    ----------
    p
        kxx kxy kyx kyy (N/m) kxx2 kxy2 kyx2 kyy2 kxxy kyxy (N/m^2), shape (10,) or (10, ...) that
        broadcasts with the samples.
    d
        Displacement from the equilibrium, x and y, shape (2, ...), m.

    Examples
    --------
    >>> force(np.array([2.0, 0, 0, 3.0, 1.0, 0, 0, 0, 0, 1.0]), np.array([1.0, 2.0]))
    array([3., 8.])
    """
    x, y = d
    fx = (p[0] + p[4] * x + p[8] * y) * x + (p[1] + p[5] * y) * y
    fy = (p[2] + p[6] * x + p[9] * y) * x + (p[3] + p[7] * y) * y
    return np.stack([fx, fy])


def tangent(p: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the tangent stiffness J = df/dd (N/m), shape (2, 2, ...): row of the force, column of the motion."""
    x, y = d
    return np.array(
        [
            [p[0] + 2 * p[4] * x + p[8] * y, p[1] + 2 * p[5] * y + p[8] * x],
            [p[2] + 2 * p[6] * x + p[9] * y, p[3] + 2 * p[7] * y + p[9] * x],
        ]
    )


def determinant(p: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return det J (N^2/m^2) at `d`, shape (...); where it reaches 0 the law folds."""
    J = tangent(p, d)
    return np.asarray(J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0])


def fold_margin(p: np.ndarray, d: np.ndarray) -> float:
    """Return the least det J over det K on an orbit: 1 for a linear bearing, 0 at the fold, NaN past it."""
    ratio = determinant(p, d) / (p[0] * p[3] - p[1] * p[2])
    return float(np.min(ratio))


def compliance(p: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return J^-1 (m/N), shape (2, 2, ...)."""
    J = tangent(p, d)
    det = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    return np.asarray(np.array([[J[1, 1], -J[0, 1]], [-J[1, 0], J[0, 0]]]) / det)


def regressors(d: np.ndarray) -> np.ndarray:
    """Return df/dp, shape (2, 10, n), of samples `d`, shape (2, n): the law is linear in its coefficients."""
    x, y = d
    out = np.zeros((2, 10, x.size))
    out[0, [0, 1, 4, 5, 8]] = out[1, [2, 3, 6, 7, 9]] = x, y, x * x, y * y, x * y
    return out


def sensitivity(p: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return dd/dp = -J^-1 df/dp at constant force, shape (2, 10, n), for equilibria `d`, shape (2, n)."""
    return np.asarray(-np.einsum("ijn,jkn->ikn", compliance(p, d), regressors(d)))


def equilibrium(p: np.ndarray, f: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
    """Return the displacement (m) under the force `f`, shape (2, ...), on the branch that starts at rest.

    Parameters
    ----------
    p
        Coefficients as in `force`.
    f
        Force, x and y, shape (2, ...), N.
    near
        Equilibria of about the same coefficients and forces, shape (2, ...): one Newton search from
        there instead of the path from rest. Samples that it loses are followed from rest
        in large steps only, for the trials of a search: to be refused close to the fold does no harm there.

    Returns
    -------
    NaN in both components of samples whose force lies past the fold: det J changes sign on the way
    there, and no equilibrium is left on this branch. Other branches are not jumped to.

    Notes
    -----
    Newton over all samples at once while the load rises in steps; what is lost in large steps is
    tried again in small ones.
    """
    p = np.asarray(p, dtype=float)
    f = np.asarray(f, dtype=float)
    shape = np.broadcast_shapes(p.shape[1:], f.shape[1:])
    flat_f = np.broadcast_to(f, (2, *shape)).reshape(2, -1)
    flat_p = p if p.ndim == 1 else np.broadcast_to(p, (10, *shape)).reshape(10, -1)
    with np.errstate(all="ignore"):  # iterates past the fold run away, and are thrown away
        d = np.full(flat_f.shape, np.nan)
        if near is not None:
            d = _step(flat_p, flat_f, np.broadcast_to(near, (2, *shape)).reshape(2, -1))
        for steps in _LOAD_STEPS if near is None else _LOAD_STEPS[:1]:
            lost = np.flatnonzero(np.isnan(d[0]) & np.isfinite(flat_f).all(axis=0))
            if lost.size:
                d[:, lost] = _path(flat_p if p.ndim == 1 else flat_p[:, lost], flat_f[:, lost], steps)
    return d.reshape(2, *shape)


def _path(p: np.ndarray, f: np.ndarray, steps: int) -> np.ndarray:
    """Raise the load from zero in equal steps."""
    d = np.zeros_like(f)
    for step in range(1, steps + 1):
        d = _step(p, f * (step / steps), d)
    return d


def _step(p: np.ndarray, f: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return Newton's solution from `start`; NaN where it fails or the fold lies between."""
    d = start.copy()
    tolerance = 1e-13 * (np.abs(f).max(initial=0.0) + 1e-300)
    unsigned = p[0] * p[3] - p[1] * p[2]
    error = force(p, d) - f
    for _ in range(_NEWTON_STEPS):
        J = tangent(p, d)
        det = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
        d[0] -= (J[1, 1] * error[0] - J[0, 1] * error[1]) / det
        d[1] -= (J[0, 0] * error[1] - J[1, 0] * error[0]) / det
        error = force(p, d) - f
        worst = np.abs(error).max(axis=0)
        if not np.any(worst > tolerance):
            break
    sound = (worst <= 1e4 * tolerance) & (determinant(p, d) * unsigned > 0)
    sound &= determinant(p, 0.5 * (start + d)) * unsigned > 0
    return np.where(sound, d, np.nan)


def fold_force(p: np.ndarray, highest: float, directions: int = 180) -> float:
    """Return the size (N) of a turning force at which some direction first reaches the fold.

    Infinite if that is above `highest`. Sought by halving, to 0.1 %.
    """
    angle = 2 * np.pi * np.arange(directions) / directions
    around = np.stack([np.cos(angle), np.sin(angle)])

    def folds(size: float) -> bool:
        return bool(np.isnan(equilibrium(p, size * around)).any())

    if not folds(highest):
        return float("inf")
    low, high = 0.0, highest
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if folds(middle) else (middle, high)
    return 0.5 * (low + high)
