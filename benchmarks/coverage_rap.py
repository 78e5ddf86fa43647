"""Do the 95 % intervals of the ultrafiltration device hold the truth 95 times in 100? Complete campaigns, logs to findings.

    python -m benchmarks.coverage_rap [SEEDS] [--of pressures] [--case exact] [--first 0]

"exact" has meter, scale and bench as good as stated: errors by noise, jitter, wandering speed and pump alone. In
"combined" their gains are off by draws of the standard uncertainties that the logs state, and these are in the
intervals. "short" is "exact" with fewer minutes, for the tests.

Where a quantity has no closed truth, its logs are made again without noise: what they show of it is taken for true.
What is itself a statistic of the noise (bias, limits, largest error, coherence) is compared with its mean over the
seeds, marked *: that tells the spread, not a bias, and is left out of "combined", where it is of one's own meters.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.coverage import parser, seeds_of, table
from benchmarks.rap_truths import TRUTHS
from pipeline.estimation.estimate import Estimate
from pipeline.findings import Parameter
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context, Experiment
from pipeline.rigs.rap.cytotoxicity.declaration import CYTOTOXICITY
from pipeline.rigs.rap.flow.declaration import FLOW
from pipeline.rigs.rap.pressures.declaration import PRESSURES
from pipeline.rigs.rap.synthetic import rig
from pipeline.rigs.rap.therapy.declaration import THERAPY

METER_U, SCALE_U, BENCH_U = 0.005, 0.001, 0.002
"""Relative standard uncertainties (type B) of flow meter, scale and bench pressures in "combined"."""
EXPERIMENTS: dict[str, tuple[Experiment, Callable[[Mapping[str, Any], int], list[Recording]]]] = {
    "pressures": (PRESSURES, rig.synthesize_pressures),
    "flow": (FLOW, rig.synthesize_flow),
    "therapy": (THERAPY, rig.synthesize_therapy),
    "cytotoxicity": (CYTOTOXICITY, rig.synthesize_cytotoxicity),
}
SHORT: dict[str, dict[str, Any]] = {
    "pressures": {"duration": 320.0},
    "flow": {"hold": 30.0},
    "therapy": {"runs": ["rap_therapy_312"], "duration": 5400.0},
    "cytotoxicity": {},
}
CASES = ("exact", "combined", "short")
# Told once a run or more, of which only the mean over the seeds is known.
STATISTICS = (
    "bias", "limit_lower", "limit_upper", "coherence", "flow_error_max", "flow_error_rms", "temperature_error_max",
    "uf_volume_error_rms",
)  # fmt: skip
Pairs = list[tuple[Estimate, float]]


def main() -> None:
    options = parser(__doc__ or "", seeds=40)
    options.add_argument("--of", choices=tuple(EXPERIMENTS), action="append", help="one or more; by default all")
    options.add_argument("--case", choices=CASES, action="append", help="one or more; by default exact and combined")
    arguments = options.parse_args()
    for name in arguments.of or EXPERIMENTS:
        for case in arguments.case or CASES[:2]:
            print(f"\nrap.{name}, {case}, {arguments.seeds} seeds")
            print(table(study(name, case, seeds_of(arguments))), flush=True)


def study(name: str, case: str, seeds: range) -> dict[str, Pairs]:
    """Return every estimate with its truth, by name and tap; those of all runs and set-points together."""
    experiment, _ = EXPERIMENTS[name]
    found: dict[str, Pairs] = defaultdict(list)
    spread: dict[tuple[str, str], list[Estimate]] = defaultdict(list)
    for seed in seeds:
        truth, recordings = campaign(name, case, seed)
        known = TRUTHS[name](truth, seed)
        for p in experiment.identify(recordings, experiment.settings(), Context("coverage", {})).parameters:
            estimate = Estimate(p.name, p.value, p.std_error, p.ci95)
            true = known(p)
            if true is not None:
                found[_label(p)].append((estimate, true))
            elif p.name in STATISTICS and p.ci95 is not None and case != "combined":
                spread[f"{_label(p)} *", repr(sorted(p.at.items()))].append(estimate)
    for (label, _), estimates in spread.items():
        mean = float(np.mean([e.value for e in estimates if e.value is not None]))
        found[label] += [(e, mean) for e in estimates]
    return dict(found)


def campaign(name: str, case: str, seed: int) -> tuple[dict[str, Any], list[Recording]]:
    """Return what is true, and the logs."""
    _, synthesize = EXPERIMENTS[name]
    truth: dict[str, Any] = dict(SHORT[name]) if case == "short" else {}
    if name == "cytotoxicity":
        return truth, synthesize(truth, seed)
    told = {"flowmeter_gain_u": 0.0, "scale_gain_u": 0.0, "bench_gain_u": 0.0}
    if case == "combined":
        meter, scale, bench = np.random.default_rng((seed, 77)).standard_normal(3)
        told = {"flowmeter_gain_u": METER_U, "scale_gain_u": SCALE_U, "bench_gain_u": BENCH_U}
        truth["meter_gain"] = 1.0 + METER_U * meter
        truth["bench_gain"] = 1.0 + BENCH_U * bench
        if name == "therapy":
            truth["scale_gain"] = 1.0 + SCALE_U * scale
    else:
        truth["meter_gain"] = 1.0
    truth["told"] = told
    return truth, synthesize(truth, seed)


def _label(p: Parameter) -> str:
    parts = [str(p.at[key]) for key in ("channel", "source", "estimator", "set") if key in p.at]
    return " ".join([p.name, *parts])


if __name__ == "__main__":
    main()
