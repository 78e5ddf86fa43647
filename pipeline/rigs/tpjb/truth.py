"""What the synthetic bearings are made of (tpjb.md, section 6). All values are assumed: the paper publishes none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError, listing

SHAFT_SPEED = 1000.0 * 2.0 * np.pi / 60.0
CLEARANCE = 200e-6


@dataclass(frozen=True)
class Bearing:
    """One bearing at one static load. SI.

    Attributes
    ----------
    stiffness, quadratic, damping
        (kxx, kxy, kyx, kyy) N/m; (kxx2, kxy2, kyx2, kyy2, kxxy, kyxy) N/m^2; (cxx, cxy, cyx, cyy) N s/m.
    stiffness_curvature, damping_slope
        K(f) = K (1 - stiffness_curvature (f/f_shaft)^2), C(f) = C (1 - damping_slope f/f_shaft).
    equilibrium
        Static position from the bearing centre, (x, y), m.
    """

    name: str
    n_pads: int
    static_load: float
    stiffness: tuple[float, ...]
    quadratic: tuple[float, ...]
    damping: tuple[float, ...]
    equilibrium: tuple[float, float]
    stiffness_curvature: float = 0.0
    damping_slope: float = 0.0

    def impedance(self, frequency: float) -> np.ndarray:
        """Return the bearing's H = K + i w C at `frequency` (Hz), shape (2, 2), N/m."""
        ratio = frequency / (SHAFT_SPEED / (2.0 * np.pi))
        K = np.reshape(self.stiffness, (2, 2)) * (1.0 - self.stiffness_curvature * ratio**2)
        C = np.reshape(self.damping, (2, 2)) * (1.0 - self.damping_slope * ratio)
        return np.asarray(K + 2j * np.pi * frequency * C)


def _scaled(values: tuple[float, ...], factors: tuple[float, ...] | float) -> tuple[float, ...]:
    return tuple(float(v) for v in np.multiply(values, factors))


_FOUR_L1 = Bearing(
    "4pad-L1",
    4,
    40e3,
    (0.60e9, 0.03e9, 0.03e9, 0.60e9),
    (1.0e12, -0.5e12, -4.0e12, 4.5e12, 0.0, 0.0),
    (4.5e6, 0.15e6, 0.15e6, 4.5e6),
    (4e-6, 110e-6),
)
_FOUR_L2 = Bearing(
    "4pad-L2",
    4,
    80e3,
    _scaled(_FOUR_L1.stiffness, 2.0),
    _scaled(_FOUR_L1.quadratic, 2.0),
    (7.2e6, 0.24e6, 0.24e6, 7.2e6),
    (6e-6, 156.2e-6),
)
_FIVE_L3 = Bearing(
    "5pad-L3",
    5,
    48e3,
    (0.55e9, 0.05e9, -0.02e9, 0.95e9),
    (1.0e12, -1.0e12, 4.35e12, 8.5e12, 8.7e12, 0.0),
    (4.2e6, 0.2e6, 0.1e6, 5.6e6),
    (8e-6, 105e-6),
    stiffness_curvature=0.01,
    damping_slope=0.05,
)
_LOAD = 5.0 / 3.0
_FIVE_L2 = Bearing(
    "5pad-L2",
    5,
    80e3,
    _scaled(_FIVE_L3.stiffness, (_LOAD**0.8, _LOAD, _LOAD, _LOAD**0.9)),
    _scaled(_FIVE_L3.quadratic, _LOAD**0.8),
    _scaled(_FIVE_L3.damping, _LOAD**0.6),
    (10e-6, 131.5e-6),
    stiffness_curvature=0.01,
    damping_slope=0.05,
)
BEARINGS = {b.name: b for b in (_FOUR_L1, _FOUR_L2, _FIVE_L3, _FIVE_L2)}


def bearing(name: str) -> Bearing:
    """Return a synthetic bearing by name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in BEARINGS:
        raise InputError(f"there is no synthetic bearing '{name}'; there are {listing(BEARINGS)}.")
    return BEARINGS[name]
