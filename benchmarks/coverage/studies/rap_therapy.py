"""`rap.therapy`: a therapy and a tank in motion, with all the dirt of device, bench and scale.

In "standard" nothing of the rig is the same twice. Largest error of the temperature and rms error of the volume have no
truth there; in "statistics" only the dirt is drawn anew, and their mean over the campaigns is taken for true. The therapy
takes 2.5 h instead of 312 min and the second unit's pressures are left out, for the time that it costs.

The rms error of the volume comes out too wide: the scale's clock is hardly told while the tank is too empty to show a start,
and its error then holds half a minute of a clock, which does not scatter between these campaigns. So does the gain of the
ultrafiltrate pump: one run of a few hours hardly tells how far and how slowly a gain wanders, so its error averages over what
is plausible (memories from 10 min to 4 h), while each pump here wanders by 1 % within an hour as the sheet's does. Moments of
alarms and mismatches are those at which a rule of the sheet is met, to the second on which it looks: they have no other truth,
and the tests hold them against the moment of the fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks.coverage.dirt import coloured
from benchmarks.coverage.rap_logs import (
    METER_U,
    QUIET,
    SCALE_U,
    UNEVEN,
    label,
    lossy,
    meters_off,
    pressure_noise,
    varied,
)
from benchmarks.coverage.study import OVER_SEEDS, Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.recording import Recording
from pipeline.rigs.rap.synthetic import rig
from pipeline.rigs.rap.synthetic.therapy_truth import RUNS, TherapyTruth, therapy_truth
from pipeline.rigs.rap.therapy.declaration import THERAPY

_DIRT = (
    "white and coloured noise of pressures, echoes and scale, wild echoes, converter steps, jitter of 2 ms on all clocks, lost "
    "samples, a pump gain that wanders"
)
CASES = {
    "standard": Case(
        f"another device, tank attitude and battery load in each campaign; {_DIRT}; meter off by {100 * METER_U:g} %, scale by "
        f"{100 * SCALE_U:g} % (1 sigma, stated)"
    ),
    "statistics": Case(f"one rig with a scale as stated: {_DIRT}; what measures these"),
}
STATISTICS = ("temperature_error_max", "uf_volume_error_rms")
SHORT: dict[str, Any] = {
    "runs": list(RUNS[:2]),
    "duration": 9000.0,
    "zero_time": 240.0,
    "stop_time": 120.0,
    "prot": False,
}
_ECHO_NOISE, _ECHO_MEMORY, _SCALE_NOISE, _SCALE_MEMORY = 0.5e-3, 20.0, 0.5e-3, 60.0
QUIET_THERAPY = {name: value for name, value in QUIET.items() if hasattr(TherapyTruth(), name)}


def campaign(case: str, seed: int) -> Campaign:
    """Return the logs of R4 and R5 and what is true of them."""
    rng = np.random.default_rng((seed, 93))
    overrides: dict[str, Any] = {**UNEVEN, **SHORT}
    if case == "statistics":
        overrides["told"] = {"flowmeter_gain_u": 0.0, "scale_gain_u": 0.0}
    else:
        overrides |= varied(rng, TherapyTruth())
        overrides |= meters_off(rng, "flowmeter_gain_u", "scale_gain_u")
        overrides |= _conditions(rng)
    recordings = rig.synthesize_therapy(overrides, seed)
    recordings = coloured(recordings, rng, pressure_noise(), memory=2.0)
    recordings = coloured(recordings, rng, {"uf_level_distance": _ECHO_NOISE}, memory=_ECHO_MEMORY)
    recordings = coloured(recordings, rng, {"uf_mass_scale": _SCALE_NOISE}, memory=_SCALE_MEMORY)
    recordings = lossy(recordings, rng, "device", "bench", "device_status", "scale")
    if case == "statistics":
        return Campaign(recordings, lambda p: OVER_SEEDS if p.name in STATISTICS else None, label=label)
    return Campaign(recordings, known(overrides, seed), bound=_bound(overrides), label=label)


def _conditions(rng: np.random.Generator) -> dict[str, Any]:
    """Return another room, attitude, load of the battery and ultrafiltrate pump."""
    draw = rng.standard_normal(9)
    return {
        "temperature_initial": 298.15 + 0.5 * draw[0], "temperature_final": 303.15 + 0.5 * draw[1],
        "temperature_time": 1200.0 * math.exp(0.1 * draw[2]), "temperature_offset": 0.8 + 0.3 * draw[3],
        "pitch": math.radians(1.5 * draw[4]), "roll": math.radians(1.5 * draw[5]), "power": 13.9 + 0.5 * draw[6],
        "pump_gain": 0.98 + 0.03 * draw[7], "fouling": 0.25 + 0.1 * float(np.clip(draw[8], -2.0, 2.0)),
    }  # fmt: skip


def known(overrides: Mapping[str, Any], seed: int) -> Callable[[Parameter], float | None]:
    """Return the truth: volume and energy as they were in that run."""
    t = therapy_truth(overrides)
    quiet = {run.run: run for run in rig.synthesize_therapy({**overrides, **QUIET_THERAPY}, seed)}

    def truth(p: Parameter) -> float | None:
        run = quiet.get(str(p.at.get("run", t.runs[0])))
        if run is None:
            return None
        if p.name.startswith("temperature_") or p.name == "time_constant":
            offset = t.temperature_offset if p.at.get("source") == "rap" else 0.0
            values = {"temperature_initial": t.temperature_initial + offset,
                      "temperature_final": t.temperature_final + offset, "time_constant": t.temperature_time}  # fmt: skip
            return values.get(p.name)
        return _of_run(p.name, run, t)

    return truth


def _of_run(name: str, run: Recording, t: TherapyTruth) -> float | None:
    if name in ("k_uf_initial", "k_uf_decline"):
        return t.K_uf if name == "k_uf_initial" else t.fouling
    if name == "uf_volume_final":
        return float((run.values("uf_mass_scale")[-1] - t.scale_tare) / t.fluid_density)
    if name == "uf_pump_gain":
        return t.pump_gain
    if name in ("energy_used", "runtime_projected") and "battery_voltage" in run:
        time, volts = run.signal("battery_voltage")
        energy = float(np.trapezoid(volts * run.values("battery_current"), time))
        full = t.battery_efficiency * t.battery_energy
        return energy if name == "energy_used" else full / t.power
    return None


def _bound(overrides: Mapping[str, Any]) -> Callable[[Parameter], float | None]:
    """Return the bound of eq. 7 from noisy readings and of the energy from noisy volts and amperes."""
    t = therapy_truth(overrides)
    noise = {"rap": (t.temperature_noise, t.temperature_lsb), "bench": (t.bench_temperature_noise, t.bench_temperature_lsb)}  # fmt: skip

    def bound(p: Parameter) -> float | None:
        end = t.zero_time + t.duration + t.stop_time if p.at.get("run", RUNS[0]) == RUNS[0] else t.motion_duration
        if p.name == "energy_used":
            return t.power * math.sqrt(2.0 * end) * t.battery_noise
        order = ("temperature_initial", "temperature_final", "time_constant")
        if p.name not in order or "source" not in p.at:
            return None
        time = np.append(np.arange(0.0, 0.999 * end, t.temperature_step), end)
        fallen = np.exp(-time / t.temperature_time)
        rise = t.temperature_final - t.temperature_initial
        J = np.stack([fallen, 1.0 - fallen, -rise * time / t.temperature_time**2 * fallen], axis=1)
        white, lsb = noise[str(p.at["source"])]
        covariance = np.linalg.inv(J.T @ J) * (white**2 + lsb**2 / 12.0)
        return float(np.sqrt(covariance[order.index(p.name), order.index(p.name)]))

    return bound


STUDY = Study(THERAPY, CASES, campaign)
