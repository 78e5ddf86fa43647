"""The teeth of the two-stage planetary gearbox as data, and what standard involute teeth allow (gearbox.md, section 3.1).

Speeds are in `kinematics`, torques in `statics`.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction

from pipeline.errors import InputError

_WHAT = (
    "six whole numbers: sun, planet and ring of the input train, then of the output train, as '60 20 100; 12 44 100'"
)


@dataclass(frozen=True)
class Train:
    """One planetary train of spur gears: teeth, number of planets, module (m), pressure angle (rad)."""

    sun: int
    planet: int
    ring: int
    planets: int = 2
    module: float = 1e-3
    pressure_angle: float = math.radians(20.0)

    @property
    def ratio(self) -> Fraction:
        """Speed of the sun against that of the ring, as seen from the carrier: u = -N_R/N_S (eq. 1, 2)."""
        return Fraction(-self.ring, self.sun)

    @property
    def carrier_radius(self) -> float:
        """Radius of the planets' pins, m: pitch radius of the sun plus that of a planet."""
        return self.pitch_radius(self.sun) + self.pitch_radius(self.planet)

    def pitch_radius(self, teeth: int) -> float:
        """Return the pitch radius (m) of a gear of this train."""
        return 0.5 * self.module * teeth

    def base_radius(self, teeth: int) -> float:
        """Return the base radius (m) of a gear of this train."""
        return self.pitch_radius(teeth) * math.cos(self.pressure_angle)


@dataclass(frozen=True)
class Teeth:
    """The gearbox: train 1 on the input carrier, train 2 on the output carrier; suns and rings are common."""

    first: Train
    second: Train


TABLE_1 = Teeth(Train(60, 20, 100), Train(12, 44, 100))
"""Table 1 of the paper."""


def teeth_of(text: str, where: str = "teeth") -> Teeth:
    """Return the gearbox whose teeth are written as ``60 20 100; 12 44 100``, perhaps with the number of planets.

    Raises
    ------
    InputError
        Unless there are three or four whole numbers above 0 for each train, and the two ratios differ.

    Examples
    --------
    >>> teeth_of("60 20 100; 12 44 100") == TABLE_1
    True
    """
    numbers = [float(word) for word in re.findall(r"[-+]?\d+(?:\.\d+)?", text)]
    if len(numbers) not in (6, 8) or any(n <= 0 or n != int(n) for n in numbers):
        raise InputError(f"{where}: '{text}' does not give the teeth; write {_WHAT}.")
    half = len(numbers) // 2
    teeth = Teeth(*(Train(*(int(n) for n in part)) for part in (numbers[:half], numbers[half:])))
    if teeth.first.ratio == teeth.second.ratio:
        raise InputError(
            f"{where}: with '{text}' both trains have the ratio {teeth.first.ratio}, so the carriers could not turn "
            "against each other; look at the teeth."
        )
    return teeth


def smallest_pinion(mate_ratio: float, pressure_angle: float = math.radians(20.0)) -> float:
    """Return the least teeth of a standard pinion that a gear of `mate_ratio` times its teeth does not undercut.

    Examples
    --------
    >>> round(smallest_pinion(44 / 12), 1)
    15.3
    """
    squared = math.sin(pressure_angle) ** 2
    bracket = mate_ratio + math.sqrt(mate_ratio**2 + (1.0 + 2.0 * mate_ratio) * squared)
    return 2.0 / ((1.0 + 2.0 * mate_ratio) * squared) * bracket


def tip_radius_limit(train: Train) -> float:
    """Return the largest tip radius (m) of a planet that does not cut below the sun's base circle."""
    return math.hypot(train.base_radius(train.planet), train.carrier_radius * math.sin(train.pressure_angle))


def contact_ratios(train: Train) -> tuple[float, float]:
    """Return the contact ratio of sun and planet and of planet and ring, for standard teeth (addendum one module).

    Where the sun is undercut the first is an upper limit.

    Examples
    --------
    >>> [round(ratio, 2) for ratio in contact_ratios(TABLE_1.first)]
    [1.67, 1.86]
    """
    pitch = math.pi * train.module * math.cos(train.pressure_angle)
    centre = train.carrier_radius * math.sin(train.pressure_angle)
    sun, planet = _tip_path(train, train.sun), _tip_path(train, train.planet)
    ring = _tip_path(train, train.ring, inward=True)
    return (sun + planet - centre) / pitch, (planet - ring + centre) / pitch


def _tip_path(train: Train, teeth: int, inward: bool = False) -> float:
    """Distance (m) along the line of action from the base circle to the tip; 0 where the tip is inside the base circle."""
    tip = train.pitch_radius(teeth) + (-train.module if inward else train.module)
    return math.sqrt(max(tip**2 - train.base_radius(teeth) ** 2, 0.0))


def assembly_faults(teeth: Teeth) -> list[str]:
    """Return in plain sentences why these gears cannot be put together; none for Table 1."""
    return [fault for i, train in enumerate((teeth.first, teeth.second), start=1) for fault in _assembly(i, train)]


def _assembly(i: int, train: Train) -> list[str]:
    found = []
    if train.ring != train.sun + 2 * train.planet:
        found.append(
            f"train {i}: ring {train.ring} is not sun {train.sun} plus twice planet {train.planet} teeth, so sun and ring "
            "are not on one axis."
        )
    if (train.sun + train.ring) % train.planets:
        found.append(
            f"train {i}: sun and ring have {train.sun + train.ring} teeth together, no multiple of {train.planets}: planets "
            "at equal angles do not go in."
        )
    apart = 2.0 * train.carrier_radius * math.sin(math.pi / train.planets)
    tips = 2.0 * (train.pitch_radius(train.planet) + train.module)
    if apart <= tips:
        found.append(
            f"train {i}: planets are {1e3 * apart:.4g} mm apart and {1e3 * tips:.4g} mm over their tips, so neighbours touch."
        )
    return found


def interference_warnings(teeth: Teeth) -> list[str]:
    """Return in plain sentences which standard teeth would interfere: undercut suns, rings that foul their planets."""
    found = []
    for i, train in enumerate((teeth.first, teeth.second), start=1):
        least = smallest_pinion(train.planet / train.sun, train.pressure_angle)
        limit, tip = tip_radius_limit(train), train.pitch_radius(train.planet) + train.module
        if train.sun < least and tip > limit:
            found.append(
                f"train {i}: a standard sun of {train.sun} teeth is undercut by its planet of {train.planet} (at least "
                f"{math.ceil(least)} teeth are needed; planet tip radius {1e3 * tip:.2f} mm, limit {1e3 * limit:.2f} mm), "
                "unless the teeth are shifted."
            )
        reach = train.carrier_radius * math.sin(train.pressure_angle)
        if _tip_path(train, train.ring, inward=True) < reach:
            found.append(
                f"train {i}: the tips of a standard ring of {train.ring} teeth reach below the base circle of its planet "
                f"of {train.planet}, unless they are shortened."
            )
    return found
