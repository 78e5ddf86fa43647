"""Torques of the gearbox at rest or at constant speed: carriers, the lossless gearbox, lock, powers (gearbox.md, 3.3, 3.4).

Plain functions, SI; friction laws are in `friction`.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.rigs.gearbox.model.kinematics import member_coefficients
from pipeline.rigs.gearbox.model.teeth import Teeth

Number = TypeVar("Number", float, NDArray[np.float64])


def carrier_force(torque: Number, carrier_radius: float) -> Number:
    """Return the tangential force of all pins of a carrier together, N: ``T_C = F_C r_C`` (eq. 5, 6).

    Examples
    --------
    >>> f"{carrier_force(2.17, 0.040):.2f} {carrier_force(0.97, 0.028):.1f}"
    '54.25 34.6'
    """
    return torque / carrier_radius


def planet_mesh_force(torque: Number, carrier_radius: float, planets: int) -> Number:
    """Return the mesh force (N) of one planet, at the sun and at the ring alike, where no torque is lost in it."""
    return carrier_force(torque, carrier_radius) / (2 * planets)


def lossless_torques(teeth: Teeth) -> tuple[Fraction, Fraction, Fraction]:
    """Return the torques on input carrier, output carrier and ring of a lossless gearbox, for 1 on the input carrier.

    The sun shaft is free, so virtual power over both carriers leaves one free torque. Without one on the ring there is none.

    Examples
    --------
    >>> from pipeline.rigs.gearbox.model.teeth import TABLE_1
    >>> [str(torque) for torque in lossless_torques(TABLE_1)]
    ['1', '-7/2', '5/2']
    """
    c1, c2 = member_coefficients(teeth)["ring"]
    return Fraction(1), c2 / c1, -1 / c1


def carried_torque(torque_in: Number, drag: Number, teeth: Teeth, torque_ring: float = 0.0) -> Number:
    """Return what the lock or the slipping gears carry, N m on the input carrier: ``M = T_in - T_0 - 0.4 T_R``.

    0.4 is that of Table 1; `torque_ring` is an external torque on the ring frame.
    """
    return torque_in - drag + float(member_coefficients(teeth)["ring"][0]) * torque_ring


def ground_torque(torque_in: Number, torque_out: Number, inertia: float, acceleration: Number) -> Number:
    """Return the drag to ground, N m, from the torque balance of the whole box; friction inside cancels."""
    return torque_in - torque_out - inertia * acceleration


def efficiency_locked(torque_in: Number, torque_out: Number) -> Number:
    """Return T_out/T_in, a power efficiency while both carriers turn at one speed (eq. 7); not so when they do not."""
    return torque_out / torque_in


def dissipated_power(torque_in: Number, torque_out: Number, w1: Number, w2: Number) -> Number:
    """Return ``T_in w1 - T_out w2`` (W) at constant speeds; with the output held all the input power."""
    return torque_in * w1 - torque_out * w2
