"""Do the 95 % intervals of tpjb.rotating hold the truth 95 times in 100? By simulation, with known truth.

    python -m benchmarks.coverage_tpjb_rotating [SEEDS] [--case A4] [--first 0]

Cases are runs of the synthetic rig, one or several fitted jointly, with the model that made them; "still"
marks logs without a stretch at zero force, "noisy" a force signal of 200 N noise. Beside the coefficients:
harmonic distortion of the first run and the linear limit.
"""

from __future__ import annotations

import os
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate, estimate
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.linear_limit import linear_limit, model_distortion, nonlinear_distortion
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit, fit_model
from pipeline.rigs.tpjb.rotating.models import model
from pipeline.rigs.tpjb.rotating.record import record_of
from pipeline.rigs.tpjb.rotating.synthetic import RUNS, synthesize
from pipeline.rigs.tpjb.truth import bearing


@dataclass(frozen=True)
class Case:
    """Runs that are fitted together, the model, and what differs from the standard rig."""

    runs: tuple[str, ...]
    model: str
    overrides: dict[str, Any] = field(default_factory=dict)


CASES = {
    "A4": Case(("A4",), "M5"),
    "A7": Case(("A7",), "M2"),
    "B3": Case(("B3",), "M6"),
    "A4+A5": Case(("A4", "A5"), "M5"),
    "B3+B4+B5": Case(("B3", "B4", "B5"), "M6"),
    "A5 still": Case(("A5",), "M5", {"no_dwell": True}),
    "A4+A5 still": Case(("A4", "A5"), "M5", {"no_dwell": True}),
    "A7 noisy": Case(("A7",), "M2", {"force_noise": 200.0}),
}


def main() -> None:
    options = parser(__doc__ or "")
    options.add_argument("--case", choices=tuple(CASES), action="append", help="one or more; by default all")
    arguments = options.parse_args()
    for name in arguments.case or CASES:
        case = CASES[name]
        print(f"\n{name}, {case.model}, {arguments.seeds} seeds")
        print(table(study(case, seeds_of(arguments))))


def study(case: Case, seeds: range) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every estimate with its truth, by name."""
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    made = bearing(RUNS[case.runs[0]].bearing)
    p = np.array([*made.stiffness, *made.quadratic])
    for seed in seeds:
        recordings = synthesize({"runs": case.runs, **case.overrides}, seed)
        orbits = [record_of(recording, RotatingSettings()).orbit for recording in recordings]
        fit = fit_model(orbits, model(case.model))
        for name, pair in coefficient_pairs(fit, p):
            found[name].append(pair)
        distortion = nonlinear_distortion(orbits[0], fit.K)
        thd, _ = model_distortion(p, orbits[0].rotation.size)
        found["thd"].append((estimate("thd", distortion.value, distortion.std_error), float(thd)))
        limit = linear_limit(fit, made.static_load)
        if limit.ratio is not None and limit.std_error is not None:
            told = estimate("linear_limit", limit.ratio, limit.std_error, dof=fit.covariance.dof)
            found["linear_limit"].append((told, true_limit(p, made.static_load)))
    return found


def coefficient_pairs(fit: ModelFit, p: np.ndarray) -> list[tuple[str, tuple[Estimate, float]]]:
    """Return coefficients, and the combinations that stand for those not told, beside their truth."""
    truth = dict(zip(COEFFICIENTS, p.tolist(), strict=True))
    pairs = [
        (name, (told, truth[name]))
        for name, told in fit.estimates.items()
        if any(fit.model.matrix[COEFFICIENTS.index(name)])
    ]
    for told in fit.combinations:
        if " - " in told.text:
            a, b = told.members
            value = estimate(told.text, told.value, told.std_error, dof=fit.covariance.dof)
            pairs.append((told.text, (value, truth[a] - truth[b])))
    return pairs


def true_limit(p: np.ndarray, static_load: float, level: float = 0.05) -> float:
    """Return the load ratio at which a circular load makes the orbit's distortion reach the level."""
    ratios = np.linspace(0.02, 0.4, 2000)
    thd, _ = model_distortion(p, ratios * static_load)
    return float(np.interp(level, thd[np.isfinite(thd)], ratios[np.isfinite(thd)]))


if __name__ == "__main__":
    main()
