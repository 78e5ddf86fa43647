"""What the sensors of the synthetic tire feel, by angle, load and longitudinal force: contacts solved once, interpolated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.ring import Ring, Shape
from pipeline.rigs.tire.ring.sensor import averaging

_STEP = 250.0
_LEAST_TOP = 6500.0
_ANGLES = 2048
# Nodes beyond the range, so that what the spline assumes at its ends is not felt within.
_MARGIN = 12
_MORE_LOADS = 4


@dataclass(frozen=True, eq=False)
class Library:
    """Curvature averaged over a sensor's length against angle and load, and its derivative by Fx.

    Attributes
    ----------
    k, k_x
        Cubic B-spline coefficients over (Fz, theta), margins included: 1/m, and 1/m per N of Fx.
    loads, heights
        Loads, N, and the hub's height over the road there, m, shape (m,).
    """

    k: np.ndarray
    k_x: np.ndarray
    loads: np.ndarray
    heights: np.ndarray

    def curvature(self, theta: np.ndarray, Fz: np.ndarray, Fx: np.ndarray) -> np.ndarray:
        """Return k, 1/m, at the angles theta (rad, any turn) under Fz and Fx (N), shape (n,) each."""
        from scipy.ndimage import map_coordinates

        turn = (theta + np.pi) % (2.0 * np.pi)
        places = np.stack([Fz / _STEP + _MORE_LOADS, turn * (_ANGLES / (2.0 * np.pi)) + _MARGIN])
        k = map_coordinates(self.k, places, order=3, prefilter=False)
        if np.any(Fx):
            k = k + Fx * map_coordinates(self.k_x, places, order=3, prefilter=False)
        return np.asarray(k)


def library(ring: Ring, kt: float, Ro: float, length: float, largest: float) -> Library:
    """Return the library of a sensor of `length` (m) up to the load `largest` (N)."""
    return _library(ring, kt, Ro, length, max(_LEAST_TOP, float(np.ceil(largest / _STEP) * _STEP)))


@lru_cache(maxsize=64)
def _library(ring: Ring, kt: float, Ro: float, length: float, top: float) -> Library:
    from scipy.ndimage import spline_filter

    loads, still, pushed, heights = _shapes(ring, kt, Ro, top)
    k, k_x = (
        np.stack([shape.times(averaging(shape.orders, length, ring.R)).on_grid(_ANGLES)[1] for shape in shapes])
        for shapes in (still, pushed)
    )
    turn = np.arange(-_MARGIN, _ANGLES + _MARGIN) % _ANGLES
    below = slice(_MORE_LOADS, 0, -1)
    return Library(
        spline_filter(np.vstack([-k[below], k])[:, turn], order=3),
        spline_filter(np.vstack([k_x[below], k_x])[:, turn], order=3),
        loads,
        heights,
    )


@lru_cache(maxsize=4)
def _shapes(ring: Ring, kt: float, Ro: float, top: float) -> tuple[np.ndarray, list[Shape], list[Shape], np.ndarray]:
    """Return loads (N), the curvature at each, its derivative by Fx (without load: that of the lightest), heights (m)."""
    sprung, start = compliance(ring), None
    loads = _STEP * np.arange(round(top / _STEP) + _MORE_LOADS + 1)
    still, pushed, heights = [], [], np.full(loads.size, Ro)
    for i, Fz in enumerate(loads[1:], start=1):
        contact = pressed(sprung, kt, Ro, float(Fz), start=start)
        start = contact.active
        push = 0.1 * float(Fz)
        driven, braked = (pressed(sprung, kt, Ro, float(Fz), Fx, start).shape.harmonics for Fx in (push, -push))
        still.append(Shape(contact.shape.harmonics[:_ANGLES]))
        pushed.append(Shape((driven - braked)[:_ANGLES] / (2.0 * push)))
        heights[i] = contact.loaded_radius
    free = Shape(np.zeros_like(still[0].harmonics))
    return loads, [free, *still], [pushed[0], *pushed], heights
