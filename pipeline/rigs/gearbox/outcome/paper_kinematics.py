"""The paper's kinematics, teeth and statics (eqs 1 to 6, Table 1) put to the test with exact fractions (gearbox.md, 3.1 to 3.3)."""

from __future__ import annotations

import math
from fractions import Fraction

from pipeline.findings import Published
from pipeline.rigs.gearbox.model.kinematics import (
    member_coefficients,
    mesh_orders,
    planet_speed_over_sun,
    ring_speed,
    sun_speed,
)
from pipeline.rigs.gearbox.model.statics import carrier_force, lossless_torques
from pipeline.rigs.gearbox.model.teeth import TABLE_1, assembly_faults, interference_warnings
from pipeline.rigs.gearbox.outcome.paper import BRAKE, RPM, SPEEDS, TORQUES, row

_NAMES = {"ring": "ring", "sun": "sun", "planet_1": "planets 1", "planet_2": "planets 2"}


def kinematics_alone() -> list[Published]:
    """Return the checks of eqs (1) to (6) and of Table 1."""
    teeth = TABLE_1
    first, second = teeth.first, teeth.second
    members = member_coefficients(teeth)
    w = Fraction(1), Fraction(1)
    ring = ring_speed(*w, first.ratio, second.ratio)
    willis = [first.ratio, second.ratio] == [_willis(members, 1), _willis(members, 2)]
    over_sun = all(
        planet_speed_over_sun(members["sun"][k], Fraction(1 - k) if n == 1 else Fraction(k), train)
        == members[f"planet_{n}"][k]
        for n, train in ((1, first), (2, second))
        for k in (0, 1)
    )
    faults, warnings = assembly_faults(teeth), interference_warnings(teeth)
    orders = mesh_orders(teeth)
    rpm = [
        f"{_NAMES[name]} " + " / ".join(f"{float(c1) * speed:.1f}" for speed in SPEEDS)
        for name, (c1, _) in members.items()
    ]
    hertz = " and ".join(
        ", ".join(f"{float(order) * speed * RPM / (2 * math.pi):.0f}" for order in orders) for speed in SPEEDS
    )
    forces = [
        carrier_force(torque, train.carrier_radius)
        for torque, train in zip(TORQUES[BRAKE][120], (first, second), strict=True)
    ]
    torques = lossless_torques(teeth)
    return [
        row("eqs (3), (4): speeds of ring and sun", "as printed", f"right: eqs (1), (2) give {first.ratio} and {second.ratio} back",
            willis and ring == 1 and sun_speed(ring, w[0], first.ratio) == 1,
            "put back into Willis' equations with exact fractions; locked, all turn as one", where="eqs 1 to 4"),
        row("speeds of ring, sun and planets in SOS", None, "; ".join(rpm) + " rpm", None,
            "at 120 / 210 rpm of the input; planets absolute, over ring and sun alike" if over_sun else "planets differ over ring and sun",
            where="eqs 1 to 4"),
        row("gears can be assembled", "Table 1", "yes" if not faults else "; ".join(faults), not faults,
            "N_R = N_S + 2 N_P, (N_S + N_R)/2 whole, neighbouring planets apart, in both trains", where="Table 1"),
        row("standard teeth do not interfere", None, "no" if warnings else "yes", None,
            " ".join(warnings) or "no interference", where="Table 1"),
        row("mesh frequencies in SOS", None, f"{hertz} Hz", None,
            f"orders {float(orders[0]):g} and {float(orders[1]):g} of the input at 120 and 210 rpm; none while locked", where="3.2"),
        row("tangential force on the carriers' pins, 120 rpm brake peak", None, f"{forces[0]:.1f} N and {forces[1]:.1f} N", None,
            "F = T/r of input and output carrier, r = 40 and 28 mm", where="eqs 5, 6"),
        row("torque of a lossless gearbox in SOS", None, "0 N m", None,
            f"torques on input, output and ring stand as {' : '.join(str(float(t)) for t in torques)}: without a torque on the ring frame "
            "there is none, so all the input torque in SOS is friction", where="3.3"),
    ]  # fmt: skip


def _willis(members: dict[str, tuple[Fraction, Fraction]], train: int) -> Fraction:
    """Return (w_S - w_C)/(w_R - w_C) of a train for input and output carrier at speeds 2 and 5."""
    w1, w2 = Fraction(2), Fraction(5)
    sun, ring = (members[name][0] * w1 + members[name][1] * w2 for name in ("sun", "ring"))
    carrier = w1 if train == 1 else w2
    return (sun - carrier) / (ring - carrier)
