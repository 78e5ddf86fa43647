"""The hysteretic variable w of the dynamic model (mre.md eq. 12), integrated over displacement.

Rate independent, so no velocity is needed: with s = sign(dx),
``dw/dx = rho (1 - |w|^n)`` where s w >= 0 and ``rho (1 + (2C - 1) |w|^n)`` where s w < 0.
RK4 in x with the sensitivities to (rho, C, n) and to the start value carried along. Numba is imported
here, so import this module only where something is computed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np

# A step is divided until (largest rate of decay of w over x) * dx is below this: RK4 then errs < 1e-4 at worst.
_STIFFNESS_PER_STEP = 0.5
_MOST_SUBSTEPS = 400


def is_admissible(rho: float, C: float, n: float) -> bool:
    """Tell whether the loop is bounded and dissipates: rho > 0, n >= 1, C >= 1/2 (Erlicher-Point 2004)."""
    return rho > 0 and n >= 1 and C >= 0.5


def turning_value(rho_x: float, C: float, n: float) -> float:
    """Return w_m at the turning points of the symmetric steady loop with rho * amplitude = `rho_x`.

    Solves ``w 2F1(1, 1/n; 1 + 1/n; w^n) + w 2F1(1, 1/n; 1 + 1/n; -(2C - 1) w^n) = 2 rho X`` (mre.md 3.6).

    Examples
    --------
    >>> round(turning_value(1.6, 0.8, 1.4), 8)
    0.95578263
    """
    from scipy.optimize import brentq
    from scipy.special import hyp2f1

    def excess(w: float) -> float:
        rising = hyp2f1(1, 1 / n, 1 + 1 / n, w**n)
        falling = hyp2f1(1, 1 / n, 1 + 1 / n, -(2 * C - 1) * w**n)
        return float(w * (rising + falling) - 2 * rho_x)

    highest = 1 - 1e-15
    return highest if excess(highest) <= 0 else float(brentq(excess, 0.0, highest, xtol=1e-15))


def loss_of_small_loops(alpha: float, rho: float, C: float, n: float, amplitude: float) -> float:
    """Return the work lost per cycle (J) as rho X -> 0: ``4 C alpha rho^(n+1) X^(n+2) / (n + 2)``."""
    return float(4 * C * alpha * rho ** (n + 1) * amplitude ** (n + 2) / (n + 2))


def loss_limit_of_large_loops(alpha: float, amplitude: float) -> float:
    """Return the leading term of the work lost per cycle (J) as rho X -> infinity: ``4 alpha X``."""
    return 4 * alpha * amplitude


@dataclass(frozen=True, eq=False)
class Path:
    """Displacement along one run, with every turning point on it, shape (m,).

    `on_grid[i]` is the sample that position i belongs to, -1 for an inserted turning point.
    """

    x: np.ndarray
    on_grid: np.ndarray
    samples: int


def path_through(x: np.ndarray, periodic: bool = False) -> Path:
    """Return the path through samples x, shape (m,), with the turning points between them inserted.

    Each is the vertex of the parabola through the three samples around a local extreme, so it errs by
    the fourth power of the sampling step. With `periodic` the path closes on its first sample.
    """
    closed = np.r_[x, x[0]] if periodic else x
    on_grid = np.arange(closed.size)
    if periodic:
        on_grid[-1] = -1
    neighbours = np.r_[x[-1], closed, x[1]] if periodic else closed
    before, middle, after = neighbours[:-2], neighbours[1:-1], neighbours[2:]
    curvature = after - 2 * middle + before
    extreme = ((middle - before) * (after - middle) < 0) & (curvature != 0)
    slope = 0.5 * (after - before)[extreme]
    bend = curvature[extreme]
    shift = -slope / bend  # in samples, within +-1/2
    vertex = middle[extreme] - 0.5 * slope**2 / bend
    position = np.flatnonzero(extreme) + (0 if periodic else 1)
    if periodic:  # sample 0 and its image at the end are the same extreme, seen from one side each
        inside = ((position > 0) | (shift > 0)) & ((position < closed.size - 1) | (shift < 0))
        position, shift, vertex = position[inside], shift[inside], vertex[inside]
    moved = shift != 0
    at = position[moved] + (shift[moved] > 0)
    return Path(np.insert(closed, at, vertex[moved]), np.insert(on_grid, at, -1), x.size)


@nb.njit(cache=True)
def _sweep(
    x: np.ndarray, on_grid: np.ndarray, rho: float, C: float, n: float, w0: float, with_shape: bool, Z: np.ndarray
) -> np.ndarray:
    """Carry [w, dw/drho, dw/dC, dw/dn, dw/dw0] along x into the rows of Z; return them at the end."""
    y = np.zeros(5)
    trial = np.zeros(5)
    k = np.zeros((4, 5))
    y[0] = w0
    y[4] = 1.0
    c2 = 2.0 * C - 1.0
    rate = rho * n
    if on_grid[0] >= 0:
        Z[on_grid[0]] = y
    for i in range(x.size - 1):
        step = x[i + 1] - x[i]
        s = 1.0 if step > 0 else -1.0
        stiffness = rate * abs(step) * (max(1.0, c2) if s * y[0] < 0 else 1.0)
        parts = min(int(stiffness / _STIFFNESS_PER_STEP) + 1, _MOST_SUBSTEPS)
        dx = step / parts
        for _ in range(parts):
            for stage in range(4):
                f = 0.0 if stage == 0 else (0.5 * dx if stage < 3 else dx)
                w = y[0] + (f * k[stage - 1, 0] if stage > 0 else 0.0)
                a = max(abs(w), 1e-14)
                log_a = math.log(a)
                an = math.exp(n * log_a)
                rising = s * w >= 0
                m = -1.0 if rising else c2
                k[stage, 0] = rho * (1.0 + m * an)
                dk_dw = rho * m * n * an / a * (1.0 if w > 0 else -1.0)
                trial[4] = y[4] + (f * k[stage - 1, 4] if stage > 0 else 0.0)
                k[stage, 4] = dk_dw * trial[4]
                if with_shape:
                    for j in range(1, 4):
                        trial[j] = y[j] + (f * k[stage - 1, j] if stage > 0 else 0.0)
                    k[stage, 1] = 1.0 + m * an + dk_dw * trial[1]
                    k[stage, 2] = (0.0 if rising else 2.0 * rho * an) + dk_dw * trial[2]
                    k[stage, 3] = rho * m * an * log_a + dk_dw * trial[3]
            for j in range(5):
                y[j] += dx * (k[0, j] + 2.0 * k[1, j] + 2.0 * k[2, j] + k[3, j]) / 6.0
        if on_grid[i + 1] >= 0:
            Z[on_grid[i + 1]] = y
    return y


@nb.njit(cache=True)
def _steady(
    x: np.ndarray, on_grid: np.ndarray, ends: np.ndarray, points: int, rho: float, C: float, n: float
) -> np.ndarray:
    """Find the periodic w of every closed path by Newton shooting; see `steady_states`."""
    runs = ends.size
    Z = np.zeros((runs, points, 5))
    start = 0
    for r in range(runs):
        path = x[start : ends[r]]
        grid = on_grid[start : ends[r]]
        w0 = 0.0
        for _ in range(50):
            end = _sweep(path, grid, rho, C, n, w0, False, Z[r])
            change = (end[0] - w0) / max(1.0 - end[4], 1e-12)
            w0 = min(max(w0 + change, -1.0), 1.0)
            if abs(change) < 1e-5:  # quadratic convergence: the next change would be below 1e-9
                break
        end = _sweep(path, grid, rho, C, n, w0, True, Z[r])
        for j in range(1, 4):  # the start value moves with the parameters as well
            shift = end[j] / max(1.0 - end[4], 1e-12)
            for i in range(points):
                Z[r, i, j] += Z[r, i, 4] * shift
        for i in range(points):
            Z[r, i, 4] = end[4]
        start = ends[r]
    return Z


def along(path: Path, rho: float, C: float, n: float, w0: float = 0.0, sensitivities: bool = True) -> np.ndarray:
    """Return [w, dw/drho, dw/dC, dw/dn, dw/dw0] at the samples of a path, shape (samples, 5).

    The three in the middle are zero without `sensitivities` (half the time).
    """
    Z = np.zeros((path.samples, 5))
    _sweep(path.x, path.on_grid, rho, C, n, w0, sensitivities, Z)
    return Z


@dataclass(frozen=True, eq=False)
class ClosedPaths:
    """Closed paths of several runs, one after the other, as `steady_states` takes them."""

    x: np.ndarray
    on_grid: np.ndarray
    ends: np.ndarray
    points: int


def closed_paths(x: np.ndarray) -> ClosedPaths:
    """Return the closed paths of cycles x, shape (runs, points), equally spaced in phase."""
    paths = [path_through(row, periodic=True) for row in x]
    return ClosedPaths(
        np.concatenate([path.x for path in paths]),
        np.concatenate([path.on_grid for path in paths]),
        np.cumsum([path.x.size for path in paths]),
        x.shape[1],
    )


def steady_states(paths: ClosedPaths, rho: float, C: float, n: float) -> np.ndarray:
    """Return the periodic w of every run with its sensitivities, shape (runs, points, 5).

    Last axis: w, dw/drho, dw/dC, dw/dn of the *periodic* solution (its start value moves too), and
    the loop memory M = dw(T)/dw(0), the same at every point. Newton shooting on w(0).
    """
    return np.asarray(_steady(paths.x, paths.on_grid, paths.ends, paths.points, rho, C, n))
