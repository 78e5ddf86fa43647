"""State of the joint filter: memory of the device and logarithms of its parameters, carried along a path and measured.

Compiled, for all sigma points at once; the filter itself is in `joint_filter`. Numba is imported here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numba as nb
import numpy as np

# The sheet's nine states, then what a real record needs besides.
STATES = ("w", "u", "k1", "tau", "k2", "alpha_bw", "rho", "c_bw", "n_bw", "offset", "force_lag", "s_mr")
SHEET, PARAMETERS = 9, slice(2, 9)
_NAMES = STATES[PARAMETERS]
_SUBSTEPS = 2
# What is subtracted before the logarithm: C > 1/2, n > 1.
_FLOOR = {"c_bw": 0.5, "n_bw": 1.0}


def to_logs(values: Mapping[str, float]) -> np.ndarray:
    """Return [ln k1, ln tau, ln k2, ln aBW, ln rho, ln(C - 1/2), ln(n - 1)] of parameters by name."""
    return np.array([math.log(values[name] - _FLOOR.get(name, 0.0)) for name in _NAMES])


def from_logs(logs: np.ndarray) -> dict[str, np.ndarray]:
    """Return the parameters by name, each of the shape (...) of `logs` (..., 7)."""
    return {name: np.exp(logs[..., i]) + _FLOOR.get(name, 0.0) for i, name in enumerate(_NAMES)}


@nb.njit(cache=True)
def _slope(w: float, rising: bool, rho: float, c2: float, n: float) -> float:
    """Return dw/dx of eq. (12) for x that rises or falls."""
    a = max(abs(w), 1e-14) ** n
    return float(rho * (1.0 - a) if (w >= 0.0) == rising else rho * (1.0 + c2 * a))


@nb.njit(cache=True)
def carry(sigmas: np.ndarray, path: np.ndarray, dt: float, out: np.ndarray) -> None:
    """Carry w and u of every sigma point, shape (points, states), along displacements `path`, shape (m + 1,), m.

    `dt` (s) is the time of one piece. w by two steps of RK4 over each piece and held within +-1, u exactly for
    pieces that are straight; everything else stays.
    """
    for i in range(sigmas.shape[0]):
        out[i] = sigmas[i]
        w, u = sigmas[i, 0], sigmas[i, 1]
        tau, rho = math.exp(sigmas[i, 3]), math.exp(sigmas[i, 6])
        c2 = 2.0 * math.exp(sigmas[i, 7])  # 2 C - 1
        n = 1.0 + math.exp(sigmas[i, 8])
        e = math.exp(-dt / tau)
        gain = -math.expm1(-dt / tau) * tau / dt
        for j in range(path.size - 1):
            whole = path[j + 1] - path[j]
            dx, rising = whole / _SUBSTEPS, whole > 0.0
            for _ in range(_SUBSTEPS):
                a = _slope(w, rising, rho, c2, n)
                b = _slope(w + 0.5 * dx * a, rising, rho, c2, n)
                c = _slope(w + 0.5 * dx * b, rising, rho, c2, n)
                d = _slope(w + dx * c, rising, rho, c2, n)
                w = min(max(w + dx * (a + 2.0 * b + 2.0 * c + d) / 6.0, -1.0), 1.0)
            u = e * u + gain * whole
        out[i, 0], out[i, 1] = w, u


@nb.njit(cache=True)
def force(state: np.ndarray, x: float, v: float) -> float:
    """Return k1 u + k2 x + aBW w + s_MR v + offset (N), all but the last two late by the lag (to first order).

    States beyond the sheet's nine count as zero where the vector ends before them.
    """
    size = state.size
    w, u, lag = state[0], state[1], (state[10] if size > 10 else 0.0)
    slope = _slope(w, v > 0.0, math.exp(state[6]), 2.0 * math.exp(state[7]), 1.0 + math.exp(state[8]))
    late = math.exp(state[2]) * (u - lag * (v - u / math.exp(state[3]))) + math.exp(state[4]) * (x - lag * v)
    late += math.exp(state[5]) * (w - lag * slope * v)
    return float(late + (state[9] if size > 9 else 0.0) + (state[11] * v if size > 11 else 0.0))
