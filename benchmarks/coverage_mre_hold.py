"""Do the 95 % intervals of mre.hold hold the truth 95 times in 100? By simulation, with known truth.

    python -m benchmarks.coverage_mre_hold [SEEDS] [--case standard] [--first 0]

Increments count over all levels; they are told in per cent of the force at 0 A.
"""

from __future__ import annotations

import os
from collections import defaultdict
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate
from pipeline.findings import Parameter
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.hold.declaration import HoldSettings
from pipeline.rigs.mre.hold.identify import identify
from pipeline.rigs.mre.hold.law import saturation
from pipeline.rigs.mre.hold.synthetic import HoldTruth, hold_truth, synthesize

CASES: dict[str, dict[str, Any]] = {
    "standard": {},
    "scatter of 0.3 N from hold to hold": {"hold_scatter": 0.3},
    "coloured noise, memory 2 s": {"noise_memory": 2.0},
    "up only": {"down": False},
    "to 6 A": {"largest_current": 6.0},
    "blunt law, p = 2": {"sharpness": 2.0},
    "blank test, pull 60 N": {"blank": True, "pull": 60.0},
}
UNITS = {"force_increment": (0.01, "points"), "force_increment 6 A": (0.01, "points"), "force_gain": (0.01, "points")}
UNITS |= {
    "saturation_current": (1.0, "A"),
    "sharpness": (1.0, ""),
    "relaxation": (0.01, "points"),
    "remanence": (1e-3, "mT"),
}


def main() -> None:
    options = parser(__doc__ or "")
    options.add_argument("--case", choices=tuple(CASES), action="append", help="one or more; by default all")
    arguments = options.parse_args()
    for name in arguments.case or CASES:
        print(f"\n{name}, {arguments.seeds} seeds")
        print(table(study(CASES[name], seeds_of(arguments)), UNITS))


def study(overrides: dict[str, Any], seeds: range) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every estimate with its truth, by name."""
    truth = hold_truth(overrides)
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    for seed in seeds:
        for p in identify(synthesize(overrides, seed), HoldSettings(), Context("coverage", {})).parameters:
            told = Estimate(p.name, p.value, p.std_error, p.ci95)
            found[p.name].append((told, true_value(truth, p)))
            if p.at.get("coil_current") == 6.0:
                found["force_increment 6 A"].append((told, true_value(truth, p)))
    return found


def true_value(truth: HoldTruth, parameter: Parameter) -> float:
    """Return what a parameter should be."""
    if parameter.name == "force_increment":
        z = np.array([float(parameter.at["coil_current"]) / truth.saturation_current])
        return float(truth.force_gain * saturation(z, truth.sharpness)[0])
    if parameter.name == "remanence":
        return truth.remanence_up if parameter.at["sweep"] == "up" else truth.remanence_down
    return float(getattr(truth, parameter.name))


if __name__ == "__main__":
    main()
