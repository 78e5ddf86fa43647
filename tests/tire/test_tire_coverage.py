"""Intervals of complete campaigns hold the truth: the short form of `python -m benchmarks.coverage tire.bench`."""

from __future__ import annotations

from dataclasses import replace

from bench_campaigns import without_ring
from honest_intervals import scores, share_is_likely

from benchmarks.coverage.studies.tire_bench import STUDY
from benchmarks.coverage.study import Campaign, Study, outcome

# Numbers of single runs, which err independently of each other from run to run.
OF_RUNS = ("deformation_length", "slope_length", "zero_length", "dip_leading", "dip_trailing", "sensor_resistance")


def _without_ring(case: str, seed: int) -> Campaign:
    """Return a campaign whose sensor length is not known: the fit of the ring takes most of the time."""
    whole = STUDY.campaign(case, seed)
    return replace(whole, recordings=without_ring(whole.recordings))


CHEAP = Study(STUDY.experiment, STUDY.cases, _without_ring)


def test_intervals_of_three_campaigns_hold_the_truth_as_often_as_they_say() -> None:
    rows = [row for seed in (1, 2, 3) for row in outcome(CHEAP, "standard", seed).rows]
    z = scores(rows, OF_RUNS.__contains__)
    assert z.size > 105
    assert share_is_likely(z)
    # Student's intervals of few turns have room: a factor of 1.5 is for the whole study to notice.
    assert not share_is_likely(z, too_small_by=1.75), "the test would not notice"
