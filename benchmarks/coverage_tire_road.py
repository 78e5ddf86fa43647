"""Do the 95 % intervals of tire.road hold the truth 95 times in 100? By simulation, from the bench on.

    python -m benchmarks.coverage_tire_road [SEEDS] [--case drive] [--first 0]

Each seed has a bench campaign of its own, with the errors that its uncertainties stand for (load cell, pressure, length
of the sensor), and a drive that is identified with it. Truth is load and force at the passage. What the bench leaves
uncertain is common to a drive: its revolutions count as one draw in that.
"""

from __future__ import annotations

import os
from collections import defaultdict
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate, estimate
from pipeline.findings import Findings
from pipeline.rigs.experiment import Context
from pipeline.rigs.tire.bench.declaration import BENCH
from pipeline.rigs.tire.road.declaration import ROAD
from pipeline.rigs.tire.synthetic.motion import road_motion
from pipeline.rigs.tire.synthetic.rig import synthesize_bench, synthesize_road
from pipeline.rigs.tire.synthetic.truth import bench_truth, road_truth

_KMH = 1.0 / 3.6
CASES: dict[str, dict[str, Any]] = {
    "drive": {},
    "losses": {"loss": 0.1, "burst": 12.0},
    "slow": {"speeds": [[0.0, 20.0 * _KMH], [15.0, 20.0 * _KMH], [18.0, 30.0 * _KMH]], "pulses": [[25.0, 2.0, 500.0]]},
}
# Standard uncertainties that the bench takes where a campaign states none (tire.md, 5).
_LOAD_GAIN, _PRESSURE, _LENGTH = 0.005, 0.01, 0.01
_QUANTITIES = (("vertical_load", "Fz"), ("longitudinal_force", "Fx"))
_CENTRES = {"vertical": (18.0, 20.0, 23.0, 26.0), "longitudinal": (11.85, 32.1)}
UNITS = {
    **{f"{name}{kind}": (1.0, "N") for name, _ in _QUANTITIES for kind in ("", " filtered", " random")},
    **{f"event_time {kind}": (1e-3, "ms") for kind in _CENTRES},
}


def main() -> None:
    options = parser(__doc__ or "", 10)
    options.add_argument("--case", choices=tuple(CASES), action="append", help="one or more; by default all")
    arguments = options.parse_args()
    benches = {seed: bench_of(seed) for seed in seeds_of(arguments)}
    for name in arguments.case or CASES:
        print(f"\n{name}, {arguments.seeds} seeds")
        print(table(study(CASES[name], benches), UNITS), flush=True)


def bench_of(seed: int) -> Findings:
    """Return a bench campaign whose load cell, pressure gauge and ruler are off by what they are uncertain of."""
    truth, rng = bench_truth({}), np.random.default_rng((seed, 7))
    gain, pressure, length = 1.0 + rng.standard_normal(3) * (_LOAD_GAIN, _PRESSURE, _LENGTH)
    told = {
        "inflation_pressure": float(pressure * truth.inflation_pressure),
        "sensor_length_flex": float(length * truth.flex_length),
    }
    runs = synthesize_bench({"load_scale": float(gain), "told": told}, seed)
    return BENCH.identify(runs, BENCH.settings(), Context("bench", {}))


def study(overrides: dict[str, Any], benches: dict[int, Findings]) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every revolution's numbers and every event with its truth."""
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    known = road_truth(overrides)
    for seed, bench in benches.items():
        told = {"sensor_length_flex": bench.runs[0].conditions["sensor_length_flex"]}
        pressure = 1.0 + _PRESSURE * np.random.default_rng((seed, 8)).standard_normal()
        told["inflation_pressure"] = float(pressure * known.inflation_pressure)
        recordings = synthesize_road({**overrides, "told": told}, seed)
        findings = ROAD.identify(recordings, ROAD.settings(), Context("drive", {"bench": bench}))
        motion = road_motion(known, np.random.default_rng((seed, known.number)))
        _revolutions(found, findings, motion)
        if overrides.get("pulses") is None and "speeds" not in overrides:
            _events(found, findings)
    return found


def _revolutions(found: dict[str, list[tuple[Estimate, float]]], findings: Findings, motion: Any) -> None:
    table_, evidence = findings.arrays["revolutions"], findings.arrays["evidence"]
    time = table_["time"].to_numpy()
    for name, quantity in _QUANTITIES:
        true = motion.at(quantity, time)
        random = evidence["load_random" if quantity == "Fz" else "force_random"]
        # What the bench leaves uncertain moves a drive as a whole: without its mean, random errors are left.
        off = table_[name] - true
        for label, values, errors in (
            (name, table_[name], table_[f"{name}_se"]),
            (f"{name} filtered", table_[f"{name}_filtered"], table_[f"{name}_se_filtered"]),
            (f"{name} random", table_[name] - _common(off.to_numpy(), true), random),
        ):
            for value, error, truth in zip(values, errors, true, strict=True):
                if np.isfinite(value) and np.isfinite(error):
                    found[label].append((estimate(label, float(value), float(error)), float(truth)))


def _common(off: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return what of the errors is in proportion to the quantity, and their mean, by least squares."""
    known = np.isfinite(off)
    A = np.column_stack([np.ones(true.size), true])
    return np.asarray(A @ np.linalg.lstsq(A[known], off[known], rcond=None)[0])


def _events(found: dict[str, list[tuple[Estimate, float]]], findings: Findings) -> None:
    for kind, centres in _CENTRES.items():
        told = findings.find("event_time", kind=kind)
        for centre in centres:
            near = min(told, key=lambda p: abs((p.value or 0.0) - centre), default=None)
            if near is not None and near.value is not None:
                found[f"event_time {kind}"].append((Estimate(near.name, near.value, near.std_error, near.ci95), centre))


if __name__ == "__main__":
    main()
