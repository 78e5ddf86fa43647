"""Faults of logs of the shear rig beyond the rows of section 8: what is said, the verdict, and no wrong number as good."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from faulty_logs import (
    ODD,
    Change,
    assert_numbers_hold,
    identify,
    in_all,
    in_one,
    left_out,
    noise,
    said,
    with_conditions,
    without_channel,
)

from pipeline.errors import InputError
from pipeline.recording import Recording, Stream
from pipeline.rigs.mre.shear.declaration import SHEAR


@pytest.fixture(scope="module")
def campaign() -> list[Recording]:
    return SHEAR.synthesize({"duration": 1.5, "preload_runs": False, "currents": [0.0, 3.0, 6.0]}, 3)


def test_a_clean_campaign_is_ok(campaign: list[Recording]) -> None:
    findings = identify(campaign)
    assert findings.verdict == "ok"
    assert not left_out(findings)
    assert not [q for q in findings.quality if q.level == "error"]
    assert_numbers_hold(findings)


# Units and signs


# Clocks


@pytest.mark.thorough
def test_one_late_run_is_set_aside_with_its_lag(campaign: list[Recording]) -> None:
    findings = identify(in_one(campaign, "force", lambda t, F: np.interp(t - 300e-6, t, F)))
    assert findings.verdict == "warning"
    reason = left_out(findings)[ODD]
    assert "later than theirs" in reason
    assert abs(float(reason.split(" us later")[0].split()[-1]) - 300) < 20
    assert_numbers_hold(findings)


# Gains, labels, load


@pytest.mark.thorough
def test_a_gain_error_is_still_named_beside_ordinary_scatter() -> None:
    recordings = SHEAR.synthesize({"duration": 1.0, "preload_runs": False, "gain_scatter": 0.003}, 8)
    findings = identify(in_one(recordings, "force", lambda _, F: 1.06 * F, "sh_10hz_4a"))
    assert set(left_out(findings)) == {"sh_10hz_4a"}
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_ordinary_scatter_sets_no_run_aside() -> None:
    findings = identify(SHEAR.synthesize({"duration": 1.0, "preload_runs": False, "gain_scatter": 0.004}, 8))
    assert findings.verdict == "ok"
    assert not left_out(findings)
    scatter = findings.one("run_scatter")
    assert scatter.ci95 is not None
    assert scatter.ci95[0] < 0.004 < scatter.ci95[1]
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_two_runs_that_contradict_each_other_are_both_named_and_neither_is_left_out(campaign: list[Recording]) -> None:
    # At 6 A only two runs: k_MR follows either of them, so which is wrong cannot be told.
    few = [r for r in campaign if r.run not in ("sh_5hz_6a", "sh_5hz_3a", "sh_10hz_3a", "sh_15hz_3a")]
    findings = identify(in_one(few, "force", lambda _, F: 1.05 * F, "sh_15hz_6a"))
    assert findings.verdict == "warning"
    assert not left_out(findings)
    assert said(findings, "sh_10hz_6a", "sh_15hz_6a", "contradict each other")


@pytest.mark.thorough
def test_swapped_labels_without_a_current_channel_are_both_found() -> None:
    recordings = SHEAR.synthesize({"duration": 1.0, "preload_runs": False}, 3)
    swap = {"sh_10hz_4a": 6.0, "sh_10hz_6a": 4.0}
    labelled = [
        without_channel(with_conditions(r, coil_current=swap.get(r.run, r.conditions["coil_current"])), "current")
        for r in recordings
    ]
    findings = identify(labelled)
    assert findings.verdict == "warning"
    assert set(left_out(findings)) == set(swap)
    assert "goes with the runs at 4 A but is labelled 6 A" in left_out(findings)["sh_10hz_4a"]
    assert_numbers_hold(findings)


# Bent signals


@pytest.mark.thorough
def test_clipping_before_the_noise_comes_in_is_set_aside_as_a_contradiction(campaign: list[Recording]) -> None:
    findings = identify(
        in_one(campaign, "force", lambda _, F: np.clip(F, -0.8 * F.max(), 0.8 * F.max()) + noise(1, F.size, 0.3))
    )
    assert "contradicts the other runs" in left_out(findings)[ODD]
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_a_coarse_converter_is_not_taken_for_clipping(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda _, F: 2.0 * np.round(F / 2.0)))
    assert not left_out(findings)
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_an_asymmetric_force_rejects_the_model_and_is_named(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda _, F: np.where(F > 0, 1.3 * F, F)))
    assert findings.verdict == "rejected"
    assert any("the force is asymmetric" in reason for reason in findings.reasons)
    assert findings.find("stiffness_secant")  # the loops' own numbers stand


# Dead, wild and missing samples


@pytest.mark.parametrize(
    ("channel", "change", "words"),
    [
        ("force", lambda _, v: np.full(v.size, 3.2), "dead"),
        ("force", lambda _, v: noise(4, v.size), "does not follow"),
        ("force", lambda _, v: np.full(v.size, np.nan), "no number"),
        ("displacement", lambda _, v: np.zeros(v.size), "dead"),
        ("displacement", lambda _, v: noise(4, v.size, 1.5e-6), "does not move"),
        ("force", lambda t, v: np.where((t > 0.5) & (t < 0.9), v[2500], v), "stuck"),
    ],
)
@pytest.mark.thorough
def test_a_dead_channel_of_one_run_leaves_that_run_out(
    campaign: list[Recording], channel: str, change: Change, words: str
) -> None:
    findings = identify(in_one(campaign, channel, change))
    assert findings.verdict == "warning"
    assert words in left_out(findings)[ODD]
    assert_numbers_hold(findings)


def test_nothing_but_dead_channels_is_an_input_error_that_names_one(campaign: list[Recording]) -> None:
    with pytest.raises(InputError, match=r"(?s)no run can be used; 9 runs .sh_5hz_0a.*dead"):
        identify(in_all(campaign, "force", lambda _, F: np.zeros(F.size)))


def test_gaps_and_single_missing_samples_change_nothing(campaign: list[Recording]) -> None:
    def holed(t: np.ndarray, F: np.ndarray) -> np.ndarray:
        F[[50, 777, 3210]] = np.nan
        F[(t > 0.62) & (t < 0.71)] = np.nan
        return F

    findings = identify(in_all(campaign, "force", holed))
    assert findings.verdict == "ok"
    assert_numbers_hold(findings)


def test_lone_wild_samples_are_left_out_and_counted(campaign: list[Recording]) -> None:
    def wild(_: np.ndarray, F: np.ndarray) -> np.ndarray:
        F[[50, 777, 3210]] += 1500
        return F

    findings = identify(in_all(campaign, "force", wild))
    assert said(findings, "3 lone wild samples of force", run=ODD)
    assert_numbers_hold(findings)


def test_a_still_start_does_not_enter(campaign: list[Recording]) -> None:
    def rested(recording: Recording) -> Recording:
        (stream,) = recording.streams.values()
        rest = np.arange(0, 2, 2e-4)
        channels = {}
        for name, channel in stream.channels.items():
            still = np.full(rest.size, channel.values.mean()) + noise(5, rest.size, 1e-3 * np.ptp(channel.values))
            channels[name] = replace(channel, values=np.r_[still, channel.values])
        time = np.r_[rest, 2 + stream.time]
        return replace(recording, streams={stream.name: Stream(stream.name, time, channels)})

    findings = identify(rested(r) for r in campaign)
    assert said(findings, "nothing moves in the first 2", run=ODD)
    assert_numbers_hold(findings)


# Mains


@pytest.mark.thorough
def test_hum_of_another_mains_frequency_is_suspected(campaign: list[Recording]) -> None:
    hummed = in_all(campaign, "force", lambda t, F: F + 5 * np.sin(2 * np.pi * 60 * t + 1))
    findings = identify(hummed)
    assert findings.verdict == "rejected"
    assert said(findings, "mains_frequency: 60")
    assert_numbers_hold(identify(hummed, mains_frequency=60.0))


# Too little


def test_one_run_gives_its_loop_and_what_one_loop_determines(campaign: list[Recording]) -> None:
    findings = identify([campaign[2]])
    assert findings.verdict == "warning"
    assert any("One run only" in reason for reason in findings.reasons)
    for name in ("stiffness_secant", "stiffness_storage", "damping", "shear_modulus_storage"):
        assert findings.one(name, run=campaign[2].run).value
    assert findings.one("k1").value is None
    assert findings.one("k1").description


def test_a_single_cycle_gives_its_metrics_and_no_model() -> None:
    truth = {"duration": 0.25, "preload_runs": False, "currents": [0.0], "frequencies": [5.0]}
    findings = identify(SHEAR.synthesize(truth, 1))
    assert findings.verdict == "warning"
    assert any("dynamic model was not fitted" in reason for reason in findings.reasons)
    assert said(findings, "less than two cycles")
    assert findings.find("stiffness_secant")
    assert not findings.find("k1")


def test_another_device_goes_through_without_pads_and_currents(campaign: list[Recording]) -> None:
    bare = [
        replace(without_channel(r, "current"), conditions={}) for r in campaign if r.conditions["coil_current"] == 0
    ]
    findings = identify(bare)
    names = {parameter.name for parameter in findings.parameters}
    assert not names & {"k_mr", "s_mr", "shear_modulus_storage", "mr_effect_force"}
    assert not findings.published
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_runs_at_unnamed_currents_are_rejected_with_the_condition_to_give(campaign: list[Recording]) -> None:
    findings = identify(replace(without_channel(r, "current"), conditions={}) for r in campaign)
    assert findings.verdict == "rejected"
    assert any("give 'coil_current'" in advice for advice in findings.advice)


@pytest.mark.thorough
def test_a_coil_that_is_not_held_is_no_single_operating_point(campaign: list[Recording]) -> None:
    switched = in_one(campaign, "current", lambda t, i: np.where(np.sin(2 * np.pi * 3 * t) > 0, i, 0.0))
    findings = identify(switched)
    assert findings.verdict in ("warning", "rejected")
    assert said(findings, "no single operating point")


@pytest.mark.parametrize(
    ("label", "factor", "words"),
    [("amplitude", 2.0, "peak to peak"), ("frequency", 2.0, "wrong time base")],
)
@pytest.mark.thorough
def test_labels_that_the_record_contradicts_are_told(
    campaign: list[Recording], label: str, factor: float, words: str
) -> None:
    findings = identify(with_conditions(r, **{label: factor * r.condition(label)}) for r in campaign)
    assert said(findings, words)
    assert_numbers_hold(findings)
