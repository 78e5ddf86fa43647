"""Speeds of all members of the gearbox, and the orders that its teeth excite (gearbox.md, sections 3.1 and 3.2).

Plain arithmetic, so that numbers, arrays and exact fractions all go through. w1, w2 are the speeds of the input and the
output carrier, positive in the motor's direction; any unit of speed comes back as it went in.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from pipeline.rigs.gearbox.model.teeth import Teeth, Train

MEMBERS = ("ring", "sun", "planet_1", "planet_2")


def ring_speed(w1: Any, w2: Any, u1: Any, u2: Any) -> Any:
    """Return the speed of the common ring frame (eq. 3); the ratios `u1` and `u2` differ."""
    return ((u1 - 1) * w1 - (u2 - 1) * w2) / (u1 - u2)


def sun_speed(ring: Any, w1: Any, u1: Any) -> Any:
    """Return the speed of the common sun shaft (eq. 4)."""
    return (ring - w1) * u1 + w1


def planet_speed(ring: Any, carrier: Any, train: Train) -> Any:
    """Return the absolute speed of a planet, over the ring: ``w_C + (N_R/N_P) (w_R - w_C)``."""
    return carrier + Fraction(train.ring, train.planet) * (ring - carrier)


def planet_speed_over_sun(sun: Any, carrier: Any, train: Train) -> Any:
    """Return the same over the sun: ``w_C - (N_S/N_P) (w_S - w_C)``; equal where N_R = N_S + 2 N_P."""
    return carrier - Fraction(train.sun, train.planet) * (sun - carrier)


def member_coefficients(teeth: Teeth) -> dict[str, tuple[Fraction, Fraction]]:
    """Return (c1, c2) of each member: its speed is ``c1 w1 + c2 w2``, exactly.

    Examples
    --------
    >>> from pipeline.rigs.gearbox.model.teeth import TABLE_1
    >>> member_coefficients(TABLE_1)["sun"]
    (Fraction(10, 3), Fraction(-7, 3))
    """
    pairs = [_members(Fraction(w1), Fraction(w2), teeth) for w1, w2 in ((1, 0), (0, 1))]
    return {name: (pairs[0][name], pairs[1][name]) for name in MEMBERS}


def _members(w1: Fraction, w2: Fraction, teeth: Teeth) -> dict[str, Fraction]:
    ring = ring_speed(w1, w2, teeth.first.ratio, teeth.second.ratio)
    return {
        "ring": ring,
        "sun": sun_speed(ring, w1, teeth.first.ratio),
        "planet_1": planet_speed(ring, w1, teeth.first),
        "planet_2": planet_speed(ring, w2, teeth.second),
    }


def member_speeds(w1: Any, w2: Any, teeth: Teeth) -> dict[str, Any]:
    """Return the speed of each member at carrier speeds `w1` and `w2` (numbers or arrays)."""
    return {name: float(c1) * w1 + float(c2) * w2 for name, (c1, c2) in member_coefficients(teeth).items()}


def mesh_orders(teeth: Teeth) -> tuple[Fraction, Fraction]:
    """Return the teeth of train 1 and of train 2 that mesh per turn of slip: mesh frequency is ``order * s / (2 pi)``.

    With the output held, s = w1 and these are orders of the input shaft. Locked gears do not mesh.

    Examples
    --------
    >>> from pipeline.rigs.gearbox.model.teeth import TABLE_1
    >>> [int(order) for order in mesh_orders(TABLE_1)]
    [140, 40]
    """
    ring = member_coefficients(teeth)["ring"][0]
    return teeth.first.ring * abs(ring - 1), teeth.second.ring * abs(ring)


def sos_orders(teeth: Teeth) -> dict[str, Fraction]:
    """Return the orders of the input shaft at which members turn and tooth faults pass while the output is held.

    `spin_*` is a planet on its pin; `fault_*` how often one damaged tooth (of a planet: one flank) meets its mates;
    `carrier_1` is the planets passing a fixed sensor, which gives sidebands to mesh 1.
    """
    speed = {name: pair[0] for name, pair in member_coefficients(teeth).items()}
    first, second = mesh_orders(teeth)
    return {
        "mesh_1": first,
        "mesh_2": second,
        "ring": abs(speed["ring"]),
        "sun": abs(speed["sun"]),
        "spin_1": abs(speed["planet_1"] - 1),
        "spin_2": abs(speed["planet_2"]),
        "fault_sun_1": teeth.first.planets * abs(speed["sun"] - 1),
        "fault_planet_1": abs(speed["planet_1"] - 1),
        "fault_ring_1": teeth.first.planets * abs(speed["ring"] - 1),
        "fault_sun_2": teeth.second.planets * abs(speed["sun"]),
        "fault_planet_2": abs(speed["planet_2"]),
        "fault_ring_2": teeth.second.planets * abs(speed["ring"]),
        "carrier_1": Fraction(teeth.first.planets),
    }
