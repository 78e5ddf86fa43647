"""The synthetic MRE shear rig (mre.md section 6): logs with known truth, as the sensors would give them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.overridden import overridden

if TYPE_CHECKING:
    from pipeline.rigs.mre.model.loop import Loop

_OVERSAMPLING = 10
_WARM_UP_CYCLES = 5


@dataclass(frozen=True)
class ShearTruth:
    """What the synthetic rig is made of; every field may be overridden. SI.

    Attributes
    ----------
    k1, s1, k2, alpha_bw, rho, c_bw, n_bw
        Parameters of eqs (10)-(12) at 200 N preload; `preload_k2` and `preload_k_mr` at 700 N.
    k_mr, s_mr, alpha_mr
        Field terms by current (A): added stiffness, viscous damping, and Bouc-Wen force.
    campaign
        "full" (12 runs), "smallest" (4 runs) or "none"; `preload_runs` adds the four of T6.
    gain_scatter
        Relative gain error of the force, 1 sigma, drawn for each run.
    """

    k1: float = 6.0e4
    s1: float = 1200.0
    k2: float = 2.60e5
    alpha_bw: float = 40.0
    rho: float = 4000.0
    c_bw: float = 0.8
    n_bw: float = 1.4
    k_mr: Mapping[float, float] = field(default_factory=lambda: {2.0: 7.55e4, 4.0: 1.51e5, 6.0: 2.265e5})
    s_mr: Mapping[float, float] = field(default_factory=lambda: {2.0: 120.0, 4.0: 240.0, 6.0: 360.0})
    alpha_mr: Mapping[float, float] = field(default_factory=dict)
    preload_k2: float = 4.0e5
    preload_k_mr: Mapping[float, float] = field(default_factory=lambda: {6.0: 1.755e5})

    campaign: str = "full"
    preload_runs: bool = True
    frequencies: Sequence[float] = (5.0, 10.0, 15.0)
    currents: Sequence[float] = (0.0, 2.0, 4.0, 6.0)
    amplitudes: Sequence[float] = (2e-4, 4e-4, 6e-4)
    preload_force: float = 200.0

    rate: float = 5000.0
    duration: float = 4.0
    force_noise: float = 1.0
    displacement_noise: float = 1.5e-6
    hum: float = 0.3
    force_offset: float = 2.0
    displacement_offset: float = 2e-5
    force_lsb: float = 2000 / 65536
    displacement_lsb: float = 1e-2 / 65536
    jitter: float = 5e-6
    dropouts: float = 5e-4
    force_lag: float = 60e-6
    gain_scatter: float = 0.0
    second_harmonic: float = 0.01
    third_harmonic: float = 0.015
    frequency_error: float = 1e-3

    def k2_at(self, preload: float) -> float:
        """k2 at a preload (N)."""
        return self.preload_k2 if preload > 450 else self.k2

    def k_mr_at(self, current: float, preload: float = 200.0) -> float:
        """k_MR at a current (A) and preload (N), straight between the listed currents, 0 at 0 A."""
        return _between(self.preload_k_mr if preload > 450 else self.k_mr, current)

    def s_mr_at(self, current: float) -> float:
        """s_MR at a current (A)."""
        return _between(self.s_mr, current)

    def alpha_at(self, current: float) -> float:
        """Bouc-Wen force at a current (A), N."""
        return self.alpha_bw + _between(self.alpha_mr, current)


@dataclass(frozen=True)
class ShearRun:
    """What one synthetic run is set to: frequency (Hz), amplitude X of the fundamental (m), A, N."""

    name: str
    test: str
    frequency: float
    amplitude: float
    current: float
    preload: float = 200.0


def _between(table: Mapping[float, float], current: float) -> float:
    known = {0.0: 0.0, **{float(k): float(v) for k, v in table.items()}}
    at = sorted(known)
    return float(np.interp(current, at, [known[i] for i in at]))


def shear_truth(overrides: Mapping[str, Any]) -> ShearTruth:
    """Return the truth with `overrides`; tables by current may have text keys (from YAML or JSON).

    Raises
    ------
    InputError
        If a name is unknown; names the nearest.
    """
    tables = {"k_mr", "s_mr", "alpha_mr", "preload_k_mr"}
    given: dict[str, Any] = {
        k: {float(i): float(v) for i, v in dict(value).items()} if k in tables else value
        for k, value in overrides.items()
    }
    return overridden(ShearTruth(), given, "synthetic MRE rig")


def shear_runs(truth: ShearTruth) -> list[ShearRun]:
    """Return the runs of the campaign: T5 with Latin amplitudes, then T6 at equal force amplitude."""
    runs: list[ShearRun] = []
    if truth.campaign == "full":
        levels = truth.amplitudes
        for i, current in enumerate(truth.currents):
            for j, frequency in enumerate(truth.frequencies):
                name = f"sh_{frequency:g}hz_{current:g}a"
                runs.append(ShearRun(name, "shear", frequency, levels[(i + j) % len(levels)], current))
    elif truth.campaign == "smallest":
        for name, f, X, current in (("a", 5, 6e-4, 0), ("b", 15, 2e-4, 0), ("c", 5, 2e-4, 6), ("d", 15, 6e-4, 6)):
            runs.append(ShearRun(f"sh_{name}", "shear", float(f), X, float(current)))
    elif truth.campaign != "none":
        raise InputError(f"campaign '{truth.campaign}' of the synthetic MRE rig: expected full, smallest or none.")
    if truth.preload_runs:
        states = [(200.0, 0.0), (200.0, 6.0), (700.0, 0.0), (700.0, 6.0)]
        for k, (preload, current) in enumerate(states, start=1):
            X = amplitude_for_force(truth, truth.preload_force, 2.0, current, preload)
            runs.append(ShearRun(f"pre_{k}", "preload", 2.0, X, current, preload))
    return runs


def true_force(truth: ShearTruth, run: ShearRun, X: np.ndarray, orders: int = 15, points: int = 4096) -> np.ndarray:
    """Return the steady force harmonics 1..`orders` for displacement harmonics X, without lag and noise."""
    from pipeline.rigs.mre.model.bouc_wen import closed_paths, steady_states
    from pipeline.rigs.mre.model.linear_solid import maxwell_harmonics
    from pipeline.rigs.mre.model.loop import curve

    w = steady_states(closed_paths(curve(X, points)[None]), truth.rho, truth.c_bw, truth.n_bw)[0, :, 0]
    F = truth.alpha_at(run.current) * np.fft.rfft(w)[1 : orders + 1] * 2 / points
    angular = 2 * np.pi * run.frequency * np.arange(1, X.size + 1)
    stiffness = truth.k2_at(run.preload) + truth.k_mr_at(run.current, run.preload)
    U, _ = maxwell_harmonics(X, angular, truth.s1 / truth.k1)
    F[: X.size] += truth.k1 * U + (stiffness + 1j * angular * truth.s_mr_at(run.current)) * X
    return F


def true_motion(truth: ShearTruth, run: ShearRun) -> np.ndarray:
    """Return the displacement harmonics of a run, shape (15,), m: the sine and its two small harmonics."""
    X = np.zeros(15, dtype=complex)
    X[:3] = 1.0, truth.second_harmonic * np.exp(0.7j), truth.third_harmonic * np.exp(0.3j)
    return run.amplitude * -1j * X


def true_loop(truth: ShearTruth, run: ShearRun, frequency: float | None = None) -> Loop:
    """Return the loop of a run as it is, without noise and lag, at its nominal or a given frequency (Hz)."""
    from pipeline.rigs.mre.model.loop import N_F, N_X, Loop

    run = run if frequency is None else replace(run, frequency=frequency)
    X = true_motion(truth, run)
    F = true_force(truth, run, X, N_F)
    quiet_x, quiet_f = np.zeros(N_X), np.zeros(N_F)
    kept = np.ones(N_F, dtype=bool)
    return Loop(
        run.name, run.frequency, X, F, quiet_x, quiet_f, kept, 0.0, 0.0, 0.0, 0.0, 0, 0.0, run.current, run.preload
    )


def amplitude_for_force(
    truth: ShearTruth, force: float, frequency: float, current: float, preload: float = 200.0
) -> float:
    """Return the amplitude (m) at which the steady force has half peak-to-peak `force` (N)."""
    from scipy.optimize import brentq

    from pipeline.rigs.mre.model.loop import half_range

    def excess(X: float) -> float:
        run = ShearRun("", "", frequency, X, current, preload)
        return half_range(true_force(truth, run, true_motion(truth, run), points=1024)) - force

    return float(brentq(excess, 1e-6, 1e-2, xtol=1e-12))


def synthesize_shear(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the runs of T5 and T6 as recordings; `truth` overrides any field of `ShearTruth`."""
    known = shear_truth(truth)
    streams = np.random.SeedSequence(seed).spawn(len(runs := shear_runs(known)))
    return [sine_run(known, run, np.random.default_rng(s)) for run, s in zip(runs, streams, strict=True)]


def synthesize_rich(truth: Mapping[str, Any], seed: int, current: float = 0.0, duration: float = 60.0) -> Recording:
    """Return one T8 log: 3-17 Hz chirp, amplitude swinging between 0.1 and 0.6 mm, at one current (A)."""
    known = replace(shear_truth(truth), duration=duration)
    return rich_recording(known, current, seed, rich_signals(known, current))


def rich_signals(truth: ShearTruth, current: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time (s), displacement (m) and force (N) of a T8 record as they are, oversampled; shape (n,) each."""
    fine = np.arange(round(truth.duration * truth.rate * _OVERSAMPLING)) / (truth.rate * _OVERSAMPLING)
    X = 1e-3 * (0.35 - 0.25 * np.cos(2 * np.pi * 0.23 * fine))
    x = X * np.sin(2 * np.pi * (3 + 7 * fine / truth.duration) * fine)
    return fine, x, _force_along(truth, _rich_run(current), fine, x)


def rich_recording(
    truth: ShearTruth, current: float, seed: int, signals: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> Recording:
    """Return those signals as the rig's sensors give them."""
    fine, x, force = signals
    return _recording(truth, _rich_run(current), np.random.default_rng(seed), fine, x, force, 0.0, truth.duration)


def _rich_run(current: float) -> ShearRun:
    return ShearRun(f"rich_{current:g}a", "shear_rich", float("nan"), float("nan"), current)


def sine_run(truth: ShearTruth, run: ShearRun, rng: np.random.Generator) -> Recording:
    """Return one harmonic run as the rig's sensors give it."""
    frequency = run.frequency * (1 + truth.frequency_error * rng.uniform(-1, 1))
    warm_up = _WARM_UP_CYCLES / frequency
    fine = np.arange(math.ceil((warm_up + truth.duration) * truth.rate * _OVERSAMPLING)) / (truth.rate * _OVERSAMPLING)
    a = 2 * np.pi * frequency * fine + rng.uniform(0, 2 * np.pi)
    second, third = truth.second_harmonic, truth.third_harmonic
    x = run.amplitude * (np.sin(a) + second * np.sin(2 * a + 0.7) + third * np.sin(3 * a + 0.3))
    return _recording(truth, run, rng, fine, x, _force_along(truth, run, fine, x), warm_up, truth.duration)


def _force_along(truth: ShearTruth, run: ShearRun, time: np.ndarray, x: np.ndarray) -> np.ndarray:
    from pipeline.rigs.mre.model.bouc_wen import along, path_through
    from pipeline.rigs.mre.model.linear_solid import maxwell_along

    w = along(path_through(x), truth.rho, truth.c_bw, truth.n_bw, sensitivities=False)[:, 0]
    u = maxwell_along(time, x, truth.s1 / truth.k1)[:, 0]
    stiffness = truth.k2_at(run.preload) + truth.k_mr_at(run.current, run.preload)
    velocity = np.gradient(x, time)
    force = truth.k1 * u + stiffness * x + truth.s_mr_at(run.current) * velocity + truth.alpha_at(run.current) * w
    return np.asarray(force)


def _recording(
    truth: ShearTruth,
    run: ShearRun,
    rng: np.random.Generator,
    fine: np.ndarray,
    x: np.ndarray,
    force: np.ndarray,
    start: float,
    duration: float,
) -> Recording:
    """Sample the true signals as the rig does: jitter, dropouts, lag, gain, noise, hum, offsets, steps."""
    stamps = np.arange(round(duration * truth.rate)) / truth.rate
    stamps = stamps[rng.random(stamps.size) >= truth.dropouts]
    n = stamps.size
    # The stamps are what is logged; the samples were taken a little beside them.
    instants = start + stamps + truth.jitter * rng.standard_normal(n)
    x_seen = np.interp(instants, fine, x) + truth.displacement_noise * rng.standard_normal(n)
    x_seen += truth.displacement_offset * rng.uniform(-1, 1)
    gain = 1 + truth.gain_scatter * rng.standard_normal()
    f_seen = gain * np.interp(instants - truth.force_lag, fine, force) + truth.force_noise * rng.standard_normal(n)
    f_seen += truth.hum * np.sin(2 * np.pi * 50.0 * stamps + rng.uniform(0, 2 * np.pi))
    f_seen += truth.force_offset * rng.uniform(-1, 1)
    current = run.current + 0.01 * rng.standard_normal(n)
    channels = (
        Channel("displacement", _quantised(x_seen, truth.displacement_lsb), "m"),
        Channel("force", _quantised(f_seen, truth.force_lsb), "N"),
        Channel("current", _quantised(current, 1e-3), "A"),
    )
    conditions: dict[str, Condition] = {
        "test": run.test,
        "coil_current": run.current,
        "preload": run.preload,
        "frequency": run.frequency,
        "amplitude": run.amplitude,
        "n_pads": 2.0,
        "pad_diameter": 0.05,
        "pad_height": 0.006,
    }
    kept = {k: v for k, v in conditions.items() if not (isinstance(v, float) and math.isnan(v))}
    stream = Stream("shear", stamps, {channel.name: channel for channel in channels})
    return Recording(run.name, {"shear": stream}, kept)


def _quantised(values: np.ndarray, step: float) -> np.ndarray:
    return np.round(values / step) * step if step > 0 else values
