"""The studies of coverage in short: complete campaigns with all their dirt; an error 1.5 times off breaks them."""

from __future__ import annotations

import numpy as np
import pytest
from honest_intervals import scores

from benchmarks.coverage.studies import tpjb_baseline, tpjb_bump, tpjb_dynamic, tpjb_rotating
from benchmarks.coverage.study import Study, outcome

STUDIES = {"baseline": (tpjb_baseline.STUDY, 6), "dynamic": (tpjb_dynamic.STUDY, 2), "bump": (tpjb_bump.STUDY, 3)}


def errors(study: Study, campaigns: int) -> np.ndarray:
    """Return the errors of every number of the campaigns, in units of what its interval claims."""
    rows = [row for seed in range(60, 60 + campaigns) for row in outcome(study, "gains known", seed).rows]
    z = scores(rows)
    assert z.size > 0.6 * len(rows)
    return z


@pytest.mark.parametrize("name", STUDIES)
def test_intervals_hold_the_truth_as_often_as_they_say(name: str) -> None:
    z = errors(*STUDIES[name])
    # Some of the numbers share their noise: a third of them counts. Errors 1.5 times too small would hold it 81 times in 100.
    slack = 2.0 * np.sqrt(0.05 * 0.95 / (z.size / 3))
    assert np.mean(np.abs(z) < 1.96) > max(0.95 - slack, 0.82)
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3


@pytest.mark.thorough
def test_intervals_of_rotating_loads_hold_the_truth_as_often_as_they_say() -> None:
    z = errors(tpjb_rotating.STUDY, 4)
    assert np.mean(np.abs(z) < 1.96) > 0.88
    assert 0.75 < np.sqrt(np.mean(z**2)) < 1.25
