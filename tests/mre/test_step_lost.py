"""What a log of a step test cannot tell: holes and freezes at a step, a set-point, odd clocks, both signs of the current."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hold_logs import changed, said, step

from pipeline.recording import Recording
from pipeline.rigs.mre.step.lags import lag
from pipeline.rigs.mre.step.record import record_of
from pipeline.rigs.mre.step.synthetic import StepTruth, synthesize, true_times
from pipeline.rigs.mre.step.times import NAMES


def log(**truth: Any) -> Recording:
    return synthesize({"rate": 500.0, **truth}, 5)[0]


def hold_still(start: float, stop: float) -> Any:
    return lambda t, x: np.where((t > start) & (t < stop), x[np.searchsorted(t, start)], x)


def missing(start: float, stop: float) -> Any:
    return lambda t, x: np.where((t > start) & (t < stop), np.nan, x)


@pytest.mark.parametrize(
    ("channel", "fault", "words"),
    [
        ("force_axial", hold_still(1.0, 1.06), "force_axial stands still from 1"),
        ("force_axial", missing(1.03, 1.16), "force_axial has no sample from 1.03 to 1.16 s"),
        ("current", missing(0.98, 1.06), "current has no sample from 0.98 to 1.06 s"),
        ("current", hold_still(1.0, 1.06), "current stands still from"),
    ],
)
def test_what_hides_the_onset_of_a_step_withholds_its_direction_alone(channel: str, fault: Any, words: str) -> None:
    found = step([changed(log(), channel, fault)])
    assert found.verdict == "warning"
    assert said(found, words, "withheld")
    for name in NAMES:
        rise = found.one(name, direction="rise")
        assert rise.value is None
        assert words in rise.description
    assert found.one("time_constant_1", direction="fall").value == pytest.approx(0.45, abs=5e-3)


def test_a_freeze_far_from_any_step_withholds_nothing() -> None:
    found = step([changed(log(), "force_axial", hold_still(4.0, 4.2))])
    assert found.one("delay", direction="rise").value == pytest.approx(0.02, abs=3e-3)


def test_a_coarse_converter_is_not_taken_for_a_freeze() -> None:
    record = record_of(log(force_lsb=3.0, force_noise=0.5))
    assert not record.breaks


def test_of_several_steps_one_that_is_hidden_leaves_the_others_to_tell() -> None:
    whole = log(times=[1, 6, 12, 17], levels=[6, 0, 6, 0], duration=24.0)
    found = step([changed(whole, "force_axial", hold_still(1.0, 1.06))])
    assert said(found, "that step tells little")
    assert found.one("delay", direction="rise").value == pytest.approx(0.02, abs=3e-3)
    assert found.one("time_constant_2", direction="rise").value == pytest.approx(0.04, abs=6e-3)


def test_a_set_point_with_noise_on_it_is_still_called_a_set_point() -> None:
    noise = 0.01 * np.random.default_rng(1).standard_normal(7000)
    found = step([changed(log(coil=0.1, logged="set_point"), "current", lambda _t, x: x + noise)])
    assert said(found, "set-point")
    for direction in ("rise", "fall"):
        for name in ("delay", "time_constant_2"):
            p = found.one(name, direction=direction)
            assert p.value is None
        assert found.one("t63", direction=direction).value is not None


def test_a_coil_of_5_ms_is_no_set_point() -> None:
    found = step([log(rate=1000.0, coil=0.005)])
    assert not said(found, "set-point")
    assert found.one("delay", direction="rise").value == pytest.approx(0.02, abs=3e-3)


@pytest.mark.thorough
def test_milliseconds_taken_as_seconds_are_named_and_the_work_stays_bounded() -> None:
    plain = log(rate=500.0)
    (stream,) = plain.streams.values()
    slow = replace(plain, streams={stream.name: replace(stream, time=1e3 * stream.time)})
    assert record_of(slow).grid.size < 100_000
    found = step([slow])
    assert said(found, "ms taken as s")
    assert found.verdict == "warning"


def test_lags_that_are_alike_are_told_as_a_sum_and_no_drift_is_invented() -> None:
    found = step([log(tau1_rise=0.08, tau2_rise=0.08, tau1_fall=0.3, tau2_fall=0.3, rate=1000.0)])
    assert not said(found, "drifts")
    for direction, total in (("rise", 0.16), ("fall", 0.6)):
        p = found.one("time_constant_1", direction=direction)
        assert p.value is None
        assert float(p.description.split("sum is ")[1].split(" ")[0]) == pytest.approx(total, rel=0.02)


def test_a_current_of_both_signs_is_said() -> None:
    found = step([log(times=[1, 6, 11], levels=[6, -6, 0], duration=18.0)])
    assert said(found, "both signs")


def test_a_filter_of_the_force_that_is_told_is_in_none_of_the_times() -> None:
    plain = log(rate=1000.0)
    (stream,) = plain.streams.values()
    tau = 0.05
    noise = np.random.default_rng(2).standard_normal(stream.time.size)
    late = changed(
        log(rate=1000.0, force_noise=0.0), "force_axial", lambda _t, x: x[0] + lag(x - x[0], tau, 1e-3) + noise
    )
    untold = step([late])
    assert said(untold, "filter in the force channel", "force_filter")
    assert untold.one("time_constant_2", direction="fall").value != pytest.approx(0.04, abs=0.01)
    told = step([replace(late, conditions={**late.conditions, "force_filter": 1 / (2 * np.pi * tau)})])
    for direction, tau1 in (("rise", 0.1), ("fall", 0.45)):
        for name, truth in (("delay", 0.02), ("time_constant_1", tau1), ("time_constant_2", 0.04)):
            p = told.one(name, direction=direction)
            assert p.std_error is not None
            assert p.value == pytest.approx(truth, abs=3 * p.std_error)
        assert told.one("t63", direction=direction).value == pytest.approx(
            true_times(StepTruth(), rising=direction == "rise")[0], abs=4e-3
        )
    assert not said(told, "filter in the force channel")


def test_where_no_filter_is_told_a_sound_log_says_so_and_stays_ok() -> None:
    found = step([log(rate=1000.0)])
    assert found.verdict == "ok"
    assert said(found, "a filter in the force channel", "the log cannot tell")


def test_logs_of_the_same_step_that_differ_are_named() -> None:
    one, other = log(), replace(log(tau1_rise=0.2), run="again")
    found = step([one, other])
    assert found.verdict == "warning"
    assert said(found, "step and again", "of the rise")
    assert not said(found, "of the fall")
    assert step([one, replace(synthesize({"rate": 500.0}, 6)[0], run="again")]).verdict == "ok"


def test_ripple_of_the_current_invents_no_level() -> None:
    found = step([changed(log(), "current", lambda t, x: x + 0.2 * np.sin(2 * np.pi * 50 * t))])
    assert found.arrays["steps"]["before"].round(1).abs().tolist() == [0.0, 6.0]
    for direction in ("rise", "fall"):
        t63 = true_times(StepTruth(), rising=direction == "rise")[0]
        assert found.one("t63", direction=direction).value == pytest.approx(t63, abs=3e-3)


def test_hum_of_the_mains_is_named_and_taken_off() -> None:
    found = step([changed(log(), "force_axial", lambda t, x: x + 5 * np.sin(2 * np.pi * 50.03 * t + 1))])
    assert said(found, "hum of", "50.0", "taken off")
    assert not said(found, "misses the response")
    for direction in ("rise", "fall"):
        assert found.one("delay", direction=direction).value == pytest.approx(0.02, abs=5e-3)
        assert found.one("time_constant_2", direction=direction).value == pytest.approx(0.04, abs=8e-3)
    rippled = step([changed(log(), "current", lambda t, x: x + 0.2 * np.sin(2 * np.pi * 50 * t))])
    assert said(rippled, "ripple of 0.2 A at 50 Hz")


def test_a_current_that_reads_exactly_zero_at_rest_is_not_clipped() -> None:
    found = step([changed(log(), "current", lambda _t, x: np.where(x < 0.04, 0.0, x))])
    assert found.one("delay", direction="rise").value == pytest.approx(0.02, abs=3e-3)
    assert found.one("t90", direction="fall").value == pytest.approx(true_times(StepTruth(), rising=False)[1], abs=5e-3)


def test_a_log_without_any_noise_is_read_to_the_truth() -> None:
    found = step([log(rate=1000.0, force_noise=0.0, current_noise=0.0)])
    for direction, tau1 in (("rise", 0.1), ("fall", 0.45)):
        assert found.one("time_constant_1", direction=direction).value == pytest.approx(tau1, rel=0.01)
