"""The synthetic step test (mre.md section 6, T3): coil current switched on and off at a fixed gap, force and current logged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.mre.step.lags import lag
from pipeline.rigs.overridden import overridden

_FINE = 2e-4  # s


@dataclass(frozen=True)
class StepTruth:
    """What the synthetic step test is made of; every field may be overridden. SI.

    Attributes
    ----------
    delay_rise, tau1_rise, tau2_rise, delay_fall, tau1_fall, tau2_fall
        L, tau1, tau2 of each direction; tau2 0 for one lag only.
    creep
        Force lost in each decade of 1 + t, N.
    gain
        Force for each ampere, N/A.
    times, levels
        When the set-point changes, and to what (A); it is 0 before.
    coil
        Time constant of the coil, s.
    logged
        "measured" or "set_point": which current the log holds.
    force_filter
        Corner of a second-order low-pass in the force channel alone, Hz; 0 for none.
    """

    delay_rise: float = 0.02
    tau1_rise: float = 0.10
    tau2_rise: float = 0.04
    delay_fall: float = 0.02
    tau1_fall: float = 0.45
    tau2_fall: float = 0.04
    force_initial: float = 200.0
    gain: float = 20.9
    creep: float = 1.2
    coil: float = 0.03
    times: Sequence[float] = field(default_factory=lambda: (1.0, 6.0))
    levels: Sequence[float] = field(default_factory=lambda: (6.0, 0.0))
    duration: float = 14.0
    rate: float = 1000.0
    force_noise: float = 1.0
    noise_memory: float = 0.0
    current_noise: float = 0.01
    force_lsb: float = 0.0
    force_filter: float = 0.0
    logged: str = "measured"


def step_truth(overrides: Mapping[str, Any]) -> StepTruth:
    """Return the truth with `overrides`.

    Raises
    ------
    InputError
        If a name is unknown (names the nearest), or times and levels do not match.
    """
    truth = overridden(StepTruth(), overrides, "synthetic step test")
    if len(truth.times) != len(truth.levels):
        raise InputError(
            f"the synthetic step test has {len(truth.times)} times but {len(truth.levels)} levels; give one level a time."
        )
    return truth


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the step test as one run; `truth` overrides any field of `StepTruth`."""
    known = step_truth(truth)
    rng = np.random.default_rng(seed)
    fine = np.arange(0, known.duration + _FINE, _FINE)
    command = np.zeros(fine.size)
    force = np.full(fine.size, known.force_initial)
    before = 0.0
    for at, level in zip(known.times, known.levels, strict=True):
        part = np.where(fine >= at, level - before, 0.0)
        command += part
        force += known.gain * through_lags(known, part, rising=level > before)
        before = level
    current = lag(command, known.coil, _FINE)
    force -= known.creep * np.log10(1 + fine)
    if known.force_filter > 0:
        corner = 1 / (2 * np.pi * known.force_filter)
        force = lag(lag(force, corner, _FINE), corner, _FINE)
    time = np.arange(round(known.duration * known.rate)) / known.rate
    F = np.interp(time, fine, force) + _noise(rng, time.size, known)
    F = np.round(F / known.force_lsb) * known.force_lsb if known.force_lsb > 0 else F
    measured = np.interp(time, fine, current) + known.current_noise * rng.standard_normal(time.size)
    steps = np.searchsorted(np.asarray(known.times, dtype=float), time + 1e-9, side="right")
    set_point = np.r_[0.0, known.levels][steps]
    logged = set_point if known.logged == "set_point" else measured
    channels = (Channel("current", logged, "A"), Channel("force_axial", F, "N"))
    conditions: dict[str, Condition] = {
        "test": "step",
        "gap_held": True,
        "n_pads": 1.0,
        "pad_diameter": 0.05,
        "pad_height": 0.006,
        "preload": known.force_initial,
    }
    return [Recording("step", {"axial": Stream("axial", time, {c.name: c for c in channels})}, conditions)]


def through_lags(truth: StepTruth, command: np.ndarray, *, rising: bool) -> np.ndarray:
    """Return what the pad answers to a command on the fine grid, for a gain of 1."""
    L, *taus = (
        (truth.delay_rise, truth.tau1_rise, truth.tau2_rise)
        if rising
        else (truth.delay_fall, truth.tau1_fall, truth.tau2_fall)
    )
    y = lag(command, truth.coil, _FINE)
    for tau in taus:
        y = lag(y, tau, _FINE)
    grid = np.arange(y.size) * _FINE
    return np.asarray(np.interp(grid - L, grid, y, left=0.0))


def true_times(truth: StepTruth, *, rising: bool) -> tuple[float, float]:
    """Return t63 and t90 of the force, counted from the onset of the current, s."""
    grid = np.arange(0, 20.0, _FINE)
    # The lag starts at its input: one sample at rest first, from which the input is a ramp to the next.
    y = through_lags(truth, np.r_[0.0, np.ones(grid.size - 1)], rising=rising)
    grid -= 0.5 * _FINE
    return float(np.interp(1 - np.exp(-1), y, grid)), float(np.interp(0.9, y, grid))


def _noise(rng: np.random.Generator, n: int, truth: StepTruth) -> np.ndarray:
    white = rng.standard_normal(n)
    if truth.force_filter > 0:
        corner = 1 / (2 * np.pi * truth.force_filter)
        white = lag(lag(white, corner, 1 / truth.rate), corner, 1 / truth.rate)
        return np.asarray(truth.force_noise * white / white.std())
    memory = truth.noise_memory * truth.rate
    if memory <= 0:
        return np.asarray(truth.force_noise * white)
    from scipy.signal import lfilter

    a = float(np.exp(-1 / memory))
    return np.asarray(truth.force_noise * lfilter([np.sqrt(1 - a * a)], [1.0, -a], white))
