"""Do the 95 % intervals of tpjb.bump hold the truth 95 times in 100? By simulation, with known truth.

    python -m benchmarks.coverage_tpjb_bump [SEEDS] [--case 4pad] [--first 0]

"coloured" has probe noise with a memory of half a second in place of white noise.
"""

from __future__ import annotations

import os
from collections import defaultdict
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.coverage import parser, seeds_of, table
from pipeline.estimation.estimate import Estimate
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb.bump.contact import centred
from pipeline.rigs.tpjb.bump.declaration import BumpSettings
from pipeline.rigs.tpjb.bump.identify import identify
from pipeline.rigs.tpjb.bump.synthetic import bump_truth, planes_of, synthesize

CASES: dict[str, dict[str, Any]] = {
    "4pad": {"bearing": "4pad"},
    "5pad": {"bearing": "5pad"},
    "coloured": {"bearing": "5pad", "noise_memory": 0.5},
    "one plane": {"bearing": "4pad", "planes": "1"},
    "one level": {"bearing": "4pad", "levels": [4e3]},
}
UNITS = {
    "center_x": (1e-6, "um"),
    "center_y": (1e-6, "um"),
    "clearance": (1e-6, "um"),
    "mean clearance": (1e-6, "um"),
} | {
    "tilt_x": (1e-6, "urad"),
    "tilt_y": (1e-6, "urad"),
    "rotation": (1e-6, "urad"),
}


def main() -> None:
    options = parser(__doc__ or "")
    options.add_argument("--case", choices=tuple(CASES), action="append", help="one or more; by default all")
    arguments = options.parse_args()
    for name in arguments.case or CASES:
        print(f"\n{name}, {arguments.seeds} seeds")
        print(table(study(CASES[name], seeds_of(arguments)), UNITS))


def study(truth: dict[str, Any], seeds: range) -> dict[str, list[tuple[Estimate, float]]]:
    """Return every estimate with its truth, by name; those of both planes and all sides together."""
    true = true_values(truth)
    found: dict[str, list[tuple[Estimate, float]]] = defaultdict(list)
    for seed in seeds:
        for p in identify(synthesize(truth, seed), BumpSettings(), Context("coverage", {})).parameters:
            plane, side = int(p.at.get("plane", 0)), int(p.at.get("side", 0))
            name = "mean clearance" if p.name == "clearance" and not side else p.name
            told = Estimate(p.name, p.value, p.std_error, p.ci95)
            found[name].append((told, true.get((p.name, plane, side), 0.0)))
    return found


def true_values(truth: dict[str, Any]) -> dict[tuple[str, int, int], float]:
    """Return the truth by name, plane and side (0 for none), normalised as the findings are."""
    known = bump_truth(truth)
    values = {
        ("contact_stiffness", 0, 0): known.contact_stiffness,
        ("support_stiffness", 0, 0): known.support_stiffness,
    }
    centres = {}
    for plane, bearing in planes_of(known).items():
        centres[plane], clearances = centred(bearing.sides, bearing.normals)
        values["center_x", plane, 0], values["center_y", plane, 0] = (float(v) for v in centres[plane])
        values["rotation", plane, 0] = known.rotation
        values["clearance", plane, 0] = float(clearances.mean())
        values.update({("clearance", plane, i + 1): float(c) for i, c in enumerate(clearances)})
    if len(centres) == 2:
        values["tilt_x", 0, 0], values["tilt_y", 0, 0] = (centres[2] - centres[1]) / (known.z2 - known.z1)
    return values


if __name__ == "__main__":
    main()
