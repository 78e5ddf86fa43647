"""The tank second by second: pump, true volume, echo, accelerometer, and the device that regulates by them (rap.md, 3.7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.rigs.rap.circuit.tank import (
    LARGEST_TILT,
    G,
    Tank,
    floor_margin,
    height_from_distance,
    rise_at_sensor,
    sound_speed,
    tilt_of,
    up_vector,
)
from pipeline.rigs.rap.synthetic.device_estimator import DeviceEstimator
from pipeline.rigs.rap.synthetic.drives import wander
from pipeline.rigs.rap.synthetic.readings import Columns
from pipeline.rigs.rap.synthetic.therapy_truth import TherapyTruth, tank_of

_SHORTEST, _LONGEST = 0.02, 0.285
_ACCEL_MEMORY = 10.0


@dataclass(frozen=True)
class Drain:
    """At `start` (s) the tank is emptied within `length` seconds down to `left` (m^3), `key` pressed before or not."""

    start: float
    length: float = 40.0
    left: float = 5e-6
    key: bool = True


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What the tank meets, second by second, (n,) each: moments (s), set rate (m^3/s; 0: pump off), pitch and roll (rad),
    whether the wearer walks, air temperature (K) in truth and as the device takes it, whether echoes are `lost`; `drains`.
    """

    moments: np.ndarray
    rate: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray
    walking: np.ndarray
    air: np.ndarray
    air_taken: np.ndarray
    lost: np.ndarray
    volume: float
    drains: Sequence[Drain] = field(default=())


@dataclass(frozen=True, eq=False)
class TankCourse:
    """What came of it, second by second, (n,) each.

    `command` and true `rate` of the pump (m^3/s), its true `gain`, true `volume` and that which the device takes it for
    (m^3), `distance` (m, 0 where there is no echo), `echo` (0 or 1), `accel` (n, 3; m/s^2).
    """

    moments: np.ndarray
    command: np.ndarray
    rate: np.ndarray
    gain: np.ndarray
    volume: np.ndarray
    taken: np.ndarray
    distance: np.ndarray
    echo: np.ndarray
    accel: np.ndarray

    def columns(self) -> Columns:
        """Return what the status table says of the tank."""
        accel = {f"tank_accel_{axis}": (self.accel[:, i], "m/s^2") for i, axis in enumerate("xyz")}
        return {
            "uf_pump_command": (self.command, "m^3/s"),
            "uf_volume_rap": (self.taken, "m^3"),
            "uf_level_distance": (self.distance, "m"),
            "uf_echo_valid": (self.echo, "1"),
            **accel,
        }


def followed(truth: TherapyTruth, around: Surroundings, rng: np.random.Generator) -> TankCourse:
    """Return the course of the tank; the device pumps and looks once a second."""
    tank, n = tank_of(truth), around.moments.size
    up = up_vector(np.stack([np.tan(around.pitch), np.tan(around.roll), np.ones(n)], axis=1))
    shaken = np.where(around.walking, truth.walking_accel, truth.accel_noise)
    accel = G * up + shaken[:, None] * rng.standard_normal((n, 3))
    gain = truth.pump_gain + wander(rng, n, 1.0, truth.pump_gain_scatter, truth.pump_gain_memory)
    blur = truth.level_noise * rng.standard_normal(n) + np.where(
        around.walking, truth.slosh, 0.0
    ) * rng.standard_normal(n)
    wild = np.where(rng.random(n) < truth.wild_echoes, rng.uniform(_SHORTEST, _LONGEST, n), 0.0)
    echo = _Echo(tank, up, around.air, blur - truth.level_offset, wild, around.lost, truth.level_lsb)
    device = _Device(truth, tank, _slowly(accel), around.air_taken, around.volume)
    command, volume, taken = np.zeros(n), np.zeros(n), np.zeros(n)
    distance, heard = np.zeros(n), np.zeros(n)
    V = around.volume
    for k in range(n):
        drained = _drained(around.drains, around.moments[k], V)
        if drained is not None:
            V, told = drained
            if told:
                device.restart()
        command[k] = device.command(float(around.rate[k]))
        V += max(gain[k], 0.0) * command[k]
        volume[k] = V
        distance[k], heard[k] = echo.at(k, V / tank.area)
        taken[k] = device.looks(k, distance[k], heard[k] > 0.0)
    return TankCourse(
        around.moments, command, np.maximum(gain, 0.0) * command, gain, volume, taken, distance, heard, accel
    )


def _slowly(accel: np.ndarray) -> np.ndarray:
    """Return the up vectors that the device takes from its accelerometer, low-passed."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1.0 / _ACCEL_MEMORY))
    low, _ = lfilter([1.0 - keep], [1.0, -keep], accel, axis=0, zi=keep * accel[:1])
    return up_vector(low)


def _drained(drains: Sequence[Drain], now: float, V: float) -> tuple[float, bool] | None:
    """Return the volume (m^3) while the tank is being emptied, and whether the key has been pressed just now."""
    for drain in drains:
        if drain.start <= now < drain.start + drain.length:
            left = drain.start + drain.length - now
            return drain.left + max(V - drain.left, 0.0) * max(
                left - 1.0, 0.0
            ) / left, drain.key and now < drain.start + 1.0
    return None


class _Echo:
    """The ultrasonic sensor."""

    def __init__(
        self,
        tank: Tank,
        up: np.ndarray,
        air: np.ndarray,
        blur: np.ndarray,
        wild: np.ndarray,
        lost: np.ndarray,
        lsb: float,
    ) -> None:
        self._top = tank.z + rise_at_sensor(tank, up)
        scale = sound_speed(tank.reference) / sound_speed(air)
        self._scale = scale * up[:, 2] if tank.echo == "specular" else scale
        self._margin = floor_margin(tank, up)
        self._steep = tilt_of(up) >= LARGEST_TILT
        self._rim, self._blind = tank.H, tank.blind
        self._blur, self._wild, self._lost, self._lsb = blur, wild, lost, lsb

    def at(self, k: int, height: float) -> tuple[float, float]:
        """Return the distance (m, 0 without echo) and 1 where there is an echo, at second `k` and that height (m)."""
        if height <= self._blind or self._lost[k]:
            return 0.0, 0.0
        D = self._wild[k] or (self._top[k] - height) * self._scale[k] + self._blur[k]
        cut = height < self._margin[k] or height > self._rim - self._margin[k]
        if (cut or self._steep[k]) and not self._wild[k]:
            # The surface is no longer a plane over the whole floor: the echo comes from a wall.
            D -= 0.5 * abs(self._margin[k])
        return (self._lsb * round(D / self._lsb) if self._lsb else D), 1.0


class _Device:
    """The device's own view of its tank and its regulation of the volume."""

    def __init__(self, truth: TherapyTruth, tank: Tank, up: np.ndarray, air: np.ndarray, volume: float) -> None:
        self._truth = truth
        self._estimator = DeviceEstimator(tank.area, volume)
        # Height is linear in the distance: its value at no distance, and its slope.
        self._at_zero = height_from_distance(tank, 0.0, up, air)
        self._slope = height_from_distance(tank, 1.0, up, air) - self._at_zero
        self._margin, self._steep = floor_margin(tank, up), tilt_of(up) >= LARGEST_TILT
        self._due = volume

    def restart(self) -> None:
        """Begin a new filling of the tank."""
        self._due -= self._estimator.volume
        self._estimator.emptied()

    def command(self, rate: float) -> float:
        """Return what is asked of the pump (m^3/s) for the next second at the set `rate` (m^3/s)."""
        self._due += rate
        if rate <= 0.0:
            return 0.0
        t = self._truth
        behind = (self._due - self._estimator.volume) / (rate * t.loop_time) if t.closed_loop else 0.0
        command = rate * min(max(1.0 + behind, t.loop_least), t.loop_most)
        self._estimator.pumped(command)
        return command

    def looks(self, k: int, distance: float, heard: bool) -> float:
        """Return the volume (m^3) that the device has in its tank, having listened at second `k`."""
        if heard and not self._steep[k]:
            height = self._at_zero[k] + self._slope[k] * distance
            if height > self._margin[k]:
                self._estimator.seen(float(height))
        return self._estimator.volume
