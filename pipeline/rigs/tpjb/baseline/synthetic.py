"""The synthetic rig of T0: the stator hung without contact, driven by six tones in phase, then in antiphase."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.tpjb.axes import FROM_UV
from pipeline.rigs.tpjb.dynamic.bench import Bench
from pipeline.rigs.tpjb.dynamic.synthetic import MODES, with_bench


@dataclass(frozen=True)
class BaselineTruth:
    """What the synthetic test is made of; every field may be overridden. SI.

    Attributes
    ----------
    amplitude, v_gain, v_phase
        Force of a tone along u, N; along v it is `v_gain` times that, turned by `v_phase` (rad).
    weighed
        Whether the logs state the mass, as a lab may.
    """

    tones: tuple[float, ...] = (21.0, 23.0, 27.0, 31.0, 37.0, 41.0)
    rate: float = 1000.0
    duration: float = 30.0
    amplitude: float = 300.0
    v_gain: float = 1.03
    v_phase: float = np.pi / 90
    force_noise: float = 5.0
    acceleration_noise: float = 5e-3
    weighed: bool = False
    bench: Bench = field(default_factory=Bench)


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return one log for each excitation; `truth` overrides fields of `BaselineTruth`."""
    known = with_bench(BaselineTruth(), truth)
    rng = np.random.default_rng(seed)
    return [_log(known, mode, rng) for mode in MODES]


def _log(truth: BaselineTruth, mode: str, rng: np.random.Generator) -> Recording:
    tones = np.asarray(truth.tones, dtype=float)
    time = np.arange(round(truth.duration * truth.rate)) / truth.rate
    u = truth.amplitude * np.exp(1j * rng.uniform(0, 2 * np.pi, tones.size))
    v = truth.v_gain * np.exp(1j * truth.v_phase) * u
    F_uv = np.stack((u, v if mode == "in_phase" else -v), axis=1)
    _, a = truth.bench.answers(lambda _: np.zeros((2, 2)), F_uv @ FROM_UV.T, tones)
    turning = np.exp(2j * np.pi * tones[:, None] * time)
    force, acceleration = (F_uv.T @ turning).real, ((a @ FROM_UV).T @ turning).real
    columns: dict[str, tuple[np.ndarray, str]] = {}
    for name, values in zip(("force_u", "force_v"), force, strict=True):
        columns[name] = (values + truth.force_noise * rng.standard_normal(time.size), "N")
    for name, values in zip(("acc_ua", "acc_ub", "acc_va", "acc_vb"), np.repeat(acceleration, 2, axis=0), strict=True):
        columns[name] = (values + truth.acceleration_noise * rng.standard_normal(time.size), "m/s^2")
    conditions: dict[str, Condition] = {
        "test": "baseline",
        "mode": mode,
        "excitation_tones": " ".join(f"{tone:g}" for tone in truth.tones) + " Hz",
        "shaft_speed_nominal": 0.0,
        "force_gain_u": 0.005,
    }
    if truth.weighed:
        conditions["stator_mass"] = truth.bench.stator_mass
    stream = Stream("hf", time, {name: Channel(name, values, unit) for name, (values, unit) in columns.items()})
    return Recording(f"t0_{mode}", {"hf": stream}, conditions)
