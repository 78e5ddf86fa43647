"""Directions on the bearing and the way from the probes to the motion of its middle plane.

x is horizontal, y vertical and up; the actuators act along u (+45 deg from x) and v (+135 deg).
Forces act on the stator; a displacement is that of the stator against the shaft. SI.
"""

from __future__ import annotations

import math

import numpy as np

# Rows: x and y; columns: u and v. The same matrix turns forces, displacements and accelerations.
FROM_UV = np.array([[1.0, -1.0], [1.0, 1.0]]) / math.sqrt(2.0)


def xy(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the x and y components, shape (2, n), of components along u and v, shape (n,) each."""
    return np.asarray(FROM_UV @ np.vstack((u, v)))


def uv(vector: np.ndarray) -> np.ndarray:
    """Return the components along u and v, shape (2, n), of a vector given in x and y, shape (2, n)."""
    return np.asarray(FROM_UV.T @ vector)


def mid_plane(d1: np.ndarray, d2: np.ndarray, z1: float, z2: float) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement (m) of the middle plane and tilt (rad), shape (2, n) each.

    Parameters
    ----------
    d1, d2
        Displacement in the two probe planes, x and y, shape (2, n), m.
    z1, z2
        Where the planes stand, signed, from the middle plane, m; they differ.
    """
    return (z2 * d1 - z1 * d2) / (z2 - z1), (d2 - d1) / (z2 - z1)


def pad_directions(n_pads: int) -> np.ndarray:
    """Return the angles of the pads (rad from x, shape (n,)) with the load between two of them (LBP).

    Four pads stand at 45, 135, 225, 315 deg, five at 18, 90, 162, 234, 306 deg.
    """
    step = 2.0 * math.pi / n_pads
    first = -math.pi / 2.0 + step / 2.0
    return np.sort((first + step * np.arange(n_pads)) % (2.0 * math.pi))
