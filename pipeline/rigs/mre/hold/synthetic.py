"""The synthetic hold test (mre.md section 6, T2 and T4): a staircase of the coil current up and down, force and field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.mre.hold.law import force, saturation
from pipeline.rigs.overridden import overridden

_COIL = 0.03  # s
_FINE = 0.005  # s


@dataclass(frozen=True)
class HoldTruth:
    """What the synthetic hold test is made of; every field may be overridden. SI.

    Attributes
    ----------
    force_initial, force_gain, saturation_current, sharpness, relaxation
        F0, a, I_s, p, r of the force law.
    flux_slope, flux_saturation, flux_sharpness, remanence_up, remanence_down
        s0, B_s, p, b of the field law.
    largest_current, current_step, hold_duration, ramp, down
        Levels 0, `current_step`, ... to the largest (and back where `down`), seconds at each, seconds from one to the next.
    rise, fall
        Time constants with which the force follows the current, s; 0 for none.
    hold_scatter
        Standard deviation of an error of the force that stays for one hold, N.
    field
        "same" log, its "own" log, or "none"; `blank` adds a log with a spacer in place of the pad.
    pull
        Force of the poles at B_s that the load cell sees, N (in the log and in the blank).
    heating
        Kelvin that the coil heats by in the end; the voltage shows it.
    """

    force_initial: float = 200.0
    force_gain: float = 0.65
    saturation_current: float = 5.7
    sharpness: float = 12.0
    relaxation: float = 0.02
    flux_slope: float = 0.158
    flux_saturation: float = 0.95
    flux_sharpness: float = 4.0
    remanence_up: float = 0.006
    remanence_down: float = 0.012
    largest_current: float = 8.0
    smallest_current: float = 0.0
    current_step: float = 0.5
    hold_duration: float = 10.0
    ramp: float = 0.0
    down: bool = True
    rise: float = 0.14
    fall: float = 0.49
    rate: float = 10.0
    force_noise: float = 1.0
    noise_memory: float = 0.0
    hold_scatter: float = 0.0
    flux_noise: float = 2e-3
    current_noise: float = 0.01
    gauge_step: float = 1e-5
    resistance: float = 6.9
    heating: float = 6.0
    field: str = "same"
    blank: bool = False
    pull: float = 0.0


def hold_truth(overrides: Mapping[str, Any]) -> HoldTruth:
    """Return the truth with `overrides`.

    Raises
    ------
    InputError
        If a name is unknown; names the nearest.
    """
    return overridden(HoldTruth(), overrides, "synthetic hold test")


def true_flux(truth: HoldTruth, current: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Return B(I), T; `down` tells which samples belong to the sweep down."""
    z = truth.flux_slope * current / truth.flux_saturation
    b = np.where(down, truth.remanence_down, truth.remanence_up)
    return np.asarray(truth.flux_saturation * saturation(z, truth.flux_sharpness) + b)


def synthesize(truth: Mapping[str, Any], seed: int) -> list[Recording]:
    """Return the hold test, and a field map and a blank test of their own where asked for."""
    known = hold_truth(truth)
    rng = np.random.default_rng(seed)
    runs = [_log(known, "hold", "hold_sweep", rng, with_field=known.field == "same")]
    if known.field == "own":
        runs.append(_log(known, "field", "field_map", rng, with_force=False))
    if known.blank:
        runs.append(_log(known, "blank", "blank", rng, with_field=False, pad=False))
    return runs


def _log(
    truth: HoldTruth,
    name: str,
    test: str,
    rng: np.random.Generator,
    *,
    with_force: bool = True,
    with_field: bool = True,
    pad: bool = True,
) -> Recording:
    up = np.arange(truth.smallest_current, truth.largest_current + 1e-9, truth.current_step)
    levels = np.r_[up, up[-2::-1]] if truth.down else up
    duration = levels.size * truth.hold_duration
    fine = np.arange(0, duration + 0.5, _FINE)
    hold = np.minimum((fine / truth.hold_duration).astype(int), levels.size - 1)
    before = levels[np.maximum(hold - 1, 0)]
    part = np.clip((fine - hold * truth.hold_duration) / max(truth.ramp, 1e-9), 0, 1)
    current = _lagged(fine, before + (levels[hold] - before) * part, _COIL, _COIL)
    time = np.arange(round(duration * truth.rate)) / truth.rate
    down = np.interp(time, fine, hold) >= up.size
    seen = np.interp(time, fine, current)
    channels = [Channel("current", seen + truth.current_noise * rng.standard_normal(time.size), "A")]
    acting = np.interp(time, fine, _lagged(fine, current, truth.rise, truth.fall))
    if with_force:
        F = np.full(time.size, truth.force_initial)
        if pad:
            law = (truth.force_gain, truth.saturation_current, truth.sharpness, truth.relaxation)
            F = force(acting, np.maximum(time, 0.05), truth.force_initial, *law)
        F = F + truth.pull * (true_flux(truth, acting, down) / truth.flux_saturation) ** 2
        F = F + truth.hold_scatter * rng.standard_normal(levels.size)[np.interp(time, fine, hold).astype(int)]
        F = F + _noise(rng, time.size, truth.force_noise, truth.noise_memory * truth.rate)
        channels.append(Channel("force_axial", F, "N"))
        gap = np.full(time.size, 0.39e-3)
        channels.append(Channel("displacement_axial", np.round(gap / truth.gauge_step) * truth.gauge_step, "m"))
    if with_field:
        B = true_flux(truth, seen, down) + truth.flux_noise * rng.standard_normal(time.size)
        channels.append(Channel("flux_density", B, "T"))
    hot = 1 + 0.0039 * truth.heating * np.cumsum(seen**2) / max(float(np.sum(seen**2)), 1e-9)
    volts = truth.resistance * seen * hot + 0.05 * rng.standard_normal(time.size)
    channels.append(Channel("voltage", volts, "V"))
    conditions: dict[str, Condition] = {"test": test, "gap_held": True, "n_pads": 1.0}
    conditions |= {"pad_diameter": 0.05, "pad_height": 0.006, "preload": truth.force_initial}
    conditions |= {"powder_fraction": 0.25, "matrix_shear_modulus": 0.3e6, "poisson_ratio": 0.2}
    return Recording(name, {"axial": Stream("axial", time, {c.name: c for c in channels})}, conditions)


def _lagged(time: np.ndarray, values: np.ndarray, rise: float, fall: float) -> np.ndarray:
    """Return a first-order lag with one time constant up and another down."""
    out = np.empty_like(values)
    out[0] = values[0]
    gain_up, gain_down = (1 - np.exp(-_FINE / tau) if tau > 0 else 1.0 for tau in (rise, fall))
    y = float(values[0])
    for k in range(1, time.size):
        off = values[k] - y
        y += (gain_up if off > 0 else gain_down) * off
        out[k] = y
    return out


def _noise(rng: np.random.Generator, n: int, sigma: float, memory: float) -> np.ndarray:
    """Return noise of standard deviation `sigma`, first-order with `memory` samples where that is above 0."""
    white = rng.standard_normal(n)
    if memory <= 0:
        return np.asarray(sigma * white)
    from scipy.signal import lfilter

    a = float(np.exp(-1 / memory))
    return np.asarray(sigma * lfilter([np.sqrt(1 - a * a)], [1.0, -a], white))
