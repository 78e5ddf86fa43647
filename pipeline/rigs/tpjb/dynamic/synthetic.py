"""The synthetic rig of T2 (tpjb.md section 6): in-phase and antiphase logs of bearings whose H is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.overridden import Truth, overridden
from pipeline.rigs.tpjb import truth as rig_truth
from pipeline.rigs.tpjb.axes import FROM_UV
from pipeline.rigs.tpjb.dynamic.bench import Bench
from pipeline.rigs.tpjb.probes import GAPS

_NAMES = {"4pad-L1": "a2", "4pad-L2": "a3", "5pad-L3": "b2", "5pad-L2": "b7"}
MODES = ("in_phase", "antiphase")
_REST_GAP = 1e-3
_RIG = "synthetic bearing rig"


@dataclass(frozen=True)
class DynamicTruth:
    """What the synthetic test is made of; every field may be overridden. SI.

    Attributes
    ----------
    bearings
        Names of `pipeline.rigs.tpjb.truth`.
    amplitude, v_gain, v_phase
        Force of a tone along u, N; along v it is `v_gain` times that, turned by `v_phase` (rad).
    runout, speed_wander
        Shaft order m moves the probes by runout/m^1.5 (m); the speed swings by that share.
    plane_tilt
        Relative difference of the motion in either plane from that of the middle.
    sequence
        One log with both excitations, the second at `switch` (s).
    delay
        How late the gaps are, s.
    swap_uv
        The probes of u and v are taken for each other.
    missing
        Share of rows that the logger lost; `jitter` (s) by which stamps are off.
    """

    bearings: Sequence[str] = ("4pad-L1", "4pad-L2")
    tones: Sequence[float] = (7.0, 11.0, 13.0, 19.0, 23.0, 29.0, 37.0, 43.0)
    rate: float = 1000.0
    duration: float = 30.0
    amplitude: float = 400.0
    v_gain: float = 1.03
    v_phase: float = np.pi / 90
    shaft_speed: float = rig_truth.SHAFT_SPEED
    runout: float = 3e-6
    speed_wander: float = 5e-4
    plane_tilt: float = 0.03
    gap_noise: float = 1e-7
    gap_quantum: float = 2e-9
    force_noise: float = 5.0
    acceleration_noise: float = 5e-3
    speed_noise: float = 0.02
    static_noise: float = 30.0
    jitter: float = 0.0
    missing: float = 0.0
    delay: float = 0.0
    swap_uv: bool = False
    sequence: bool = False
    switch: float = 30.0
    bench: Bench = field(default_factory=Bench)


def dynamic_truth(overrides: Mapping[str, Any]) -> DynamicTruth:
    """Return the truth with `overrides`.

    Raises
    ------
    InputError
        If a name is unknown; names the nearest.
    """
    truth = with_bench(DynamicTruth(), overrides)
    for name in truth.bearings:
        rig_truth.bearing(name)
    return truth


def with_bench(usual: Truth, overrides: Mapping[str, Any]) -> Truth:
    """Return `usual` with `overrides`; `bench` may be a mapping of its own fields.

    Raises
    ------
    InputError
        As `overridden`.
    """
    given = dict(overrides)
    if isinstance(given.get("bench"), Mapping):
        given["bench"] = overridden(Bench(), given["bench"], _RIG)
    return overridden(usual, given, _RIG)


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the logs of both excitations of each bearing; `truth` overrides fields of `DynamicTruth`."""
    known = dynamic_truth(truth)
    rng = np.random.default_rng(seed)
    recordings = []
    for name in known.bearings:
        bearing = rig_truth.bearing(name)
        label = _NAMES.get(name, name)
        if known.sequence:
            recordings.append(_log(known, bearing, label, MODES, rng))
        else:
            recordings += [_log(known, bearing, f"{label}_{mode}", (mode,), rng) for mode in MODES]
    return recordings


def _log(
    truth: DynamicTruth, bearing: rig_truth.Bearing, run: str, modes: Sequence[str], rng: np.random.Generator
) -> Recording:
    duration = truth.duration if len(modes) == 1 else truth.switch + truth.duration
    stamps = np.arange(round(duration * truth.rate)) / truth.rate
    if truth.missing:
        stamps = stamps[rng.random(stamps.size) >= truth.missing]
    time = stamps + truth.jitter * rng.standard_normal(stamps.size)
    tones = np.asarray(truth.tones, dtype=float)
    force, motion, acceleration = (np.zeros((2, time.size)) for _ in range(3))
    for number, mode in enumerate(modes):
        now = (time < truth.switch) == (number == 0) if len(modes) > 1 else np.ones(time.size, dtype=bool)
        F_uv = _drive(truth, mode, rng.uniform(0, 2 * np.pi, tones.size))
        d, a = truth.bench.answers(bearing.impedance, F_uv @ FROM_UV.T, tones)
        force[:, now] = _summed(F_uv, tones, time[now])
        motion[:, now] = _summed(d @ FROM_UV, tones, time[now] - truth.delay)
        acceleration[:, now] = _summed(a @ FROM_UV, tones, time[now])
    speed, runout = _shaft(truth, time, rng)
    u, v = motion + runout + (FROM_UV.T @ np.array(bearing.equilibrium))[:, None]
    if truth.swap_uv:
        u, v = v, u
    columns: dict[str, tuple[np.ndarray, str]] = {}
    for name in GAPS:
        plane = 1 + truth.plane_tilt if name.endswith("1") else 1 - truth.plane_tilt
        move = plane * (u if name[4] == "u" else v)
        gap = _REST_GAP + (move if name[5] == "p" else -move) + truth.gap_noise * rng.standard_normal(time.size)
        columns[name] = (np.round(gap / truth.gap_quantum) * truth.gap_quantum if truth.gap_quantum else gap, "m")
    for name, values in zip(("force_u", "force_v"), force, strict=True):
        columns[name] = (values + truth.force_noise * rng.standard_normal(time.size), "N")
    columns["force_static"] = (bearing.static_load + truth.static_noise * rng.standard_normal(time.size), "N")
    for name, values in zip(("acc_ua", "acc_ub", "acc_va", "acc_vb"), np.repeat(acceleration, 2, axis=0), strict=True):
        columns[name] = (values + truth.acceleration_noise * rng.standard_normal(time.size), "m/s^2")
    columns["speed"] = (speed + truth.speed_noise * rng.standard_normal(time.size), "rad/s")
    stream = Stream("hf", stamps, {name: Channel(name, values, unit) for name, (values, unit) in columns.items()})
    return Recording(run, {"hf": stream}, _conditions(truth, bearing, modes))


def _drive(truth: DynamicTruth, mode: str, phases: np.ndarray) -> np.ndarray:
    """Return the amplitudes along u and v, shape (k, 2), N."""
    u = truth.amplitude * np.exp(1j * phases)
    v = truth.v_gain * np.exp(1j * truth.v_phase) * u
    return np.stack((u, v if mode == "in_phase" else -v), axis=1)


def _summed(amplitudes: np.ndarray, tones: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the sum of tones of shape (k, 2) at `time`, shape (2, n)."""
    out = np.zeros((2, time.size))
    for tone, amplitude in zip(tones, amplitudes, strict=True):
        out += (amplitude[:, None] * np.exp(2j * np.pi * tone * time)).real
    return out


def _shaft(truth: DynamicTruth, time: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return speed (rad/s), shape (n,), and what the shaft orders move the probes along u and v, shape (2, n), m."""
    period, phase = 9.0 + rng.uniform(0, 4), rng.uniform(0, 2 * np.pi)
    swing = 2 * np.pi / period
    speed = truth.shaft_speed * (1 + truth.speed_wander * np.sin(swing * time + phase))
    angle = truth.shaft_speed * (time - truth.speed_wander / swing * np.cos(swing * time + phase))
    runout = np.zeros((2, time.size))
    for order in range(1, 5):
        for axis in range(2):
            runout[axis] += truth.runout / order**1.5 * np.cos(order * angle + rng.uniform(0, 2 * np.pi))
    return speed, runout


def _conditions(truth: DynamicTruth, bearing: rig_truth.Bearing, modes: Sequence[str]) -> dict[str, Condition]:
    pads = {4: "45 135 225 315 deg", 5: "18 90 162 234 306 deg"}
    conditions: dict[str, Condition] = {
        "bearing": f"{bearing.n_pads}pad",
        "n_pads": float(bearing.n_pads),
        "pad_angles": pads[bearing.n_pads],
        "diameter": 0.280,
        "static_load": bearing.static_load,
        "shaft_speed_nominal": truth.shaft_speed,
        "stator_mass": truth.bench.stator_mass,
        "stabilizer_stiffness": truth.bench.stabilizer_stiffness,
        "z1": -0.12,
        "z2": 0.12,
        "test": "dynamic",
        "excitation_tones": " ".join(f"{tone:g}" for tone in truth.tones) + " Hz",
        "clearance_nominal": rig_truth.CLEARANCE,
        "sensor_gain_u": 0.01,
        "force_gain_u": 0.005,
    }
    return conditions | ({"mode": modes[0]} if len(modes) == 1 else {})
