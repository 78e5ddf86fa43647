"""What the sensors of the synthetic tire feel, by angle, load and longitudinal force: contacts solved once, interpolated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.ring import Ring, Shape, grid
from pipeline.rigs.tire.ring.sensor import averaging

_STEP = 250.0
_LEAST_TOP = 6500.0
_ANGLES = 2048
_MARGIN = 8


@dataclass(frozen=True, eq=False)
class Library:
    """Curvature averaged over a sensor's length against angle and load, and its derivative by Fx.

    Attributes
    ----------
    k, k_x
        Splines over (theta, Fz): 1/m, and 1/m per N of Fx.
    loads, heights
        Loads, N, and the hub's height over the road there, m, shape (m,).
    """

    k: Any
    k_x: Any
    loads: np.ndarray
    heights: np.ndarray

    def curvature(self, theta: np.ndarray, Fz: np.ndarray, Fx: np.ndarray) -> np.ndarray:
        """Return k, 1/m, at the angles theta (rad, any turn) under Fz and Fx (N), shape (n,) each."""
        angle = (theta + np.pi) % (2.0 * np.pi) - np.pi
        k = self.k.ev(angle, Fz)
        if np.any(Fx):
            k = k + Fx * self.k_x.ev(angle, Fz)
        return np.asarray(k)


def library(ring: Ring, kt: float, Ro: float, length: float, largest: float) -> Library:
    """Return the library of a sensor of `length` (m) up to the load `largest` (N)."""
    return _library(ring, kt, Ro, length, max(_LEAST_TOP, float(np.ceil(largest / _STEP) * _STEP)))


@lru_cache(maxsize=8)
def _library(ring: Ring, kt: float, Ro: float, length: float, top: float) -> Library:
    from scipy.interpolate import RectBivariateSpline

    theta = grid(_ANGLES)
    loads = np.arange(0.0, top + 0.5 * _STEP, _STEP)
    k, k_x, heights = np.zeros((loads.size, _ANGLES)), np.zeros((loads.size, _ANGLES)), np.full(loads.size, Ro)
    sprung, start = compliance(ring), None
    for i, Fz in enumerate(loads[1:], start=1):
        still = pressed(sprung, kt, Ro, float(Fz), start=start)
        start = still.active
        mean = averaging(still.shape.orders, length, ring.R)
        push = 0.1 * float(Fz)
        driven, braked = (pressed(sprung, kt, Ro, float(Fz), Fx, start).shape.harmonics for Fx in (push, -push))
        k[i] = still.shape.times(mean).on_grid(_ANGLES)[1]
        k_x[i] = Shape((driven - braked) / (2.0 * push) * mean).on_grid(_ANGLES)[1]
        heights[i] = still.loaded_radius
    k_x[0] = k_x[1]
    turn = np.arange(-_MARGIN, _ANGLES + _MARGIN)
    angles = theta[0] + turn * (2.0 * np.pi / _ANGLES)
    return Library(
        RectBivariateSpline(angles, loads, k.T[turn % _ANGLES]),
        RectBivariateSpline(angles, loads, k_x.T[turn % _ANGLES]),
        loads,
        heights,
    )
