"""The saturating law S(z; p) = z / (1 + |z|^p)^(1/p) of mre.md 3.3, with what else is tried in its place.

Plain functions. They are written with slope 1 at the origin, x = I_s S(I/I_s), so that they stay well
behaved where saturation is far away, and with u = 1/p, so that p -> infinity (straight, then flat) is u = 0.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# p = 200 cannot be told from straight-then-flat.
LEAST_U, MOST_U = 0.005, 2.0
FIRST_TIME = 10.0  # s, t0: relaxation counts from here (section 11)

# effective current, its slopes d/d ln I_s and d/du, shape (n,) each
Shape = Callable[[np.ndarray, float, float], tuple[np.ndarray, np.ndarray, np.ndarray]]


def saturation(z: np.ndarray, p: float) -> np.ndarray:
    """Return S(z; p), shape of `z`: z for small z, +-1 for large.

    Examples
    --------
    >>> saturation(np.array([0.1, 1.0, 1e3]), 12.0).round(4).tolist()
    [0.1, 0.9439, 1.0]
    """
    return np.asarray(z * np.exp(-_log1p_power(np.abs(z), p) / p))


def saturating(current: np.ndarray, I_s: float, u: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return I_s S(I/I_s; 1/u) and its derivatives with respect to ln I_s and u."""
    p = 1 / u
    z = current / I_s
    size = np.maximum(np.abs(z), 1e-300)
    log_d = _log1p_power(size, p)
    s = z * np.exp(-u * log_d)
    local = np.exp(-(1 + u) * log_d)  # dS/dz
    share = np.exp(p * np.log(size) - log_d)  # |z|^p / (1 + |z|^p)
    ds_du = s * (p * share * np.log(size) - log_d)
    return I_s * s, I_s * (s - z * local), I_s * ds_du


def local_slope(z: np.ndarray | float, p: float) -> np.ndarray:
    """Return dS/dz, the slope of the law over that at the origin."""
    return np.asarray(np.exp(-(1 + 1 / p) * _log1p_power(np.abs(np.asarray(z, dtype=float)), p)))


def tanh_law(current: np.ndarray, I_s: float, _u: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return I_s tanh(I/I_s) and its derivative with respect to ln I_s."""
    z = current / I_s
    t = np.tanh(z)
    return I_s * t, I_s * (t - z * (1 - t * t)), np.zeros_like(z)


def hinge(current: np.ndarray, I_s: float, _u: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the straight line that ends at I_s, and its derivative with respect to ln I_s."""
    return np.clip(current, -I_s, I_s), np.where(np.abs(current) > I_s, np.sign(current) * I_s, 0.0), 0.0 * current


def froehlich_kennelly(current: np.ndarray, I_s: float, _u: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return I_s S(I/I_s; 1), the law of eq. (7), and its derivative with respect to ln I_s."""
    x, slope, _ = saturating(current, I_s, 1.0)
    return x, slope, np.zeros_like(x)


def straight(current: np.ndarray, _I_s: float, _u: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the current itself: no saturation."""
    zero = np.zeros_like(current)
    return np.asarray(current, dtype=float), zero, zero


def force(current: np.ndarray, time: np.ndarray, F0: float, a: float, I_s: float, p: float, r: float) -> np.ndarray:
    """Return F = F0 (1 + a S(I/I_s; p)) (1 - r log10(t/t0)), N; `time` is since the start of the log, s.

    Examples
    --------
    >>> round(float(force(np.array([6.0]), np.array([10.0]), 200.0, 0.65, 5.7, 12.0, 0.02)[0] / 200 - 1), 3)
    0.627
    """
    relaxed = 1 - r * np.log10(np.maximum(time, 1e-3) / FIRST_TIME)
    return np.asarray(F0 * (1 + a * saturation(np.abs(current) / I_s, p)) * relaxed)


def _log1p_power(size: np.ndarray, p: float) -> np.ndarray:
    """Return ln(1 + size^p) without overflow."""
    return np.asarray(np.logaddexp(0.0, p * np.log(np.maximum(size, 1e-300))))
