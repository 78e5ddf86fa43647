"""Coverage of `mre.axial`: loops at 0 and 2 A, read by a gauge of 0.01 mm.

No bound: the gauge's steps are no noise that a likelihood could hold.

Three runs a current leave the scatter from run to run 4 degrees of freedom, both currents together: error over standard error then
follows Student's t, whose spread is 1.4, for all that goes with the gain of the force. At 2 A rho, the loss ratio and the cubic
term are told a little wider than they are: where the press was between two passages of the coarse gauge enters as if it were
independent from passage to passage, and in truth it is not.
"""

from __future__ import annotations

import numpy as np

from benchmarks.coverage.dirt import coloured, dropouts, jitter
from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.rigs.mre.axial.declaration import AXIAL
from pipeline.rigs.mre.axial.loop import loss_ratio, secant, slope, unloading_drop
from pipeline.rigs.mre.axial.synthetic import axial_truth, synthesize

_OVERRIDES = {"standard": {"repeats": 3, "gain_scatter": 0.004}, "one run a current": {}}
_TRUTH = axial_truth({})


def campaign(case: str, seed: int) -> Campaign:
    """Return the logs of one campaign."""
    rng = np.random.default_rng([seed, 1])
    logs = coloured(synthesize(_OVERRIDES[case], seed), rng, {"force_axial": 0.7}, memory=0.3)
    return Campaign(dropouts(jitter(logs, rng, 0.01), rng, count=2, longest=5), truth, label=label)


def label(parameter: Parameter) -> str:
    """Return the name with the current."""
    return f"{parameter.name} {float(parameter.at['coil_current']):g} A"


def truth(parameter: Parameter) -> float:
    """Return what a parameter should be."""
    model, base = _TRUTH.model_at(float(parameter.at["coil_current"])), _TRUTH.model_at(0.0)
    d = _TRUTH.stroke
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
    }[parameter.name]


_DIRT = (
    "white noise of 1 N, first-order noise of 0.7 N with 0.3 s memory, offsets, a gauge in steps of 0.01 mm, speeds off by up to "
    "1 %, clock jitter of 1 ms, stretches of up to 5 samples lost"
)

STUDY = Study(
    AXIAL,
    {
        "standard": Case(f"three loops a current with gain scatter of 0.4 % from run to run; {_DIRT}."),
        "one run a current": Case(f"one loop a current and no gain scatter, which one loop could not show; {_DIRT}."),
    },
    campaign,
)
