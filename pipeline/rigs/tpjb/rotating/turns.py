"""One run by itself: harmonics of orbit and load over the steady turns, and why there are none where there are none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.harmonics import Harmonics, harmonics
from pipeline.rigs.tpjb.rotating.noise import orbit_noise
from pipeline.rigs.tpjb.rotating.orbit import Orbit
from pipeline.rigs.tpjb.rotating.record import Record

# Rms departure from uniform rotation (rad) and misfit of the harmonics over the 1X beyond which an orbit does not repeat.
UNEVEN, OPEN = 0.15, 0.1
# Largest over least size of the load beyond which the log mixes load ratios.
CHANGING = 1.15


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

    @cached_property
    def noise(self) -> np.ndarray:
        """What no smooth function of the force explains of the motion in the steady turns, shape (2, n), m."""
        found = orbit_noise(self.record.orbit)
        spent = math.sqrt(self.record.orbit.time.size / found.dof)
        return np.asarray(spent * found.residual[:, self.record.rotation.steady])

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
    uneven = _unevenness(record)
    low, high = _sizes(record)
    if rotation.turns < settings.least_turns - 0.05:
        return _refused(record, f"{rotation.turns:.1f} turns at full load are fewer than {settings.least_turns:g}")
    if uneven > UNEVEN:
        return _refused(
            record,
            f"the load does not turn evenly (its angle departs by {math.degrees(uneven):.2g} deg rms from a uniform rotation)",
        )
    if high > CHANGING * low:
        return _refused(
            record,
            f"the load changes its size from {low:.4g} to {high:.4g} N while it turns, so the log mixes load ratios; log "
            "each ratio as a run of its own",
        )
    steady = record.orbit.part(rotation.steady)
    try:
        motion = harmonics(steady.time, steady.displacement, rotation.frequency)
        load = harmonics(steady.time, steady.force, rotation.frequency)
    except InputError as error:
        return _refused(record, str(error).rstrip("."))
    first = math.hypot(abs(motion.at(1)), abs(motion.at(-1)))
    left = float(np.sqrt(np.mean(np.abs(motion.residual) ** 2)))
    # What the load itself does not repeat, and what jumps from sample to sample, is no fault of the orbit.
    unrest = float(np.sqrt(np.mean(np.abs(load.residual) ** 2))) / abs(load.at(1)) * first
    jumping = float(np.sqrt(np.mean(np.abs(np.diff(motion.residual)) ** 2) / 2))
    if left > OPEN * first + 3.0 * unrest and left > 2.0 * jumping:
        return _refused(
            record, f"the orbit does not close: {100 * left / first:.0f} % of its size do not repeat from turn to turn"
        )
    return Turns(record, motion, load)


def _refused(record: Record, reason: str) -> Turns:
    return Turns(record, None, None, f"{reason}: harmonics are refused, the models are fitted all the same")


def _unevenness(record: Record) -> float:
    """Return the slow departure of the load's angle from a uniform rotation, rad rms: over a twentieth of a turn."""
    rotation, time = record.rotation, record.orbit.time
    angle, t = rotation.angle[rotation.steady], time[rotation.steady]
    known = np.isfinite(angle)
    if known.sum() < 8:
        return math.inf
    angle, t = angle[known], t[known]
    rest = angle - np.polynomial.Polynomial.fit(t, angle, 1)(t)
    return float(_smooth(rest, record, 0.05).std())


def _sizes(record: Record) -> tuple[float, float]:
    """Return the least and largest size of the load while it turns, means over half a turn: an ellipse repeats then."""
    size = np.hypot(*record.orbit.force[:, record.rotation.steady])
    slow = _smooth(size, record, 0.5)
    noise = 3.0 * float(np.std(np.diff(size))) / math.sqrt(2.0 * max(size.size - slow.size + 1, 1))
    return float(slow.min()) + noise, float(slow.max()) - noise


def _smooth(values: np.ndarray, record: Record, turn: float) -> np.ndarray:
    """Return moving means over a part of a turn, only whole ones."""
    width = min(max(round(turn / (abs(record.rotation.frequency) * record.orbit.step)), 1), values.size)
    return np.convolve(values, np.ones(width) / width, mode="valid")
