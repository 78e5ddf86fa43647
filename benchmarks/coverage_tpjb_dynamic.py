"""Do the 95 % intervals of tpjb.dynamic and tpjb.baseline hold the truth 95 times in 100? By simulation.

    python -m benchmarks.coverage_tpjb_dynamic [SEEDS] [--first 0] [--bearing 4pad-L1 5pad-L3 ...]

Per coefficient, over all tones and at shaft speed: how often its interval holds the truth, bias over mean
standard error, actual over claimed spread, rms error in per cent of itself. Type A, as the intervals are.
"""

from __future__ import annotations

import os
from collections import defaultdict

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate
from pipeline.findings import Parameter
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb import truth
from pipeline.rigs.tpjb.baseline.declaration import BASELINE, BaselineSettings
from pipeline.rigs.tpjb.dynamic.declaration import DYNAMIC, DynamicSettings

_CONTEXT = Context("coverage", {})


def main() -> None:
    options = parser(__doc__ or "")
    options.add_argument("--bearing", nargs="*", default=["4pad-L1", "5pad-L3"], choices=list(truth.BEARINGS))
    arguments = options.parse_args()
    seeds = seeds_of(arguments)
    for name in arguments.bearing:
        print(f"\n{name}, {arguments.seeds} seeds")
        print(table(dynamic(seeds, name)))
    print(f"\nbaseline, {arguments.seeds} seeds")
    print(table(baseline(seeds)))


def dynamic(seeds: range, bearing: str) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every coefficient with its truth: at the tones by name, at shaft speed as 'kxx synchronous'."""
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    for seed in seeds:
        recordings = DYNAMIC.synthesize({"bearings": [bearing]}, seed)
        for p in DYNAMIC.identify(recordings, DynamicSettings(), _CONTEXT).parameters:
            synchronous = "synchronous" in p.at
            frequency = truth.SHAFT_SPEED / (2 * np.pi) if synchronous else float(p.at["frequency"])
            H = truth.bearing(bearing).impedance(frequency)["xy".index(p.name[1]), "xy".index(p.name[2])]
            actual = H.real if p.name[0] == "k" else H.imag / (2 * np.pi * frequency)
            found[p.name + " synchronous" * synchronous].append((_estimate(p), float(actual)))
    return dict(sorted(found.items(), key=lambda entry: "synchronous" in entry[0]))


def baseline(seeds: range) -> dict[str, list[tuple[Estimate, float]]]:
    """Return mass and stiffness of the stator with their truth."""
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    actual = {"stator_mass": 900.0, "stabilizer_stiffness": 5e6}
    for seed in seeds:
        for p in BASELINE.identify(BASELINE.synthesize({}, seed), BaselineSettings(), _CONTEXT).parameters:
            found[p.name].append((_estimate(p), actual[p.name]))
    return found


def _estimate(p: Parameter) -> Estimate:
    return Estimate(p.name, p.value, p.std_error, p.ci95, p.at)


if __name__ == "__main__":
    main()
