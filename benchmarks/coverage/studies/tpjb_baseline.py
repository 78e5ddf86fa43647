"""Coverage of `tpjb.baseline`: mass of the stator and stiffness of its stabilisers."""

from __future__ import annotations

import numpy as np

from benchmarks.coverage import dirt
from benchmarks.coverage.study import Campaign, Case, Study
from benchmarks.coverage.tpjb_logs import as_logged
from pipeline.findings import Parameter
from pipeline.rigs.tpjb.baseline.declaration import BASELINE
from pipeline.rigs.tpjb.baseline.synthetic import BaselineTruth


def campaign(case: str, seed: int) -> Campaign:
    """Return the logs of a campaign and what is true of them."""
    rng = np.random.default_rng((seed, 5))
    recordings = dirt.coloured(BASELINE.synthesize({}, seed), rng, {"force_u": 3.0, "force_v": 3.0}, 0.02)
    return Campaign(as_logged(recordings, seed, gains=case == "standard"), _truth)


def _truth(parameter: Parameter) -> float:
    bench = BaselineTruth().bench
    return {"stator_mass": bench.stator_mass, "stabilizer_stiffness": bench.stabilizer_stiffness}[parameter.name]


STUDY = Study(
    BASELINE,
    {
        "standard": Case(
            "six tones in phase and in antiphase: white noise of forces and accelerations and beside it noise of "
            "the load cells with a memory of 20 ms (3 N), 0.1 % of the rows lost, 10 us of jitter, gain of the load cells off by 0.5 %"
        ),
        "gains known": Case("the same with the gain of the load cells right: type A alone"),
    },
    campaign,
)
