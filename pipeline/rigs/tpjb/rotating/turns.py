"""One run by itself: harmonics of orbit and load over the steady turns, and why there are none where there are none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.orbit import Harmonics, Orbit, harmonics
from pipeline.rigs.tpjb.rotating.record import Record

# Rms departure from uniform rotation (rad) and misfit of the harmonics over the 1X beyond which an orbit does not repeat.
UNEVEN, OPEN = 0.15, 0.1


@dataclass(frozen=True, eq=False)
class Turns:
    """A run and its harmonics; `motion` and `load` are None where `refusal` says why."""

    record: Record
    motion: Harmonics | None
    load: Harmonics | None
    refusal: str = ""

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.record.run

    @cached_property
    def steady(self) -> Orbit:
        """The turns at full load."""
        return self.record.orbit.part(self.record.rotation.steady)

    @property
    def amplitude(self) -> float:
        """Size of the orbit, m: that of its first harmonics, else the rms radius about its mean."""
        if self.motion is not None:
            return math.hypot(abs(self.motion.at(1)), abs(self.motion.at(-1)))
        z = self.steady.z
        return float(np.sqrt(np.mean(np.abs(z - z.mean()) ** 2)))


def turns_of(record: Record, settings: RotatingSettings) -> Turns:
    """Return a run with its harmonics."""
    rotation = record.rotation
    if rotation.turns < settings.least_turns - 0.05:
        reason = (
            f"{rotation.turns:.2g} turns at full load are fewer than {settings.least_turns:g}: harmonics are refused, the "
            "models are fitted all the same"
        )
        return Turns(record, None, None, reason)
    if rotation.wander > UNEVEN:
        reason = (
            f"the load does not turn evenly (its angle departs by {math.degrees(rotation.wander):.2g} deg rms from a "
            "uniform rotation): harmonics are refused, the models are fitted all the same"
        )
        return Turns(record, None, None, reason)
    steady = record.orbit.part(rotation.steady)
    try:
        motion = harmonics(steady.time, steady.displacement, rotation.frequency)
        load = harmonics(steady.time, steady.force, rotation.frequency)
    except InputError as error:
        return Turns(record, None, None, str(error).rstrip("."))
    first = math.hypot(abs(motion.at(1)), abs(motion.at(-1)))
    left = float(np.sqrt(np.mean(np.abs(motion.residual) ** 2)))
    # What the load itself does not repeat is no fault of the orbit.
    unrest = float(np.sqrt(np.mean(np.abs(load.residual) ** 2))) / abs(load.at(1)) * first
    if left > OPEN * first + 3.0 * unrest:
        reason = (
            f"the orbit does not close: {100 * left / first:.2g} % of its size do not repeat from turn to turn; harmonics "
            "are refused, the models are fitted all the same"
        )
        return Turns(record, None, None, reason)
    return Turns(record, motion, load)
