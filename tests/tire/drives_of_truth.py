"""Drives of the synthetic tire, fitted with the tire that made them, and what truly happened at each passage."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.rigs.tire.passages.device import device_of
from pipeline.rigs.tire.passages.revolutions import revolutions_of
from pipeline.rigs.tire.ring.sensor import Sensor
from pipeline.rigs.tire.road.library import CalibratedTire, FilmResponse, library
from pipeline.rigs.tire.road.revolution_fit import Forces, RevolutionFit, joined
from pipeline.rigs.tire.synthetic.motion import road_motion
from pipeline.rigs.tire.synthetic.rig import synthesize_road
from pipeline.rigs.tire.synthetic.truth import ring_of, road_truth


@dataclass(frozen=True)
class Drive:
    forces: Forces
    Fz: np.ndarray
    Fx: np.ndarray
    speed: np.ndarray
    recording: object
    fit: RevolutionFit

    @property
    def load_error(self):
        return (self.forces.load - self.Fz)[self.forces.fits]

    @property
    def force_error(self):
        return (self.forces.force - self.Fx)[self.forces.fits]

    def covered(self):
        """Share of the revolutions whose 95 % intervals hold Fz, and Fx."""
        f = self.forces
        return (
            np.mean(np.abs(self.load_error) < 1.96 * f.load_se[f.fits]),
            np.mean(np.abs(self.force_error) < 1.96 * f.force_se[f.fits]),
        )


def calibrated(truth, **changed):
    """The tire of the truth as a perfect bench would find it; `changed` multiplies some of its numbers."""
    film = FilmResponse(
        truth.film_gain * truth.h / 2 / truth.c, truth.film_length, truth.film_time_constant, truth.film_offset_angle
    )
    sensor = Sensor(
        truth.c, truth.R0, truth.flex_length, truth.flex_lag, truth.supply_voltage, truth.divider_resistance
    )
    tire = CalibratedTire(ring_of(truth), truth.kt, truth.Ro, sensor, 1000.0, 3000.0, film=film)
    for name, factor in changed.items():
        tire = tire.scaled(name, factor)
    return tire


@cache
def known_library(**changed):
    return library(calibrated(road_truth({}), **changed))


@cache
def passages(seed, items=()):
    recording = synthesize_road(dict(items), seed)[0]
    return recording, list(revolutions_of(device_of(recording)))


def drive(seed=1, known=None, block=None, **overrides):
    recording, blocks = passages(seed, tuple(overrides.items()))
    truth = road_truth(overrides)
    fit = RevolutionFit(known or known_library())
    parts = []
    for part in blocks:
        size = block or len(part)
        for i in range(0, len(part), max(size, 1)):
            parts.append(fit.add(part[i : i + size]))
    parts.append(fit.close())
    forces = joined([part for part in parts if part is not None])
    motion = road_motion(truth, np.random.default_rng((seed, truth.number)))
    stamps = np.arange(motion.time.size) / truth.rate
    turns = np.round(np.interp(forces.time, stamps, motion.angle) / (2 * np.pi))
    at = np.interp(2 * np.pi * turns, motion.angle, stamps)
    Fz, Fx, speed = (np.interp(at, stamps, values) for values in (motion.Fz, motion.Fx, motion.speed))
    return Drive(forces, Fz, Fx, speed, recording, fit)
