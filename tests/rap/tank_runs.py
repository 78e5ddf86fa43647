"""Short runs of a tank with known truth: what the device's sensors and the scale would log of it."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from pipeline.rigs.rap.circuit.tank import Tank, distance_from_height
from pipeline.rigs.rap.circuit.thermal import housing_temperature
from pipeline.rigs.rap.tables import Signal
from pipeline.rigs.rap.therapy.command import command_of
from pipeline.rigs.rap.therapy.drains import emptied
from pipeline.rigs.rap.therapy.levels import level_course
from pipeline.rigs.rap.therapy.tank_filter import track_volume
from pipeline.rigs.rap.therapy.temperature_fit import AirTemperature

TANK = Tank()
RATE = 5e-6 / 60.0


def wandering(rng, n, dt, sd, tau):
    """An Ornstein-Uhlenbeck process, (n,)."""
    e = np.exp(-dt / tau)
    start = sd * rng.standard_normal()
    return lfilter([1.0], [1.0, -e], sd * np.sqrt(1 - e * e) * rng.standard_normal(n), zi=[e * start])[0]


@dataclass
class TankRun:
    """Signals and truth of a run; arrays at 1 Hz."""

    t: np.ndarray
    V: np.ndarray
    gain: np.ndarray
    asked: np.ndarray
    T: np.ndarray
    tank: Tank
    signals: dict

    def levels(self, **changed):
        kept = {"valid": self.signals["valid"], "accelerations": self.signals["acceleration"], "temperature": self.air}
        return level_course(self.signals["distance"], self.tank, **(kept | changed))

    @property
    def air(self):
        return AirTemperature(self.t, self.T, 0.0, "known")

    @property
    def command(self):
        return command_of(self.signals["command"], None)

    def course(self, pressed=(), **settings):
        levels = self.levels()
        found, empty, _ = emptied(levels, self.tank, self.command, pressed)
        return track_volume(levels, self.tank, self.command, emptied=found, empty_at_start=empty, **settings)


def tank_run(
    seed=1, minutes=60, V0=0.3e-3, start=60.0, noise=1e-3, wild=0.02, tank=TANK, tilt=(1.5, -0.8), drained=None, left=0.0, pause=None,
    wander=0.01, scale_lag=0.0, offset=0.0, mean=0.97,
):  # fmt: skip
    """Return a run; tilt about y and x in degrees, `drained` (s) empties the tank to `left`, `pause` (s, s) stops the pump."""
    rng = np.random.default_rng(seed)
    n = int(minutes * 60)
    t = np.arange(n) * 1.0
    gain = mean + wandering(rng, n, 1.0, wander, 3600.0)
    asked = np.where(t >= start, RATE, 0.0)
    if pause is not None:
        asked[(t >= pause[0]) & (t < pause[1])] = 0.0
    V = V0 + np.concatenate([[0.0], np.cumsum((gain * asked)[1:])])
    if drained is not None:
        V = np.where(t >= drained, V - V[int(drained)] + left, V)
    T = housing_temperature(t, 298.15, 303.15, 1200.0)
    up = np.array([np.sin(np.radians(tilt[0])), np.sin(np.radians(tilt[1])), 0.0])
    up[2] = np.sqrt(1.0 - up @ up)
    h = V / tank.area
    D = distance_from_height(tank, h, np.tile(up, (n, 1)), T) + offset + noise * rng.standard_normal(n)
    D = np.round(D / 0.25e-3) * 0.25e-3 if noise else D
    off = rng.random(n) < wild
    D[off] = rng.uniform(0.02, 0.285, off.sum())
    seen = h > tank.blind
    D[~seen] = 0.0
    a = 9.81 * up + 0.03 * (noise > 0.0) * rng.standard_normal((n, 3))
    mass = 1004.0 * V + 1e-3 * rng.standard_normal(n)
    signals = {
        "distance": Signal("uf_level_distance", t, D),
        "valid": Signal("uf_echo_valid", t, seen * 1.0),
        "acceleration": tuple(Signal(f"tank_accel_{axis}", t, a[:, i]) for i, axis in enumerate("xyz")),
        "command": Signal("uf_pump_command", t, asked),
        "set": Signal("uf_flow_set", t, asked),
        "scale": Signal("uf_mass_scale", t + scale_lag, mass),
    }
    return TankRun(t, V, gain, asked, T, tank, signals)
