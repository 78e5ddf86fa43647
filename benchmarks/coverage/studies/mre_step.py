"""Coverage of `mre.step`: the current switched on and off once.

No bound. A second lag is told only where the log asks for it. Of the fall, whose second lag is a tenth of the first and told in
three campaigns of four, it then comes out large by a third of a standard error, and the delay small by as much.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from benchmarks.coverage.dirt import coloured, dropouts, jitter
from benchmarks.coverage.study import Campaign, Case, Study
from pipeline.findings import Parameter
from pipeline.rigs.mre.step.declaration import STEP
from pipeline.rigs.mre.step.synthetic import step_truth, synthesize, true_times

_TRUTH = step_truth({})


def campaign(_case: str, seed: int) -> Campaign:
    """Return the log of one campaign."""
    rng = np.random.default_rng([seed, 1])
    logs = coloured(synthesize({}, seed), rng, {"force_axial": 0.7}, memory=0.01)
    return Campaign(dropouts(jitter(logs, rng, 0.005), rng, count=5, longest=20), truth, label=label)


def label(parameter: Parameter) -> str:
    """Return the name with the direction."""
    return f"{parameter.name} {parameter.at['direction']}" if "direction" in parameter.at else parameter.name


@cache
def _times(direction: str) -> tuple[float, float]:
    return true_times(_TRUTH, rising=direction == "rise")


def truth(parameter: Parameter) -> float:
    """Return what a parameter should be."""
    if parameter.name == "creep":
        return _TRUTH.creep
    if parameter.name == "force_step":
        return _TRUTH.gain * max(_TRUTH.levels) * (1 if parameter.at["direction"] == "rise" else -1)
    direction = str(parameter.at["direction"])
    if parameter.name in ("t63", "t90"):
        return _times(direction)[parameter.name == "t90"]
    name = {"delay": "delay", "time_constant_1": "tau1", "time_constant_2": "tau2"}[parameter.name]
    return float(getattr(_TRUTH, f"{name}_{direction}"))


STUDY = Study(
    STEP,
    {
        "standard": Case(
            "6 A on and off, 14 s at 1 kHz; white noise of 1 N, first-order noise of 0.7 N with 10 ms memory, current noise of 0.01 A, "
            "clock jitter of 5 us, stretches of up to 20 samples lost."
        )
    },
    campaign,
)
