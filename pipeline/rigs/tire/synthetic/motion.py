"""How the synthetic wheel rolls: speed, angle, load and longitudinal force at the moments that are sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.synthetic.truth import BenchTruth, RoadTruth

# Longitudinal force per slip, N: V = Re Omega (1 - slip).
SLIP_STIFFNESS = 6e4


@dataclass(frozen=True, eq=False)
class Motion:
    """What truly happens: time (s), speed (m/s), angle of the sensor (rad), Fz and Fx (N), shape (n,) each."""

    time: np.ndarray
    speed: np.ndarray
    angle: np.ndarray
    Fz: np.ndarray
    Fx: np.ndarray

    def at(self, name: str, moments: np.ndarray) -> np.ndarray:
        """Return a quantity at other moments, s."""
        return np.asarray(np.interp(moments, self.time, getattr(self, name)))


def bench_motion(truth: BenchTruth, load: float, speed: float, duration: float, rng: np.random.Generator) -> Motion:
    """Return a run at constant load (N) and speed (m/s), as constant as a bench holds them."""
    time = _moments(truth, duration)
    slow, fast, drum, start = rng.uniform(0.0, 2.0 * np.pi, 4)
    wander = truth.speed_wander[0] * np.sin(2.0 * np.pi * 0.13 * time + slow)
    wander += truth.speed_wander[1] * np.sin(2.0 * np.pi * 0.71 * time + fast)
    rolling = speed * (1.0 + wander + truth.speed_ramp * (time / duration - 0.5))
    path = _integral(rolling, time)
    Fz = load * (1.0 + truth.load_wave * np.sin(path / truth.drum_radius + drum))
    return Motion(time, rolling, start + path / truth.R, Fz, np.zeros(time.size))


def road_motion(truth: RoadTruth, rng: np.random.Generator) -> Motion:
    """Return a drive: speed by its corners, forces by acceleration, events of the load."""
    time = _moments(truth, truth.duration)
    corners, speeds = np.transpose(np.asarray(truth.speeds, dtype=float))
    acceleration = np.zeros(time.size)
    for t0, t1, v0, v1 in zip(corners[:-1], corners[1:], speeds[:-1], speeds[1:], strict=True):
        if t1 > t0:
            rounded = _smooth_step(time - t0, truth.smoothing) - _smooth_step(time - t1, truth.smoothing)
            acceleration += (v1 - v0) / (t1 - t0) * rounded
    speed = speeds[0] + _integral(acceleration, time)
    Fx = acceleration * np.where(acceleration > 0.0, truth.driving_mass, truth.braking_mass)
    Fz = truth.static_load - truth.transfer_mass * acceleration
    for centre, width, height in truth.pulses:
        within = np.abs(time - centre) < 0.5 * width
        Fz = Fz + np.where(within, 0.5 * height * (1.0 + np.cos(2.0 * np.pi * (time - centre) / width)), 0.0)
    start = rng.uniform(0.0, 2.0 * np.pi)
    angle = start + _integral(speed / truth.R * (1.0 + Fx / SLIP_STIFFNESS), time)
    return Motion(time, speed, angle, np.maximum(Fz, 0.0), Fx)


def _moments(truth: BenchTruth | RoadTruth, duration: float) -> np.ndarray:
    """Return when the microcontroller truly samples: its crystal is a little fast."""
    rate = truth.rate * (1.0 + 1e-6 * truth.device_ppm)
    return np.asarray(np.arange(int(duration * truth.rate)) / rate)


def _integral(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])


def _smooth_step(time: np.ndarray, width: float) -> np.ndarray:
    """A step at 0, rounded by a raised cosine over `width` seconds."""
    share = np.clip(time / width + 0.5, 0.0, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * share))
