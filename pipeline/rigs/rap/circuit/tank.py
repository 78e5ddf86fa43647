"""Ultrafiltrate tank: volume from an ultrasonic distance and the tilt, and when that holds (rap.md, 3.7).

Geometry only; what is estimated over time stands elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

EchoModel = Literal["axis", "specular"]
G = 9.81
ZERO_CELSIUS = 273.15
LARGEST_TILT = math.radians(12.0)


@dataclass(frozen=True)
class Tank:
    """A box of `Lx` by `Ly` by `H` (m), its ultrasonic sensor at `z` over the floor and `dx`, `dy` off the centroid (m).

    Below `blind` (m) the sensor sees nothing. It takes the air for `reference` (K) warm. `echo` says what it reports in a
    tilted tank: the distance down its axis, or the shortest one (specular).
    """

    Lx: float = 0.120
    Ly: float = 0.0705
    H: float = 0.260
    z: float = 0.285
    dx: float = 0.035
    dy: float = 0.0
    blind: float = 0.010
    reference: float = 293.15
    echo: EchoModel = "axis"

    @property
    def area(self) -> float:
        """Area of the floor, m^2."""
        return self.Lx * self.Ly

    @property
    def capacity(self) -> float:
        """Volume up to the rim, m^3."""
        return self.area * self.H


def sound_speed(T: Any) -> Any:
    """Return the speed of sound in air of `T` (K), m/s (eq. 8)."""
    return 331.3 * np.sqrt(np.asarray(T) / ZERO_CELSIUS)


def up_vector(acceleration: np.ndarray) -> np.ndarray:
    """Return the unit vector that points up in the tank's frame, shape (n, 3), from accelerations (n, 3)."""
    return np.asarray(acceleration / np.linalg.norm(acceleration, axis=-1, keepdims=True))


def tilt_of(n: np.ndarray) -> np.ndarray:
    """Return the angle between the tank's axis and the vertical, rad, shape (n,), from up vectors (n, 3)."""
    return np.asarray(np.arccos(np.clip(n[..., 2], -1.0, 1.0)))


def rise_at_sensor(tank: Tank, n: np.ndarray) -> np.ndarray:
    """Return how much lower than at the centroid the surface stands under the sensor, m, shape (n,)."""
    return np.asarray((n[..., 0] * tank.dx + n[..., 1] * tank.dy) / n[..., 2])


def height_from_distance(tank: Tank, D: Any, n: np.ndarray, T: Any) -> np.ndarray:
    """Return the height of the liquid at the centroid, m (eq. 8).

    Parameters
    ----------
    D
        Distance as the sensor reports it, m, shape (n,).
    n
        Up vectors in the tank's frame, shape (n, 3).
    T
        Temperature of the air in the tank, K, shape (n,) or one number.
    """
    along_axis = np.asarray(D) / n[..., 2] if tank.echo == "specular" else np.asarray(D)
    true_distance = along_axis * sound_speed(T) / sound_speed(tank.reference)
    return np.asarray(tank.z - true_distance + rise_at_sensor(tank, n))


def distance_from_height(tank: Tank, h_c: Any, n: np.ndarray, T: Any) -> np.ndarray:
    """Return the distance that the sensor reports, m; the inverse of `height_from_distance`."""
    along_axis = tank.z - np.asarray(h_c) + rise_at_sensor(tank, n)
    reported = along_axis * sound_speed(tank.reference) / sound_speed(T)
    return np.asarray(reported * n[..., 2] if tank.echo == "specular" else reported)


def floor_margin(tank: Tank, n: np.ndarray) -> np.ndarray:
    """Return the height at the centroid below which the tilted surface cuts the floor, m, shape (n,).

    The mirror image holds at the rim: above ``H`` less this the liquid touches it.
    """
    return np.asarray((np.abs(n[..., 0]) * tank.Lx + np.abs(n[..., 1]) * tank.Ly) / (2.0 * n[..., 2]))
