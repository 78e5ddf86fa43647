"""Do the 95 % intervals of mre.axial hold the truth 95 times in 100? By simulation, with known truth.

    python -m benchmarks.coverage_mre_axial [SEEDS] [--case paper] [--first 0]

Cases: the paper's gauge and rate, a fine gauge, a hand-turned screw (changing rate), a press that stands still
before, between and after, and three runs a current with scatter between them. Stiffening in points.
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
from pipeline.rigs.mre.axial.declaration import AxialSettings
from pipeline.rigs.mre.axial.identify import identify
from pipeline.rigs.mre.axial.loop import loss_ratio, secant, slope, unloading_drop
from pipeline.rigs.mre.axial.synthetic import AxialTruth, axial_truth, synthesize

CASES: dict[str, dict[str, Any]] = {
    "paper": {},
    "exact": {"speed_error": 0.0, "late": False},
    "fine": {"gauge_step": 0.0, "gauge_noise": 1.5e-6},
    "hand": {"rate_ripple": 0.3},
    "rests": {"rest_before": 3.3, "rest_top": 2.2, "rest_after": 3.1},
    "repeats": {"repeats": 3, "gain_scatter": 0.004},
}
UNITS = dict.fromkeys(("stiffening_secant", "stiffening_slope"), (0.01, "points"))


def main() -> None:
    options = parser(__doc__ or "")
    options.add_argument("--case", choices=tuple(CASES), action="append", help="one or more; by default all")
    arguments = options.parse_args()
    for name in arguments.case or CASES:
        print(f"\n{name}, {arguments.seeds} seeds")
        found = study(CASES[name], seeds_of(arguments))
        print(table(found, {key: UNITS[key.split(" ")[0]] for key in found if key.split(" ")[0] in UNITS}), flush=True)


def study(truth: dict[str, Any], seeds: range) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every estimate with its truth, by name and current."""
    known = axial_truth(truth)
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    for seed in seeds:
        for p in identify(synthesize(truth, seed), AxialSettings(), Context("coverage", {})).parameters:
            name = f"{p.name} {float(p.at['coil_current']):g} A"
            found[name].append((Estimate(p.name, p.value, p.std_error, p.ci95), true_value(known, p)))
    return found


def true_value(truth: AxialTruth, p: Parameter) -> float:
    """Return what a parameter should be."""
    model, base = truth.model_at(float(p.at["coil_current"])), truth.model_at(0.0)
    d = truth.stroke
    return {
        "stiffness": model.k,
        "stiffness_cubic": model.k3,
        "alpha": model.alpha,
        "rho": model.rho,
        "stiffness_secant": secant(model, d),
        "stiffness_slope": slope(model, d),
        "loss_ratio": loss_ratio(model, d),
        "unloading_drop": unloading_drop(model, d),
        "stiffening_secant": secant(model, d) / secant(base, d) - 1,
        "stiffening_slope": slope(model, d) / slope(base, d) - 1,
    }[p.name]


if __name__ == "__main__":
    main()
