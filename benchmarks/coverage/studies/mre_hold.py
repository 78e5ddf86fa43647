"""Coverage of `mre.hold`: the current in steps up to 8 A and down again at a held gap, force and field logged.

No bound. Increments of all currents count together.
"""

from __future__ import annotations

import numpy as np

from benchmarks.coverage.dirt import coloured, dropouts, jitter
from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.rigs.mre.hold.declaration import HOLD
from pipeline.rigs.mre.hold.law import saturation
from pipeline.rigs.mre.hold.synthetic import hold_truth, synthesize

_OVERRIDES = {"hold_scatter": 0.3}
_TRUTH = hold_truth(_OVERRIDES)


def campaign(_case: str, seed: int) -> Campaign:
    """Return the log of one campaign."""
    rng = np.random.default_rng([seed, 1])
    logs = coloured(synthesize(_OVERRIDES, seed), rng, {"force_axial": 0.5, "flux_density": 0.5e-3}, memory=1.0)
    return Campaign(dropouts(jitter(logs, rng, 0.01), rng, count=5, longest=8), truth)


def truth(parameter: Parameter) -> float:
    """Return what a parameter should be."""
    if parameter.name == "force_increment":
        z = np.array([float(parameter.at["coil_current"]) / _TRUTH.saturation_current])
        return float(_TRUTH.force_gain * saturation(z, _TRUTH.sharpness)[0])
    if parameter.name == "remanence":
        return _TRUTH.remanence_up if parameter.at["sweep"] == "up" else _TRUTH.remanence_down
    return float(getattr(_TRUTH, parameter.name))


STUDY = Study(
    HOLD,
    {
        "standard": Case(
            "33 holds of 10 s, errors of 0.3 N that last a hold, white noise of 1 N and 2 mT, first-order noise of 0.5 N and 0.5 mT "
            "with 1 s memory, current noise of 0.01 A, clock jitter of 1 ms, stretches of up to 8 samples lost."
        )
    },
    campaign,
)
