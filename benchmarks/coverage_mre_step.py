"""Do the 95 % intervals of mre.step hold the truth 95 times in 100? By simulation, with known truth.

    python -m benchmarks.coverage_mre_step [SEEDS] [--case standard] [--first 0]

A set-point in place of the measured current has no case: delay and second lag are withheld then, as the findings say.
"""

from __future__ import annotations

import os
from collections import defaultdict
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate
from pipeline.findings import Parameter
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.step.declaration import StepSettings
from pipeline.rigs.mre.step.identify import identify
from pipeline.rigs.mre.step.synthetic import StepTruth, step_truth, synthesize, true_times

CASES: dict[str, dict[str, Any]] = {
    "standard": {},
    "coloured noise, memory 5 ms": {"noise_memory": 0.005},
    "100 Hz": {"rate": 100.0},
    "10 Hz": {"rate": 10.0},
    "one lag, no delay": {"tau2_rise": 0.0, "tau2_fall": 0.0, "delay_rise": 0.0, "delay_fall": 0.0},
    "cut 1 s after the fall": {"duration": 7.0},
}


def main() -> None:
    options = parser(__doc__ or "")
    options.add_argument("--case", choices=tuple(CASES), action="append", help="one or more; by default all")
    arguments = options.parse_args()
    for name in arguments.case or CASES:
        print(f"\n{name}, {arguments.seeds} seeds")
        found = study(CASES[name], seeds_of(arguments))
        print(table(found, {key: (1e-3, "ms") for key in found if key.split()[0] != "creep"}))


def study(overrides: dict[str, Any], seeds: range) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every estimate with its truth, by name and direction."""
    truth = step_truth(overrides)
    times = {"rise": true_times(truth, rising=True), "fall": true_times(truth, rising=False)}
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    for seed in seeds:
        for p in identify(synthesize(overrides, seed), StepSettings(), Context("coverage", {})).parameters:
            if p.name == "force_step":
                continue
            told = Estimate(p.name, p.value, p.std_error, p.ci95)
            name = f"{p.name} {p.at['direction']}" if p.at else p.name
            found[name].append((told, true_value(truth, times, p)))
    return found


def true_value(truth: StepTruth, times: dict[str, tuple[float, float]], parameter: Parameter) -> float:
    """Return what a parameter should be."""
    if parameter.name == "creep":
        return truth.creep
    direction = str(parameter.at["direction"])
    if parameter.name in ("t63", "t90"):
        return times[direction][parameter.name == "t90"]
    name = {"delay": "delay", "time_constant_1": "tau1", "time_constant_2": "tau2"}[parameter.name]
    return float(getattr(truth, f"{name}_{direction}"))


if __name__ == "__main__":
    main()
