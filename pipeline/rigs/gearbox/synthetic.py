"""The logs of the synthetic gearbox (gearbox.md, section 6): torques, encoder and vibration, each board on its own clock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.gearbox import cycle
from pipeline.rigs.gearbox.model.dynamics import Motion
from pipeline.rigs.gearbox.model.kinematics import mesh_orders
from pipeline.rigs.gearbox.model.teeth import teeth_of
from pipeline.rigs.gearbox.truth import RPM, GearboxTruth, gearbox_truth, speeds_of

_G0 = 9.81
# What each place feels of the tones, which shaft it follows, and its white noise, all relative to the input bearing.
ACCELEROMETERS = {
    "acc_in_radial": (1.0, "theta1", 1.0),
    "acc_in_axial": (0.5, "theta1", 1.0),
    "acc_out_radial": (0.6, "theta2", 1.0),
    "acc_out_axial": (0.3, "theta2", 1.0),
    "acc_load_radial": (0.2, "theta2", 1.0 / 3.0),
}


@dataclass(frozen=True, eq=False)
class KnownRun:
    """One run whose truth is known: nominal speed (rad/s), lock torque (N m), motion and events (s of the cycle)."""

    name: str
    speed: float
    lock_torque: float
    motion: Motion
    events: Mapping[str, float]


def known_runs(truth: GearboxTruth, seed: int) -> Iterator[tuple[KnownRun, np.random.Generator]]:
    """Yield what truly happens in each run of a campaign, and the random numbers left for its sensors."""
    for i, (name, speed) in enumerate(speeds_of(truth).items(), start=1):
        rng = np.random.default_rng(100 * seed + i)
        factor = 1.0 + truth.lock_scatter * rng.standard_normal()
        motion = cycle.run_motion(truth, speed, factor)
        lock_torque = cycle.plant(truth, speed, factor).M_lock
        yield KnownRun(name, speed, lock_torque, motion, cycle.events(truth, motion)), rng


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return one recording a run; `truth` overrides any field of `GearboxTruth`."""
    known = gearbox_truth(truth)
    return [_recording(known, run, rng) for run, rng in known_runs(known, seed)]


def _recording(truth: GearboxTruth, run: KnownRun, rng: np.random.Generator) -> Recording:
    streams = {"torque": _torques(truth, run.motion, rng), "encoder": _encoder(truth, run.motion, rng)}
    if truth.vibration:
        streams["vibration"] = _vibration(truth, run.motion, rng)
    return Recording(run.name, streams, _conditions(truth, run))


def _clock(truth: GearboxTruth, rate: float, ppm: float = 0.0, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the stamps of a board and the moments of the cycle (s) that they stand for, shape (n,) each.

    Each board counts from its own start, which lies `shift` seconds after that of the torques.
    """
    pace = 1.0 + 1e-6 * ppm
    stamps = np.arange(int((truth.duration - truth.log_start - max(shift, 0.0)) * rate * pace) + 1) / rate
    return stamps, truth.log_start + shift + stamps / pace


def _at(motion: Motion, values: np.ndarray, moments: np.ndarray) -> np.ndarray:
    return np.asarray(np.interp(moments, motion.time, values))


def _wander(rng: np.random.Generator, n: int, step: float, sd: float, memory: float) -> np.ndarray:
    """First-order autoregression with standard deviation `sd` and correlation time `memory` (s), shape (n,)."""
    from scipy.signal import lfilter

    phi = float(np.exp(-step / memory))
    innovation = sd * rng.standard_normal(n)
    innovation[1:] *= np.sqrt(1.0 - phi**2)
    return np.asarray(lfilter([1.0], [1.0, -phi], innovation))


def _torques(truth: GearboxTruth, motion: Motion, rng: np.random.Generator) -> Stream:
    stamps, moments = _clock(truth, truth.torque_rate)
    found = {f"torque_{side}": _torque(truth, motion, side, moments, rng) for side in ("in", "out")}
    if truth.swap_torques:
        found = {"torque_in": found["torque_out"], "torque_out": found["torque_in"]}
    return Stream("torque", stamps, {name: Channel(name, values, "N*m") for name, values in found.items()})


def _torque(
    truth: GearboxTruth, motion: Motion, side: str, moments: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Return what the torque sensor of the `side` "in" or "out" reads, N m, shape (n,)."""
    shaft = "1" if side == "in" else "2"
    real, angle, speed = (
        _at(motion, getattr(motion, name), moments) for name in (f"torque_{side}", f"theta{shaft}", f"w{shaft}")
    )
    once, twice = rng.uniform(0.0, 2.0 * np.pi, 2)
    waves = getattr(truth, f"ripple_{side}") * (np.sin(angle + once) + 0.6 * np.sin(2.0 * angle + twice))
    white = truth.torque_noise * rng.standard_normal(moments.size)
    drift = _wander(rng, moments.size, 1.0 / truth.torque_rate, getattr(truth, f"drift_{side}"), truth.drift_memory)
    share = (moments - moments[0]) / max(moments[-1] - moments[0], 1e-9)
    offset = getattr(truth, f"offset_{side}") + getattr(truth, f"offset_change_{side}") * share
    reading = getattr(truth, f"gain_{side}") * (real + waves * (speed > 0.0)) + truth.noise * (white + drift) + offset
    bit, most = truth.torque_span / 2**truth.torque_bits, 2 ** (truth.torque_bits - 1)
    return np.asarray(bit * np.clip(np.round(reading / bit), -most, most - 1))


def _encoder(truth: GearboxTruth, motion: Motion, rng: np.random.Generator) -> Stream:
    stamps, moments = _clock(truth, truth.encoder_rate, truth.encoder_ppm, truth.encoder_shift)
    if truth.encoder_jitter:
        stamps = stamps + rng.uniform(-truth.encoder_jitter, truth.encoder_jitter, stamps.size)
        stamps[0] = 0.0
    per_turn = truth.encoder_ppr * truth.encoder_decoding
    turned = _at(motion, motion.theta2, moments) / (2.0 * np.pi)
    counts = np.floor(turned * per_turn + rng.uniform())
    counts -= counts[0]
    frozen = (moments >= truth.dropout_start) & (moments < truth.dropout_start + truth.dropout_time)
    if frozen.any():
        first, last = np.flatnonzero(frozen)[[0, -1]]
        lost = counts[last] - counts[first]
        counts[frozen] = counts[first]
        counts[last + 1 :] -= lost if truth.dropout_lost else 0.0
    if truth.speed_only:
        speed = np.diff(counts, prepend=counts[:1]) * truth.encoder_rate * 2.0 * np.pi / per_turn
        return Stream("encoder", stamps, {"speed_out": Channel("speed_out", speed, "rad/s")})
    if truth.encoder_log_rate:
        logged, _ = _clock(truth, truth.encoder_log_rate, truth.encoder_ppm, truth.encoder_shift)
        counts = counts[np.minimum(np.searchsorted(stamps, logged + 1e-9, side="right") - 1, counts.size - 1)]
        stamps = logged
    return Stream("encoder", stamps, {"encoder_count_out": Channel("encoder_count_out", counts, "1")})


def _vibration(truth: GearboxTruth, motion: Motion, rng: np.random.Generator) -> Stream:
    stamps, moments = _clock(truth, truth.vibration_rate, truth.vibration_ppm, truth.vibration_shift)
    theta = {name: _at(motion, getattr(motion, name), moments) for name in ("theta1", "theta2")}
    turning = _at(motion, motion.w1, moments) > 0.0
    true_slip = _at(motion, motion.slip, moments)
    slip = np.where(turning, np.maximum(true_slip, truth.creep), 0.0)
    crept = np.cumsum(np.where(turning, slip - true_slip, 0.0)) / truth.vibration_rate
    relative = theta["theta1"] - theta["theta2"] + crept
    phases = rng.uniform(0.0, 2.0 * np.pi, 4)
    carrier = 1.0 + truth.modulation * np.cos(2.0 * theta["theta1"])
    first, second = (float(order) for order in mesh_orders(teeth_of(truth.teeth)))
    meshes = np.zeros(stamps.size)
    for size, order, swell, phase in (
        (0.12, first, carrier, phases[0]),
        (0.05, 2.0 * first, carrier, phases[1]),
        (0.18, second, 1.0, phases[2]),
        (0.08, 2.0 * second, 1.0, phases[3]),
    ):
        meshes += size * np.sin(order * relative + phase) * swell
    channels = {}
    for name, (tone, shaft, white) in ACCELEROMETERS.items():
        grinding = meshes + 0.08 * truth.noise * rng.standard_normal(stamps.size)
        felt = tone * (0.03 * np.sin(theta[shaft]) + slip / 12.0 * grinding)
        values = _G0 * (felt + 0.03 * white * truth.noise * rng.standard_normal(stamps.size))
        channels[name] = Channel(name, np.round(values, 5), "m/s^2")
    return Stream("vibration", stamps, channels)


def _conditions(truth: GearboxTruth, run: KnownRun) -> dict[str, Condition]:
    return {
        "speed_nominal": run.speed,
        "encoder_ppr": float(truth.encoder_ppr),
        "encoder_decoding": float(truth.encoder_decoding),
        "torque_range_in": truth.torque_span / 2.0,
        "torque_range_out": truth.torque_span / 2.0,
        "ramp_time": truth.ramp_time,
        "inverter_frequency": run.speed / RPM / 60.0,
        "lubrication": "none",
        "teeth": truth.teeth,
    }
