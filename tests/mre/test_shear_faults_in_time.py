"""Faults of clock, rate and course of a run: named, dealt with or doubted, and no wrong number as good."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from faulty_logs import (
    ODD,
    Change,
    assert_numbers_hold,
    changed,
    held,
    identify,
    in_all,
    in_one,
    left_out,
    on_rows,
    said,
    with_conditions,
    with_time,
)

from pipeline.errors import InputError
from pipeline.recording import Recording
from pipeline.rigs.mre.shear.declaration import SHEAR
from pipeline.rigs.mre.shear.sampling import alias_of
from pipeline.rigs.mre.synthetic import synthesize_rich


@pytest.fixture(scope="module")
def campaign() -> list[Recording]:
    return SHEAR.synthesize({"duration": 1.5, "rate": 2000.0, "preload_runs": False, "currents": [0.0, 3.0, 6.0]}, 4)


@pytest.fixture(scope="module")
def chirp() -> Recording:
    return synthesize_rich({"rate": 1000.0}, 2, duration=20.0)


def every(recording: Recording, count: int) -> Recording:
    return on_rows(recording, np.arange(recording.values("force").size) % count == 0)


# Clock and rate


def test_times_written_in_milliseconds_and_read_as_seconds_are_named(campaign: list[Recording]) -> None:
    findings = identify(with_time(r, 1000.0) for r in campaign[:4])
    assert findings.verdict == "rejected"
    assert any("0.001 times as fast" in r and "ms taken as s?" in r for r in findings.reasons)


def test_a_time_base_that_contradicts_all_labels_is_never_ok_and_the_factor_is_told(campaign: list[Recording]) -> None:
    findings = identify(with_time(r, 0.5) for r in campaign)
    assert findings.verdict == "warning"
    reason = next(r for r in findings.reasons if "wrong time base" in r)
    assert "2 times as fast" in reason
    assert "damping" in reason
    assert findings.one("k2").value == pytest.approx(2.6e5, rel=0.02)


@pytest.mark.thorough
def test_one_run_whose_frequency_is_not_its_labels_is_doubted(campaign: list[Recording]) -> None:
    findings = identify(with_time(r, 1.02) if r.run == ODD else r for r in campaign)
    assert findings.verdict == "warning"
    assert any(ODD in reason and "wrong label" in reason for reason in findings.reasons)


def test_a_motion_is_seen_at_its_distance_from_the_nearest_multiple_of_the_rate() -> None:
    assert [alias_of(5.0, rate) for rate in (8.0, 6.0, 4.0, 20.0)] == [3.0, 1.0, 1.0, 5.0]


@pytest.mark.parametrize("rate", [8.0, 6.0])
def test_a_log_too_slow_for_its_labelled_motion_is_called_an_alias(rate: float) -> None:
    recordings = SHEAR.synthesize({"duration": 12.0, "rate": 24.0 * 5, "preload_runs": False, "currents": [0.0]}, 1)
    slow = every(recordings[0], round(120 / rate))
    with pytest.raises(InputError, match="alias") as error:
        identify([slow])
    assert "swapped" not in str(error.value)


def test_without_a_label_a_backward_loop_of_few_samples_is_taken_for_an_alias_and_not_for_swapped_channels() -> None:
    recordings = SHEAR.synthesize({"duration": 12.0, "rate": 120.0, "preload_runs": False, "currents": [0.0]}, 1)
    findings = identify([with_conditions(every(recordings[0], 15), frequency=None)])
    assert findings.verdict == "rejected"
    assert said(findings, "alias of a motion faster than 4 Hz")
    assert not said(findings, "swapped")


def test_few_samples_a_cycle_are_doubted(campaign: list[Recording]) -> None:
    findings = identify([every(campaign[0], 100)])
    assert findings.verdict in ("warning", "rejected")
    assert said(findings, "samples a cycle", "fold")


# The course of a run


@pytest.mark.parametrize("power", [1, 2])
def test_a_slow_drift_of_the_force_is_told_per_minute_and_taken_out(campaign: list[Recording], power: int) -> None:
    findings = identify(in_all(campaign, "force", lambda t, F: F + 0.1 * np.ptp(F) * (t / t[-1]) ** power))
    assert said(findings, "the mean force drifts", "N per minute", "% of its amplitude")
    assert_numbers_hold(findings)


def test_a_step_of_the_forces_zero_is_told_with_its_time_and_doubted(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda t, F: F + 0.05 * np.ptp(F) * (t > 0.7)))
    assert findings.verdict == "warning"
    assert any("steps or wanders" in reason for reason in findings.reasons)
    assert_numbers_hold(findings)


def test_zeros_that_differ_from_run_to_run_are_told(campaign: list[Recording]) -> None:
    shifted = [changed(r, "force", lambda _, F, i=i: F + 10.0 * i) for i, r in enumerate(campaign)]
    findings = identify(shifted)
    assert said(findings, "wanders from run to run")
    assert_numbers_hold(findings)


@pytest.mark.parametrize("share", [0.05, 0.01])
def test_stiffness_that_fades_during_the_runs_is_never_ok(campaign: list[Recording], share: float) -> None:
    findings = identify(in_all(campaign, "force", lambda t, F: F * (1 - share * t / t[-1])))
    assert findings.verdict == "warning"
    assert any("from the first to the last cycle" in reason for reason in findings.reasons)


# Sensors that hang


@pytest.mark.parametrize(("channel", "duration"), [("force", 0.2), ("displacement", 0.03)])
@pytest.mark.thorough
def test_where_a_sensor_hangs_does_not_enter(campaign: list[Recording], channel: str, duration: float) -> None:
    findings = identify(in_all(campaign, channel, lambda t, v: held(t, v, 0.6, 0.6 + duration)))
    assert said(findings, f"the {channel} is stuck", "do not enter", run=ODD)
    assert not left_out(findings)
    assert_numbers_hold(findings)


def test_a_logger_that_repeats_old_values_costs_them_only(campaign: list[Recording]) -> None:
    hung = [changed(r, "force", lambda t, v: held(t, v, 0.6, 0.75)) for r in campaign]
    findings = identify(in_all(hung, "displacement", lambda t, v: held(t, v, 0.6, 0.75)))
    assert_numbers_hold(findings)


# Records without a period


@pytest.mark.parametrize(
    ("channel", "change", "words"),
    [
        ("force", lambda t, v: held(t, v, 8.0, 8.3), "the force is stuck"),
        ("displacement", lambda t, v: held(t, v, 8.0, 8.3), "the displacement is stuck"),
        ("force", lambda _, v: np.clip(v, 0.9 * v.min(), 0.9 * v.max()), "the force is clipped"),
        ("displacement", lambda _, v: np.clip(v, 0.9 * v.min(), 0.9 * v.max()), "the displacement is clipped"),
        ("force", lambda t, v: v + 0.1 * np.ptp(v) * t / t[-1], "the mean force drifts"),
        ("force", lambda t, v: v + 0.1 * np.ptp(v) * (t / t[-1]) ** 2, "the mean force drifts"),
    ],
)
@pytest.mark.thorough
def test_what_a_chirp_lost_does_not_enter(chirp: Recording, channel: str, change: Change, words: str) -> None:
    findings = identify([changed(chirp, channel, change)])
    assert findings.verdict in ("ok", "warning")
    assert said(findings, words)
    assert_numbers_hold(findings)


def test_a_force_that_fades_during_a_chirp_is_never_ok(chirp: Recording) -> None:
    findings = identify(in_one([chirp], "force", lambda t, F: F * (1 - 0.01 * t / t[-1]), chirp.run))
    assert findings.verdict == "warning"
    assert any("from start to end" in reason for reason in findings.reasons)


def test_a_coarse_log_with_stamps_off_the_grid_gives_the_truth(chirp: Recording) -> None:
    # After each dropped row the stamps lie between those of a grid; 20 samples a cycle at 17 Hz.
    assert_numbers_hold(identify([every(chirp, 3)]))


def test_a_record_that_the_model_cannot_hold_is_rejected(chirp: Recording) -> None:
    cubic = changed(chirp, "force", lambda _, F: F * (F / np.abs(F).max()) ** 2)
    findings = identify([replace(cubic, run="cubic")])
    assert findings.verdict == "rejected"
