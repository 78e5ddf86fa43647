"""Faults of section 8, injected into the synthetic rig: what is said, the verdict, and no wrong number as good."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from faulty_logs import (
    ODD,
    TRUTH,
    Change,
    assert_numbers_hold,
    changed,
    identify,
    in_all,
    in_one,
    left_out,
    noise,
    said,
    with_channel,
    with_conditions,
    without_channel,
)
from scipy.signal import butter, lfilter

from pipeline.errors import InputError
from pipeline.recording import Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings


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


def test_millimetres_taken_as_metres_in_every_run_are_doubted_with_the_factor(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "displacement", lambda _, x: 1e3 * x))
    assert findings.verdict == "warning"
    assert any("mm taken as m" in reason and "factor 1000" in reason for reason in findings.reasons)
    assert said(findings, "times what the label says", "1000")


def test_kilonewtons_taken_as_newtons_in_every_run_are_doubted(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda _, F: 1e-3 * F))
    assert findings.verdict == "warning"
    assert any("kN taken as N" in reason for reason in findings.reasons)


@pytest.mark.parametrize(
    ("channel", "factor", "words"),
    [("displacement", 1e3, "mm taken as m"), ("force", 1e3, "N taken as kN"), ("force", 1e-3, "kN taken as N")],
)
def test_a_run_in_another_unit_is_left_out_and_the_others_hold(
    campaign: list[Recording], channel: str, factor: float, words: str
) -> None:
    findings = identify(in_one(campaign, channel, lambda _, v: factor * v))
    assert findings.verdict == "warning"
    assert words in left_out(findings)[ODD]
    assert_numbers_hold(findings)


def test_one_inverted_force_is_left_out_with_the_line_that_mends_it(campaign: list[Recording]) -> None:
    findings = identify(in_one(campaign, "force", lambda _, F: -F))
    assert findings.verdict == "warning"
    assert "sign: -1" in left_out(findings)[ODD]
    assert "sign of one of them is wrong" in left_out(findings)[ODD]
    assert_numbers_hold(findings)


def test_swapped_channels_of_one_run_are_named(campaign: list[Recording]) -> None:
    def swapped(recording: Recording) -> Recording:
        x, F = recording.values("displacement"), recording.values("force")
        return changed(changed(recording, "displacement", lambda *_: F), "force", lambda *_: x)

    findings = identify(swapped(r) if r.run == ODD else r for r in campaign)
    assert "swapped" in left_out(findings)[ODD]
    assert_numbers_hold(findings)


def test_every_force_inverted_rejects_the_data_and_fits_nothing(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda _, F: -F))
    assert findings.verdict == "rejected"
    assert not findings.find("k1")
    assert not findings.models
    assert "loops" in findings.arrays  # the evidence is shown


# Clocks


def test_a_late_force_is_fitted_reported_and_warned_of(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda t, F: np.interp(t - 200e-6, t, F)))
    lag = findings.one("force_lag")
    assert lag.value == pytest.approx(200e-6 + TRUTH.force_lag, abs=5e-6)
    assert said(findings, "us late")
    assert_numbers_hold(findings)


def test_one_late_run_is_set_aside_with_its_lag(campaign: list[Recording]) -> None:
    findings = identify(in_one(campaign, "force", lambda t, F: np.interp(t - 300e-6, t, F)))
    assert findings.verdict == "warning"
    reason = left_out(findings)[ODD]
    assert "later than theirs" in reason
    assert abs(float(reason.split(" us later")[0].split()[-1]) - 300) < 20
    assert_numbers_hold(findings)


def test_a_slow_filter_on_one_channel_is_doubted(campaign: list[Recording]) -> None:
    def filtered(t: np.ndarray, F: np.ndarray) -> np.ndarray:
        first_order = butter(1, 300, fs=5000)
        return np.asarray(lfilter(*first_order, F - F.mean()))

    findings = identify(in_all(campaign, "force", filtered))
    assert findings.verdict == "warning"
    assert any("If it is that of a filter" in reason for reason in findings.reasons)


# Gains, labels, load


def test_a_gain_error_of_one_run_is_named_with_its_size(campaign: list[Recording]) -> None:
    findings = identify(in_one(campaign, "force", lambda _, F: 1.03 * F))
    assert findings.verdict == "warning"
    assert set(left_out(findings)) == {ODD}
    assert "+3.0 % off" in left_out(findings)[ODD]
    assert_numbers_hold(findings)


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


def test_two_runs_that_contradict_each_other_are_both_named_and_neither_is_left_out(campaign: list[Recording]) -> None:
    # At 6 A only two runs: k_MR follows either of them, so which is wrong cannot be told.
    few = [r for r in campaign if r.run not in ("sh_5hz_6a", "sh_5hz_3a", "sh_10hz_3a", "sh_15hz_3a")]
    findings = identify(in_one(few, "force", lambda _, F: 1.05 * F, "sh_15hz_6a"))
    assert findings.verdict == "warning"
    assert not left_out(findings)
    assert said(findings, "sh_10hz_6a", "sh_15hz_6a", "contradict each other")


def test_the_measured_current_is_trusted_over_a_swapped_label(campaign: list[Recording]) -> None:
    swap = {3.0: 6.0, 6.0: 3.0}
    labels = [with_conditions(r, coil_current=swap.get(r.conditions["coil_current"], 0.0)) for r in campaign]  # type: ignore[arg-type]
    findings = identify(labels)
    assert findings.verdict == "warning"
    assert said(findings, "the measured current is 3.00 A but the label says 6.00 A", run=ODD)
    assert_numbers_hold(findings)


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


def test_an_axial_load_that_the_field_changes_is_told(campaign: list[Recording]) -> None:
    loaded = [with_channel(r, "force_axial", 200 + 21.0 * r.condition("coil_current"), "N") for r in campaign]
    findings = identify(loaded)
    assert findings.verdict == "warning"
    assert said(findings, "+63 % off the preload")


def test_remanence_at_zero_current_is_told(campaign: list[Recording]) -> None:
    findings = identify(with_channel(r, "flux_density", 0.012, "T") for r in campaign)
    assert findings.verdict == "warning"
    assert said(findings, "12.0 mT remain at 0 A", run="sh_5hz_0a")


def test_a_trend_over_the_sequence_is_told_with_its_size(campaign: list[Recording]) -> None:
    heated = [
        with_conditions(changed(r, "force", lambda _, F, i=i: F * (1 - 0.004 * i)), sequence_index=float(i))  # type: ignore[misc]
        for i, r in enumerate(campaign)
    ]
    findings = identify(heated)
    assert findings.verdict == "warning"
    assert any("Stiffness changes by -3" in reason for reason in findings.reasons)


@pytest.mark.thorough
def test_an_untared_mass_is_found_and_the_rest_holds(campaign: list[Recording]) -> None:
    def inertia(recording: Recording) -> Recording:
        t, x = recording.signal("displacement")
        f = recording.condition("frequency")
        found = SHEAR.identify([recording], ShearSettings(), Context("one", {})).one("damping", run=recording.run)
        turning = 2 * np.pi * float(found.at.get("frequency", f)) * t[:, None] * np.arange(1, 4)
        basis = np.hstack([np.cos(turning), np.sin(turning), np.ones((t.size, 1))])
        weight = np.r_[np.tile((2 * np.pi * float(found.at["frequency"]) * np.arange(1, 4)) ** 2, 2), 0.0]
        acceleration = -basis @ (weight * np.linalg.lstsq(basis, x, rcond=None)[0])
        return changed(recording, "force", lambda _, F: F + 0.3 * acceleration)

    findings = identify(inertia(r) for r in campaign)
    mass = findings.one("moving_mass")
    assert mass.ci95 is not None
    assert mass.ci95[0] < 0.3 < mass.ci95[1]
    assert findings.verdict == "warning"
    assert said(findings, "untared mass")
    assert_numbers_hold(findings)


# Bent signals


def test_a_clipped_force_is_left_out(campaign: list[Recording]) -> None:
    findings = identify(in_one(campaign, "force", lambda _, F: np.clip(F, -0.9 * F.max(), 0.9 * F.max())))
    assert "clipped" in left_out(findings)[ODD]
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_clipping_before_the_noise_comes_in_is_set_aside_as_a_contradiction(campaign: list[Recording]) -> None:
    findings = identify(
        in_one(campaign, "force", lambda _, F: np.clip(F, -0.8 * F.max(), 0.8 * F.max()) + noise(1, F.size, 0.3))
    )
    assert "contradicts the other runs" in left_out(findings)[ODD]
    assert_numbers_hold(findings)


def test_a_coarse_converter_is_not_taken_for_clipping(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda _, F: 2.0 * np.round(F / 2.0)))
    assert not left_out(findings)
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_sliding_pads_are_suspected_from_the_plateau(campaign: list[Recording]) -> None:
    def slid(t: np.ndarray, F: np.ndarray) -> np.ndarray:
        limit = 0.6 * np.abs(F - F.mean()).max()
        return np.clip(F - F.mean(), -limit, limit) + noise(2, t.size)

    findings = identify(in_all(campaign, "force", slid))
    assert findings.verdict == "rejected"
    assert said(findings, "sliding")


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


def test_a_transient_at_the_start_does_not_enter(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda t, F: F * (1 + 0.06 * np.exp(-12 * t))))
    assert said(findings, "is not settled", run=ODD)
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


def test_hum_on_a_harmonic_is_left_out_and_said(campaign: list[Recording]) -> None:
    findings = identify(in_all(campaign, "force", lambda t, F: F + 5 * np.sin(2 * np.pi * 50 * t + 1)))
    assert said(findings, "mains frequency, 50 Hz, do not enter", "Frequencies that do not divide it")
    assert_numbers_hold(findings)


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


def test_one_frequency_does_not_separate_k1_from_k2_and_the_advice_says_what_would() -> None:
    findings = identify(
        SHEAR.synthesize({"duration": 1.5, "preload_runs": False, "frequencies": [10.0], "currents": [0.0, 6.0]}, 2)
    )
    assert findings.verdict == "warning"
    assert findings.one("k1").value is None
    assert any("Add a run at 2 Hz" in advice for advice in findings.advice)


def test_small_loops_leave_only_the_sum_of_k2_and_alpha_rho() -> None:
    truth = {"duration": 2.0, "preload_runs": False, "amplitudes": [1e-4], "currents": [0.0]}
    findings = identify(SHEAR.synthesize(truth, 2))
    assert findings.verdict == "warning"
    assert findings.one("alpha_bw").value is None
    total = findings.one("k2_plus_alpha_rho")
    assert total.ci95 is not None
    assert total.ci95[0] < TRUTH.k2 + TRUTH.alpha_bw * TRUTH.rho < total.ci95[1]
    assert any("amplitude" in advice for advice in findings.advice)


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
def test_labels_that_the_record_contradicts_are_told(
    campaign: list[Recording], label: str, factor: float, words: str
) -> None:
    findings = identify(with_conditions(r, **{label: factor * r.condition(label)}) for r in campaign)
    assert said(findings, words)
    assert_numbers_hold(findings)
