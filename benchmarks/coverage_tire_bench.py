"""Do the 95 % intervals of tire.bench hold the truth 95 times in 100? Complete campaigns, from logs to findings.

    python -m benchmarks.coverage_tire_bench [SEEDS] [--case short] [--first 0]

"short" and "full" have everything told right, and no type B: errors by noise, waves of load and speed alone. In "combined"
load cell, pressure, sensor lengths and free radius are off by draws of their standard uncertainties, and these are in the
intervals. In "scattered" pressure and gain differ from run to run, unseen. The calibration is compared with the quadratic
through the true peaks at the campaign's loads.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Mapping
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate
from pipeline.findings import Parameter
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.tire.bench.declaration import BENCH, BenchSettings
from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.sensor import Sensor, flex_shape, voltage_slope
from pipeline.rigs.tire.synthetic.rig import synthesize_bench
from pipeline.rigs.tire.synthetic.runs import KMH, RUNS
from pipeline.rigs.tire.synthetic.truth import bench_truth, ring_of

SHORT = 10.0
CASES: dict[str, dict[str, Any]] = {
    "short": {"duration": SHORT},
    "full": {},
    "combined": {"duration": SHORT},
    "scattered": {"duration": SHORT},
}
# Relative standard uncertainties that "combined" draws from, as the settings have them.
LOAD_GAIN_U, PRESSURE_U, LENGTH_U, RADIUS_U = 0.005, 0.01, 0.04, 0.005
PRESSURE_SCATTER, GAIN_SCATTER = 0.003, 0.002
EXACT = {"load_gain_u": 1e-6, "pressure_u": 1e-6, "free_radius_u": 1e-6}


def main() -> None:
    options = parser(__doc__ or "", seeds=40)
    options.add_argument("--case", choices=tuple(CASES), action="append", help="one or more; by default all")
    arguments = options.parse_args()
    for name in arguments.case or CASES:
        print(f"\n{name}, {arguments.seeds} seeds")
        print(table(study(name, seeds_of(arguments))))


def study(case: str, seeds: range) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every estimate with its truth, by name; those of all loads and runs together."""
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    settings = BenchSettings() if case in ("combined", "scattered") else BenchSettings(**EXACT)
    known: dict[float, Mapping[tuple[str, float], float]] = {}
    for seed in seeds:
        truth, recordings = campaign(case, seed)
        radius = float(truth.get("Ro", 0.0))
        if radius not in known:
            known[radius] = true_values(truth)
        for p in BENCH.identify(recordings, settings, Context("coverage", {})).parameters:
            true = known[radius].get((p.name, _load(p)))
            if true is not None:
                found[p.name].append((Estimate(p.name, p.value, p.std_error, p.ci95), true))
    return found


def campaign(case: str, seed: int) -> tuple[dict[str, Any], list[Recording]]:
    """Return what is true of all runs, and the logs."""
    truth = dict(CASES[case])
    rng = np.random.default_rng((seed, 7))
    plain = bench_truth({})
    if case == "combined":
        load, pressure, flex, film, radius = rng.standard_normal(5)
        truth["load_scale"] = 1.0 + LOAD_GAIN_U * load
        truth["Ro"] = plain.Ro * (1.0 + RADIUS_U * radius)
        truth["told"] = {
            "inflation_pressure": plain.inflation_pressure * (1.0 + PRESSURE_U * pressure),
            "sensor_length_flex": plain.flex_length * (1.0 + LENGTH_U * flex),
            "sensor_length_pvdf": plain.film_length * (1.0 + LENGTH_U * film),
        }
    if case != "scattered":
        return truth, synthesize_bench(truth, seed)
    logs = []
    for run in RUNS:
        pressure, gain = rng.standard_normal(2)
        own = {
            "runs": [run],
            "inflation_pressure": plain.inflation_pressure * (1.0 + PRESSURE_SCATTER * pressure),
            "c": plain.c * (1.0 + GAIN_SCATTER * gain),
            "film_gain": plain.film_gain,
            "told": {"inflation_pressure": plain.inflation_pressure},
        }
        logs += synthesize_bench({**truth, **own}, seed)
    return truth, logs


def true_values(overrides: Mapping[str, Any]) -> dict[tuple[str, float], float]:
    """Return the truth by name and load (0 where there is none)."""
    t = bench_truth({**overrides, "load_scale": 1.0})
    values = {
        "rolling_radius": t.R, "bending_stiffness": t.EI, "belt_width": t.b, "foundation_radial": t.kw, "foundation_tangential": t.kv,
        "tread_stiffness": t.kt, "loss_factor": t.eta, "sensor_gain": t.c, "sensor_lag": t.flex_lag, "pvdf_gain": t.film_gain * t.h / (2.0 * t.c),
        "pvdf_time_constant": t.film_time_constant, "pvdf_offset_angle": t.film_offset_angle,
    }  # fmt: skip
    found = {(name, 0.0): value for name, value in values.items()}
    ring = compliance(ring_of(t), 8192)
    loads = np.array([1000.0, 1500.0, 2000.0, 2500.0, 3000.0])
    peaks = []
    sensor = Sensor(t.c, 0.0, t.flex_length, t.flex_lag)
    for load in loads:
        contact = pressed(ring, t.kt, t.Ro, float(load))
        found["contact_length", float(load)] = contact.length
        near = flex_shape(contact.shape, sensor, t.R, 10.0 * KMH / t.R).at(np.linspace(-0.02, 0.02, 401))
        peaks.append(float(near.max()))
    a2, a1, a0 = np.polyfit(loads, peaks, 2)
    for k, value in enumerate((a0, a1, a2)):
        found[f"calibration_{k}", 0.0] = float(value)
    middle = 0.5 * (loads[0] + loads[-1])
    level = np.asarray(t.R0 + np.polyval([a2, a1, a0], middle))
    slope = voltage_slope(level, t.supply_voltage, t.divider_resistance)
    found["load_sensitivity", 0.0] = float(slope) * float(a1 + 2.0 * a2 * middle)
    return found


def _load(p: Parameter) -> float:
    return float(p.at.get("load", 0.0))


if __name__ == "__main__":
    main()
