"""The loop of slow compression and release (mre.md 3.2): F = k d + k3 d^3 + alpha w + F_off, as plain functions, SI.

w' = rho (d' - |d'| w), the Bouc-Wen law with C = n = 1, has a closed form on every stroke, so that w needs no
velocity and no step in time. Nothing here knows of sensors or fits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_GRID = 801
SLOPE_SPAN = (0.2, 0.8)  # share of d_max over which the loading branch is regressed


@dataclass(frozen=True)
class LoopModel:
    """k (N/m), k3 (N/m^3), alpha (N), rho (1/m) of one loop."""

    k: float
    k3: float
    alpha: float
    rho: float

    def force(self, d: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Return the force without offset, N, at displacements (m) and hysteretic variables of one shape."""
        return self.k * d + self.k3 * d**3 + self.alpha * w


def after_stroke(w: float, rho: float, length: float, direction: float) -> float:
    """Return w after a stroke of `length` (m), from w at its start; direction +1 compresses.

    Examples
    --------
    >>> round(after_stroke(0.0, 2e4, 50e-6, 1.0), 4)  # 1 - 1/e
    0.6321
    """
    return direction - (direction - w) * math.exp(-rho * max(length, 0.0))


def along_strokes(d: np.ndarray, stroke: np.ndarray, turns: Sequence[float], rho: float, w0: float = 0.0) -> np.ndarray:
    """Return w at samples of a motion that goes from turn to turn.

    Parameters
    ----------
    d, stroke
        Displacement (m) and number of the stroke (from 0) of each sample, shape (n,).
    turns
        Where stroke i begins (i) and ends (i + 1), m, one more than there are strokes.
    rho, w0
        1/m; w at the first turn.
    """
    out = np.empty(d.size)
    w = w0
    for i in range(len(turns) - 1):
        here = stroke == i
        direction = 1.0 if turns[i + 1] >= turns[i] else -1.0
        gone = np.maximum(direction * (d[here] - turns[i]), 0.0)
        out[here] = direction - (direction - w) * np.exp(-rho * gone)
        w = after_stroke(w, rho, abs(turns[i + 1] - turns[i]), direction)
    return out


def loading(model: LoopModel, d_max: float, points: int = _GRID) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement and force of the first loading from w = 0, shape (points,) each."""
    d = np.linspace(0.0, d_max, points)
    return d, model.force(d, -np.expm1(-model.rho * d))


def unloading(model: LoopModel, d_max: float, points: int = _GRID) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement (falling) and force of the release to zero, shape (points,) each."""
    d = np.linspace(d_max, 0.0, points)
    w_m = -math.expm1(-model.rho * d_max)
    return d, model.force(d, -1.0 + (w_m + 1.0) * np.exp(-model.rho * (d_max - d)))


def secant(model: LoopModel, d_max: float) -> float:
    """Return F(d_max)/d_max, N/m.

    Examples
    --------
    >>> round(secant(LoopModel(4.55e5, 4.2e10, 24.0, 2e4), 6e-4) / 1e3, 1)
    510.1
    """
    return float(model.force(np.array(d_max), np.array(-math.expm1(-model.rho * d_max)))) / d_max


def slope(model: LoopModel, d_max: float) -> float:
    """Return the slope of a straight line regressed on the loading branch over 20 to 80 % of d_max, N/m.

    Examples
    --------
    >>> round(slope(LoopModel(4.55e5, 4.2e10, 24.0, 2e4), 6e-4) / 1e3, 1)
    470.8
    """
    d = np.linspace(SLOPE_SPAN[0] * d_max, SLOPE_SPAN[1] * d_max, _GRID)
    F = model.force(d, -np.expm1(-model.rho * d))
    centred = d - d.mean()
    return float(centred @ F / (centred @ centred))


def loss_ratio(model: LoopModel, d_max: float) -> float:
    """Return the work lost over the work of loading, for a release down to zero.

    Examples
    --------
    >>> round(loss_ratio(LoopModel(4.55e5, 4.2e10, 24.0, 2e4), 6e-4), 3)
    0.261
    """
    rho, alpha = model.rho, model.alpha
    elastic = model.k * d_max**2 / 2 + model.k3 * d_max**4 / 4
    share = -math.expm1(-rho * d_max) / rho  # integral of exp(-rho s) over the stroke
    w_m = -math.expm1(-rho * d_max)
    up = elastic + alpha * (d_max - share)
    down = elastic + alpha * (-d_max + (w_m + 1.0) * share)
    return (up - down) / up


def unloading_drop(model: LoopModel, d_max: float) -> float:
    """Return alpha (1 + w_m), the force by which the release lies below the loading, N."""
    return model.alpha * (1.0 - math.expm1(-model.rho * d_max))
