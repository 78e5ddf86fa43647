"""What `mre.step` finds on the synthetic rig: accuracy of the sheet, honest openness, faults of section 8."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hold_logs import captions, changed, rows, said, step, with_channel, without

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Channel, Recording
from pipeline.rigs.mre.step.declaration import STEP
from pipeline.rigs.mre.step.lags import lag, passes, response
from pipeline.rigs.mre.step.synthetic import StepTruth, step_truth, synthesize, true_times

TRUTH = StepTruth()


def log(**truth: Any) -> Recording:
    return synthesize(truth, 3)[0]


@pytest.fixture(scope="module")
def findings() -> Findings:
    return step([log()])


def test_a_lag_is_exact_for_a_current_that_is_straight_between_its_samples() -> None:
    dt, tau = 0.05, 0.1
    t = np.arange(0, 2, dt)
    ramp = np.minimum(t / 0.5, 1.0)
    exact = np.where(
        t <= 0.5,
        (t - tau * (1 - np.exp(-t / tau))) / 0.5,
        1 - tau / 0.5 * (np.exp(-(t - 0.5) / tau) - np.exp(-t / tau)),
    )
    assert np.allclose(lag(ramp, tau, dt), exact, atol=1e-12)
    two = response(ramp, (0.1, 0.1), dt)[0]
    assert np.allclose(two, lag(lag(ramp, 0.1, dt), 0.1, dt))


def test_derivatives_of_the_response_are_those_of_differences() -> None:
    u = np.cumsum(np.random.default_rng(0).standard_normal(400)) * 0.1
    _, _, slopes = response(u - u[0], (0.1, 0.04), 1e-3)
    for number in range(2):
        up, down = [0.1, 0.04], [0.1, 0.04]
        up[number] *= np.exp(1e-5)
        down[number] *= np.exp(-1e-5)
        difference = response(u - u[0], tuple(up), 1e-3)[0] - response(u - u[0], tuple(down), 1e-3)[0]
        assert np.allclose(slopes[number], difference / 2e-5, atol=1e-4)


def test_the_truth_of_the_sheet_has_the_times_of_the_sheet() -> None:
    assert [round(v, 2) for v in true_times(TRUTH, rising=True)] == [0.20, 0.34]
    assert [round(v, 2) for v in true_times(TRUTH, rising=False)] == [0.54, 1.13]
    assert passes(np.array([0.0, 1.0]), np.array([0.0, 1.0]), 0.3) == pytest.approx(0.3)


def test_the_truth_is_recovered_to_the_accuracy_of_the_sheet(findings: Findings) -> None:
    allowed = {
        "rise": {"delay": (0.02, 0.0007), "time_constant_1": (0.10, 0.0011), "time_constant_2": (0.04, 0.0015)},
        "fall": {"delay": (0.02, 0.0016), "time_constant_1": (0.45, 0.0011), "time_constant_2": (0.04, 0.0020)},
    }
    for direction, numbers in allowed.items():
        for name, (truth, sd) in numbers.items():
            assert findings.one(name, direction=direction).value == pytest.approx(truth, abs=3 * sd), (name, direction)
        t63, t90 = true_times(TRUTH, rising=direction == "rise")
        assert findings.one("t63", direction=direction).value == pytest.approx(t63, abs=2e-3)
        assert findings.one("t90", direction=direction).value == pytest.approx(t90, abs=5e-3)
    assert findings.verdict == "ok"
    assert findings.published[0].agrees is True


def test_captions_answer_with_the_numbers_of_the_campaign_and_tell_what_is_open(findings: Findings) -> None:
    told = captions(findings)
    rise, fall = (findings.one("t63", direction=d) for d in ("rise", "fall"))
    assert (
        f"{1e3 * (rise.ci95 or (0, 0))[0]:.2f} to {1e3 * (rise.ci95 or (0, 0))[1]:.2f} ms) in the rise" in told["steps"]
    )
    assert f"The fall takes {(fall.value or 0) / (rise.value or 1):.3g} times as long." in told["steps"]
    assert "L and tau_2 are alike in rise and fall." in told["times"]
    assert "All steps join the same two levels" in told["gains"]
    opened = {"value": None, "ci95": None, "description": "the sky fell"}
    parameters = [p.model_copy(update=opened if p.at.get("direction") == "rise" else {}) for p in findings.parameters]
    told = captions(findings.model_copy(update={"parameters": parameters}))
    assert "t_63 of the rise is not told: the sky fell." in told["steps"]
    assert "tau_1 of the rise is not told: the sky fell." in told["times"]
    assert not any(words in told[name] for name in ("steps", "times") for words in ("times as long", "alike in rise"))


def test_two_lags_win_by_bic(findings: Findings) -> None:
    bic = {model.name: model.bic or 0.0 for model in findings.models}
    assert bic["rise: one lag, fall: one lag"] - bic["rise: two lags, fall: two lags"] > 500
    assert [m.name for m in findings.models if m.selected] == ["rise: two lags, fall: two lags"]


def test_one_lag_leaves_the_second_open_and_tells_the_sum() -> None:
    found = step([log(tau2_rise=0.0, tau2_fall=0.0)])
    for direction, tau in (("rise", 0.1), ("fall", 0.45)):
        second = found.one("time_constant_2", direction=direction)
        assert second.value is None
        assert "not separable" in second.description
        assert found.one("time_constant_1", direction=direction).value == pytest.approx(tau, rel=0.01)


@pytest.mark.thorough
def test_where_noise_hides_the_second_lag_the_delay_is_wide_enough_for_it() -> None:
    for seed in range(4):
        found = step(synthesize({"force_noise": 20.0}, seed))
        for direction in ("rise", "fall"):
            delay = found.one("delay", direction=direction)
            if delay.ci95 is not None:
                assert delay.ci95[0] < 0.02 < delay.ci95[1] + 0.002


def test_a_delay_below_a_sample_has_an_interval_that_holds_zero() -> None:
    found = step([log(delay_rise=0.0, delay_fall=0.0, tau2_rise=0.0, tau2_fall=0.0)])
    for direction in ("rise", "fall"):
        delay = found.one("delay", direction=direction)
        assert delay.ci95 is not None
        assert delay.ci95[0] < 1e-3
        assert delay.value is not None
        assert abs(delay.value) < 2e-3


def test_several_steps_share_the_times_of_their_direction() -> None:
    found = step([log(times=[1, 4, 8, 12], levels=[3, 6, 3, 0], duration=18.0)])
    assert len(found.arrays["steps"]) == 4
    assert found.one("time_constant_1", direction="rise").value == pytest.approx(0.1, abs=5e-3)
    assert found.one("time_constant_1", direction="fall").value == pytest.approx(0.45, abs=8e-3)


def test_a_set_point_in_place_of_the_current_is_said_and_the_whole_stays_right() -> None:
    found = step([log(logged="set_point")])
    assert said(found, "set-point", "coil")
    assert found.one("delay", direction="rise").value is None
    assert "set-point" in found.one("delay", direction="rise").description
    assert found.one("time_constant_1", direction="fall").value == pytest.approx(0.45, abs=4e-3)
    assert found.one("t63", direction="rise").value == pytest.approx(0.2, abs=5e-3)


def test_sampling_at_10_hz_hides_what_is_shorter_and_says_so() -> None:
    found = step([log(rate=10.0)])
    assert said(found, "within one sample")
    for direction in ("rise", "fall"):
        assert found.one("delay", direction=direction).value is None
        assert found.one("time_constant_2", direction=direction).value is None
        t63 = found.one("t63", direction=direction)
        truth = true_times(TRUTH, rising=direction == "rise")[0]
        assert t63.ci95 is not None
        assert t63.ci95[0] < truth < t63.ci95[1]
    assert found.one("time_constant_1", direction="fall").value == pytest.approx(0.45, abs=0.03)


def test_a_log_cut_before_the_force_has_settled_is_doubted() -> None:
    found = step([log(duration=7.0)])
    assert said(found, "had not settled")
    p = found.one("time_constant_1", direction="fall")
    assert p.ci95 is not None
    assert p.ci95[0] < 0.45 < p.ci95[1]


def test_a_log_cut_right_after_the_fall_tells_of_the_rise_alone() -> None:
    found = step([log(duration=6.3)])
    assert said(found, "no falling step")
    assert found.one("time_constant_1", direction="rise").value == pytest.approx(0.1, abs=5e-3)


def test_a_filter_in_the_force_channel_alone_is_suspected() -> None:
    found = step([log(force_filter=30.0)])
    assert said(found, "filter in the force channel")
    corrected = replace(log(force_filter=30.0), conditions={**log().conditions, "force_lag": 0.0106})
    assert step([corrected]).one("delay", direction="rise").value == pytest.approx(0.02, abs=4e-3)


def test_coarse_steps_of_the_force_widen_the_times() -> None:
    found = step([log(force_lsb=5.0)])
    assert said(found, "steps of 5 N")
    p = found.one("t90", direction="fall")
    assert p.ci95 is not None
    assert p.ci95[0] < true_times(TRUTH, rising=False)[1] < p.ci95[1]


def test_drift_is_taken_out_and_said() -> None:
    found = step([changed(log(), "force_axial", lambda t, x: x + 10 * t / 14)])
    assert said(found, "drifts by 10 N")
    assert found.one("time_constant_1", direction="fall").value == pytest.approx(0.45, abs=4e-3)


@pytest.mark.parametrize(
    ("channel", "change", "words"),
    [
        ("force_axial", lambda _t, x: -x, "sign: -1"),
        ("force_axial", lambda _t, x: 0 * x + 5, "dead"),
        ("force_axial", lambda _t, x: np.minimum(x, 300.0), "clipped at 300"),
        ("force_axial", lambda t, x: np.where(t > 3, x[3000], x), "stuck"),
        ("current", lambda t, x: np.where(t > 3, x[3000], x), "stuck"),
        ("current", lambda _t, x: 1e3 * x, "mA taken as A"),
        ("current", lambda _t, x: 1e-3 * x, "A taken as mA"),
    ],
)
def test_what_cannot_be_used_is_refused_in_words(channel: str, change: object, words: str) -> None:
    recording = changed(log(), channel, change)
    with pytest.raises(InputError, match=words):
        step([recording])
    with pytest.raises(InputError, match=words):
        STEP.check(recording)


def test_no_measured_current_is_refused() -> None:
    with pytest.raises(InputError, match="current"):
        step([without(log(), "current")])


def test_units_and_signs_are_named() -> None:
    found = step([changed(log(), "force_axial", lambda _t, x: x / 1000)])
    assert found.verdict == "rejected"
    assert said(found, "kN taken as N")
    assert said(step([changed(log(), "current", lambda _t, x: -x)]), "current is negative")
    assert said(step([changed(log(), "current", lambda _t, x: 6 - x)]), "force falls as the current rises")
    early = step([changed(log(), "force_axial", lambda t, x: np.interp(t + 0.05, t, x))])
    assert said(early, "before the current")


def test_spikes_gaps_and_lost_samples_do_not_move_the_numbers() -> None:
    rng = np.random.default_rng(0)
    spiked = changed(log(), "force_axial", lambda _t, x: np.where(rng.random(x.size) < 0.002, x + 300, x))
    spiked = changed(spiked, "current", lambda _t, x: np.where(rng.random(x.size) < 0.001, x + 20, x))
    gapped = changed(log(), "force_axial", lambda t, x: np.where((t > 1.3) & (t < 1.5), np.nan, x))
    lost = rows(log(), rng.random(14000) > 0.05)
    for recording in (spiked, gapped, lost):
        found = step([recording])
        assert found.one("delay", direction="rise").value == pytest.approx(0.02, abs=3e-3)
        assert found.one("time_constant_1", direction="fall").value == pytest.approx(0.45, abs=4e-3)


def test_a_gap_that_moves_is_doubted() -> None:
    gap = np.round((4e-4 - 3e-5 * log().values("current") / 6) / 1e-5) * 1e-5
    assert said(step([with_channel(log(), Channel("displacement_axial", gap, "m"))]), "gap moves")


def test_a_hold_sweep_is_sent_where_it_belongs() -> None:
    with pytest.raises(InputError, match=r"mre\.hold"):
        step([replace(log(), conditions={"test": "hold_sweep"})])


def test_an_unknown_truth_names_the_nearest() -> None:
    with pytest.raises(InputError, match="delay_rise"):
        step_truth({"delay_ris": 1.0})
