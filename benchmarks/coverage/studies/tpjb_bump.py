"""Coverage of `tpjb.bump`: clearance polygon, centre, alignment and contact of a dry bearing.

Intervals of the support's stiffness are too wide (spread over error 0.7): white noise of the force tells it, and the
widening for slow noise of the probes reaches it all the same. No bound is given.
"""

from __future__ import annotations

from typing import Any

from benchmarks.coverage.study import Campaign, Case, Study
from benchmarks.coverage.tpjb_logs import as_logged
from pipeline.findings import Parameter
from pipeline.rigs.tpjb.bump.contact import centred
from pipeline.rigs.tpjb.bump.declaration import BUMP
from pipeline.rigs.tpjb.bump.synthetic import bump_truth, planes_of, synthesize

_CASES: dict[str, dict[str, Any]] = {
    "standard": {"bearing": "4pad", "noise_memory": 0.5},
    "gains known": {"bearing": "4pad", "noise_memory": 0.5},
    "5pad": {"bearing": "5pad", "noise_memory": 0.5},
    "one level": {"bearing": "4pad", "levels": [4e3], "noise_memory": 0.5},
}


def campaign(case: str, seed: int) -> Campaign:
    """Return the log of a bump test and what is true of it."""
    true = _true_values(_CASES[case])

    def truth(parameter: Parameter) -> float | None:
        return true.get((parameter.name, int(parameter.at.get("plane", 0)), int(parameter.at.get("side", 0))))

    return Campaign(as_logged(synthesize(_CASES[case], seed), seed, gains=case == "standard"), truth, label=_label)


def _label(parameter: Parameter) -> str:
    return "mean clearance" if parameter.name == "clearance" and "side" not in parameter.at else parameter.name


def _true_values(overrides: dict[str, Any]) -> dict[tuple[str, int, int], float]:
    """Return the truth by name, plane and side (0 for none), normalised as the findings are."""
    known = bump_truth(overrides)
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


STUDY = Study(
    BUMP,
    {
        "standard": Case(
            "four-pad bearing, four levels of force: probe noise 0.1 um with a memory of 0.5 s, force noise 20 N, 0.1 % of the "
            "rows lost, 10 us of jitter, gains of probes off by 1 % and of load cells by 0.5 %"
        ),
        "gains known": Case("the same with all gains right: type A alone"),
        "5pad": Case("five-pad bearing; the same dirt, gains right"),
        "one level": Case("four-pad bearing, one level of force only; the same dirt, gains right"),
    },
    campaign,
)
