"""The angle of the wheel between passages: monotone cubics through (t_j, 2 pi j) (tire.md, 5.4; Fyfe and Munck 1997)."""

from __future__ import annotations

import numpy as np


def monotone_slopes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the slopes at the knots of the monotone cubic through (x, y), shape (n,), n >= 2 (Fritsch and Butland 1984).

    As scipy's PchipInterpolator has them, for y that rises.
    """
    h, rise = np.diff(x), np.diff(y) / np.diff(x)
    slopes = np.empty(x.size)
    if x.size == 2:
        slopes[:] = rise[0]
        return slopes
    w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    slopes[1:-1] = (w1 + w2) / (w1 / rise[:-1] + w2 / rise[1:])
    for end, (h0, h1, d0, d1) in ((0, (h[0], h[1], rise[0], rise[1])), (-1, (h[-1], h[-2], rise[-1], rise[-2]))):
        slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1)
        slopes[end] = min(max(slope, 0.0), 3.0 * d0)
    return slopes


def monotone(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the monotone cubic through (x, y) at the places `at`; straight beyond the ends."""
    slopes = monotone_slopes(x, y)
    k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, x.size - 2)
    h = x[k + 1] - x[k]
    u = np.clip((at - x[k]) / h, 0.0, 1.0)
    a, b = h * slopes[k], h * slopes[k + 1]
    rise = y[k + 1] - y[k]
    inner = y[k] + u * (a + u * (3.0 * rise - 2.0 * a - b + u * (a + b - 2.0 * rise)))
    beyond = np.where(at < x[0], slopes[0] * (at - x[0]), np.where(at > x[-1], slopes[-1] * (at - x[-1]), 0.0))
    return np.asarray(inner + beyond)
