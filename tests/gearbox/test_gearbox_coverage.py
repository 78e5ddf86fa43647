"""Intervals of complete campaigns hold the truth: the short form of `python -m benchmarks.coverage gearbox.load_exchange`."""

from __future__ import annotations

from scipy.stats import binom

from benchmarks.coverage.studies.gearbox_load_exchange import STUDY
from benchmarks.coverage.study import outcome

# Numbers of single runs, which err independently of each other from run to run.
OF_RUNS = ("torque_in_nominal", "torque_out_nominal", "torque_in_peak", "torque_out_peak", "inertia_load (run)", "lock_torque", "vibration_rms",
           "event_time unlock", "event_time brake_onset", "event_time rundown")  # fmt: skip
CHANCE = 1e-3


def test_intervals_of_two_campaigns_hold_the_truth_as_often_as_they_say() -> None:
    rows = [row for seed in (1, 2) for row in outcome(STUDY, "standard", seed).rows]
    told = [row for row in rows if row.label.startswith(OF_RUNS) and row.ci95 is not None and row.truth is not None]
    held = [row.ci95[0] <= row.truth <= row.ci95[1] for row in told]  # type: ignore[index,operator]
    assert len(told) > 200
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
