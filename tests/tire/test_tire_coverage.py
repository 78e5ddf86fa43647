"""Intervals of complete campaigns hold the truth: the short form of `python -m benchmarks.coverage tire.bench`."""

from __future__ import annotations

from dataclasses import replace

from bench_campaigns import without_ring
from scipy.stats import binom

from benchmarks.coverage.studies.tire_bench import STUDY
from benchmarks.coverage.study import Campaign, Study, outcome

# Numbers of single runs, which err independently of each other from run to run.
OF_RUNS = ("deformation_length", "slope_length", "zero_length", "dip_leading", "dip_trailing", "sensor_resistance")
CHANCE = 1e-3


def _without_ring(case: str, seed: int) -> Campaign:
    """Return a campaign whose sensor length is not known: the fit of the ring takes most of the time."""
    whole = STUDY.campaign(case, seed)
    return replace(whole, recordings=without_ring(whole.recordings))


CHEAP = Study(STUDY.experiment, STUDY.cases, _without_ring)


def test_intervals_of_two_campaigns_hold_the_truth_as_often_as_they_say() -> None:
    rows = [row for seed in (1, 2) for row in outcome(CHEAP, "standard", seed).rows]
    told = [row for row in rows if row.label in OF_RUNS and row.ci95 is not None and row.truth is not None]
    held = [row.ci95[0] <= row.truth <= row.ci95[1] for row in told]  # type: ignore[index,operator]
    assert len(told) > 70
    assert _likely(sum(held), len(held))
    # An error that is too small by half its size would not pass.
    narrow = [_narrowed(row.ci95, 1.5) for row in told]  # type: ignore[arg-type]
    inside = sum(low <= row.truth <= high for (low, high), row in zip(narrow, told, strict=True))  # type: ignore[operator]
    assert not _likely(inside, len(told))


def _likely(held: int, count: int) -> bool:
    return bool(binom.cdf(held, count, 0.95) > CHANCE)


def _narrowed(interval: tuple[float, float], factor: float) -> tuple[float, float]:
    middle, half = 0.5 * (interval[0] + interval[1]), 0.5 * (interval[1] - interval[0]) / factor
    return middle - half, middle + half
