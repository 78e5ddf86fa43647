"""Intervals of complete campaigns hold the truth: the short form of `python -m benchmarks.coverage gearbox.load_exchange`."""

from __future__ import annotations

from honest_intervals import scores, share_is_likely

from benchmarks.coverage.studies.gearbox_load_exchange import STUDY
from benchmarks.coverage.study import outcome

# Numbers of single runs, which err independently of each other from run to run.
OF_RUNS = ("torque_in_nominal", "torque_out_nominal", "torque_in_peak", "torque_out_peak", "inertia_load (run)", "lock_torque", "vibration_rms",
           "event_time unlock", "event_time brake_onset", "event_time rundown")  # fmt: skip


def test_intervals_of_two_campaigns_hold_the_truth_as_often_as_they_say() -> None:
    rows = [row for seed in (1, 2) for row in outcome(STUDY, "standard", seed).rows]
    z = scores(rows, lambda label: label.startswith(OF_RUNS))
    assert z.size > 200
    assert share_is_likely(z)
    assert not share_is_likely(z, too_small_by=1.5), "the test would not notice"
