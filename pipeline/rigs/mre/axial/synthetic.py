"""The synthetic press (mre.md section 6): loops of compression with known truth, read by a dial gauge."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.mre.axial.loop import LoopModel, along_strokes
from pipeline.rigs.overridden import overridden

_TABLES = {"k", "k3", "alpha", "rho"}


@dataclass(frozen=True)
class AxialTruth:
    """What the synthetic press is made of; every field may be overridden. SI.

    Attributes
    ----------
    k, k3, alpha, rho
        Parameters of the loop by current (A), straight between those listed.
    currents
        One run a current, `repeats` times; each bears a gain error of the force, 1 sigma `gain_scatter`.
    rest_before, rest_top, rest_after
        Seconds of standstill before, at the turn, after.
    rate_ripple
        Share by which the rate swings, three times a stroke.
    gauge_step
        Step of the gauge, m; 0 for none. `gauge_noise` is added before the step.
    speed_error
        Share by which the speed of a run is off, at most.
    late
        The first sample falls up to one sample interval after the start.
    """

    k: Mapping[float, float] = field(default_factory=lambda: {0.0: 4.55e5, 2.0: 7.35e5})
    k3: Mapping[float, float] = field(default_factory=lambda: {0.0: 4.2e10, 2.0: 6.0e10})
    alpha: Mapping[float, float] = field(default_factory=lambda: {0.0: 24.0, 2.0: 60.0})
    rho: Mapping[float, float] = field(default_factory=lambda: {0.0: 2e4, 2.0: 2e4})
    currents: Sequence[float] = (0.0, 2.0)
    repeats: int = 1
    cycles: int = 1
    gain_scatter: float = 0.0

    stroke: float = 6e-4
    speed: float = 1e-5
    speed_error: float = 0.01
    rate: float = 10.0
    rate_ripple: float = 0.0
    rest_before: float = 0.0
    rest_top: float = 0.0
    rest_after: float = 0.0
    late: bool = True
    force_noise: float = 1.0
    force_lsb: float = 0.03
    force_offset: float = 2.0
    gauge_step: float = 1e-5
    gauge_noise: float = 0.0
    current_noise: float = 0.01

    pad_diameter: float = 0.05
    pad_height: float = 0.006
    powder_fraction: float = 0.25
    matrix_shear_modulus: float = 0.3e6
    poisson_ratio: float = 0.2
    flux_per_current: float = 0.8 / 6

    def model_at(self, current: float) -> LoopModel:
        """Return the loop's parameters at a current (A)."""
        k, k3, alpha, rho = (_between(table, current) for table in (self.k, self.k3, self.alpha, self.rho))
        return LoopModel(k, k3, alpha, rho)


def _between(table: Mapping[float, float], current: float) -> float:
    at = sorted(table)
    return float(np.interp(current, at, [table[i] for i in at]))


def axial_truth(overrides: Mapping[str, Any]) -> AxialTruth:
    """Return the truth with `overrides`; tables by current may have text keys (from YAML or JSON).

    Raises
    ------
    InputError
        If a name is unknown; names the nearest.
    """
    given: dict[str, Any] = {
        k: {float(i): float(v) for i, v in dict(value).items()} if k in _TABLES else value
        for k, value in overrides.items()
    }
    return overridden(AxialTruth(), given, "synthetic press")


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return one recording a current and repeat, as ``ax_0``, ``ax_2``; `truth` overrides any field."""
    known = axial_truth(truth)
    runs = [(current, repeat) for current in known.currents for repeat in range(known.repeats)]
    streams = np.random.SeedSequence(seed).spawn(len(runs))
    return [_run(known, i, j, np.random.default_rng(s)) for (i, j), s in zip(runs, streams, strict=True)]


def motion(truth: AxialTruth, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return true displacement (m) and number of the stroke at times since the start, shape (n,) each."""
    stroke_time = truth.stroke / truth.speed
    d = np.zeros(time.size)
    stroke = np.zeros(time.size, dtype=int)
    start, place = truth.rest_before, 0.0
    for i in range(2 * truth.cycles):
        phase = np.clip((time - start) / stroke_time, 0.0, 1.0)
        share = phase + truth.rate_ripple / (6 * math.pi) * np.sin(6 * math.pi * phase)
        begun = time > start
        d[begun] = place + (truth.stroke if i % 2 == 0 else -truth.stroke) * share[begun]
        stroke[begun] = i
        place = truth.stroke - place
        start += stroke_time + (truth.rest_top if i % 2 == 0 else 0.0)
    return d, stroke


def duration(truth: AxialTruth) -> float:
    """Return how long a run takes, s."""
    loop = 2 * truth.stroke / truth.speed + truth.rest_top
    return truth.rest_before + truth.cycles * loop + truth.rest_after


def _run(truth: AxialTruth, current: float, repeat: int, rng: np.random.Generator) -> Recording:
    truth = replace(truth, speed=truth.speed * (1 + truth.speed_error * rng.uniform(-1, 1)))
    n = math.floor(duration(truth) * truth.rate) + 1
    instants = (np.arange(n) + (rng.random() if truth.late else 0.0)) / truth.rate
    instants = instants[instants <= duration(truth)]
    stamps = np.arange(instants.size) / truth.rate
    d, stroke = motion(truth, instants)
    turns = [truth.stroke * (i % 2) for i in range(2 * truth.cycles + 1)]
    model = truth.model_at(current)
    F = model.force(d, along_strokes(d, stroke, turns, model.rho))
    F *= 1 + truth.gain_scatter * rng.standard_normal()
    F += truth.force_offset * rng.uniform(-1, 1) + truth.force_noise * rng.standard_normal(d.size)
    gauge = d + truth.gauge_noise * rng.standard_normal(d.size)
    measured = current + truth.current_noise * rng.standard_normal(d.size)
    channels = (
        Channel("displacement_axial", _quantised(gauge, truth.gauge_step), "m"),
        Channel("force_axial", _quantised(F, truth.force_lsb), "N"),
        Channel("current", _quantised(measured, 1e-3), "A"),
    )
    conditions: dict[str, Condition] = {
        "test": "axial_loop",
        "coil_current": float(current),
        "n_pads": 1.0,
        "pad_diameter": truth.pad_diameter,
        "pad_height": truth.pad_height,
        "powder_fraction": truth.powder_fraction,
        "matrix_shear_modulus": truth.matrix_shear_modulus,
        "poisson_ratio": truth.poisson_ratio,
        "flux_per_current": truth.flux_per_current,
    }
    name = f"ax_{current:g}" + (f"_{repeat + 1}" if truth.repeats > 1 else "")
    stream = Stream("axial", stamps, {channel.name: channel for channel in channels})
    return Recording(name, {"axial": stream}, conditions)


def _quantised(values: np.ndarray, step: float) -> np.ndarray:
    return np.round(values / step) * step if step > 0 else values
