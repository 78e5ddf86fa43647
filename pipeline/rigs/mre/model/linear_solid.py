"""The Maxwell branch of the dynamic model: spring k1 in series with a dashpot s1 to ground (mre.md eq. 11).

With u = x - y, tau = s1/k1: ``u' = x' - u/tau``, force k1 u. The print of eq. (11) has s1 (x' - y'), which
is unstable; this is the standard linear solid that the paper names.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np


def maxwell_harmonics(X: np.ndarray, angular: np.ndarray, tau: float) -> tuple[np.ndarray, np.ndarray]:
    """Return U and dU/d(ln tau) for displacement harmonics X at `angular` frequencies (rad/s), same shape.

    ``U = j w tau / (1 + j w tau) X``.
    """
    turn = 1j * angular * tau
    return turn / (1 + turn) * X, turn / (1 + turn) ** 2 * X


@nb.njit(cache=True)
def _maxwell(time: np.ndarray, x: np.ndarray, bend: np.ndarray, tau: float, out: np.ndarray) -> None:
    u = 0.0
    du = 0.0
    for i in range(x.size - 1):
        h = time[i + 1] - time[i]
        ratio = h / tau
        e = math.exp(-ratio)
        gain = -math.expm1(-ratio) / ratio
        step = x[i + 1] - x[i]
        # What a velocity that changes evenly by `bend` about its mean adds, and its d/d(ln tau).
        late = tau * (1.0 - gain) - 0.5 * h * gain
        late_slope = tau * (1.0 + e - 2.0 * gain) + 0.5 * h * (e - gain)
        # d/d(ln tau) of e is ratio e, of gain is gain - e
        du = e * du + ratio * e * u + (gain - e) * step + late_slope * bend[i]
        u = e * u + gain * step + late * bend[i]
        out[i + 1, 0] = u
        out[i + 1, 1] = du


def maxwell_along(time: np.ndarray, x: np.ndarray, tau: float, velocity: np.ndarray | None = None) -> np.ndarray:
    """Return [u, du/d(ln tau)] at the samples, shape (m, 2), from u = 0 at the first.

    Exact for displacement that is straight between the samples, whatever their spacing (s); with the
    `velocity` (m/s) at the samples exact for parabolas.
    """
    out = np.zeros((x.size, 2))
    bend = np.zeros(x.size - 1) if velocity is None else np.diff(velocity)
    _maxwell(time, x, bend, tau, out)
    return out
