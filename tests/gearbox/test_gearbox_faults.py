"""Bad gearbox logs beyond the rows of the sheet (`test_gearbox_bad_data`): each fault has its message, and no number is made up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.check import check
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.synthetic import synthesize

PLAIN = {"runs": ("g3",), "vibration": False}


def recording_of(truth: Mapping[str, Any]) -> Recording:
    return synthesize({**PLAIN, **truth}, 5)[0]


def findings_of(recording: Recording) -> Findings:
    return identify([recording], LoadExchangeSettings(), Context("test", {}))


def messages(findings: Findings, level: str = "warning") -> str:
    return " ".join(q.message for q in findings.quality if q.level == level)


def refused(recording: Recording) -> str:
    with pytest.raises(InputError) as caught:
        findings_of(recording)
    said = [finding.message for finding in check(recording) if finding.level == "error"]
    assert said
    assert said[0].removeprefix(f"run '{recording.run}' ").rstrip(".")[:60] in str(caught.value)
    return str(caught.value)


def test_a_missing_decoding_is_found_from_the_nominal_speed() -> None:
    recording = recording_of({"encoder_decoding": 1})
    conditions = {name: v for name, v in recording.conditions.items() if name != "encoder_decoding"}
    findings = findings_of(replace(recording, conditions=conditions))
    assert "x1 fits" in messages(findings, "note")
    assert findings.one("speed_out_nominal").value == pytest.approx(12.566, rel=1e-3)


def test_a_nominal_speed_in_rpm_is_named() -> None:
    recording = recording_of({})
    assert "speed_nominal is in rpm" in refused(
        replace(recording, conditions={**recording.conditions, "speed_nominal": 120.0})
    )


def test_a_clock_that_is_off_is_told_and_moved() -> None:
    findings = findings_of(recording_of({"encoder_shift": 0.3}))
    clock = findings.arrays["clocks"].set_index("board").loc["encoder"]
    assert clock["applied"]
    assert clock["shift"] == pytest.approx(0.3, abs=0.03)
    assert "encoder board" in messages(findings)
    assert findings.one("event_time", event="sos_start").value == pytest.approx(10.35, abs=0.1)


def test_a_shaft_that_never_turns_is_refused() -> None:
    recording = recording_of({})
    stream = recording.streams["encoder"]
    still = Channel("encoder_count_out", np.zeros(stream.time.size), "1")
    streams = {**recording.streams, "encoder": Stream("encoder", stream.time, {"encoder_count_out": still})}
    assert "never turns" in refused(replace(recording, streams=streams))


def test_a_dead_torque_is_refused() -> None:
    recording = recording_of({})
    stream = recording.streams["torque"]
    channels = {**stream.channels, "torque_out": Channel("torque_out", np.zeros(stream.time.size), "N*m")}
    dead = replace(recording, streams={**recording.streams, "torque": replace(stream, channels=channels)})
    assert "torque_out does not move at all" in refused(dead)


def test_a_nominal_speed_that_is_off_does_not_hide_the_mesh_lines() -> None:
    recording = recording_of({"vibration": True})
    findings = findings_of(replace(recording, conditions={**recording.conditions, "speed_nominal": 15.0}))
    assert findings.one("speed_in_sos").value == pytest.approx(12.3786, rel=1e-3)
    assert "times speed_nominal" in messages(findings)


def test_a_log_without_encoder_or_torque_says_what_it_has() -> None:
    recording = recording_of({})
    alone = replace(recording, streams={"torque": recording.streams["torque"]})
    assert "'encoder_count_out' nor 'speed_out'" in refused(alone)
    alone = replace(recording, streams={"encoder": recording.streams["encoder"]})
    assert "torque_in, torque_out" in refused(alone)


def test_samples_that_are_no_numbers_are_bridged_and_told() -> None:
    recording = recording_of({})
    stream = recording.streams["torque"]
    values = stream.channels["torque_in"].values.copy()
    values[12000:12040] = np.nan
    channels = {**stream.channels, "torque_in": Channel("torque_in", values, "N*m")}
    findings = findings_of(
        replace(recording, streams={**recording.streams, "torque": replace(stream, channels=channels)})
    )
    assert "40 samples are no numbers" in messages(findings)
    assert findings.one("efficiency_fos").value is not None


def test_one_bad_run_is_left_out_and_the_others_stay() -> None:
    good, bad = recording_of({}), replace(recording_of({"gain_in": -1.0}), run="bad")
    findings = identify([good, bad], LoadExchangeSettings(), Context("test", {}))
    assert [run.used for run in findings.runs] == [True, False]
    assert any("Run bad is left out" in reason for reason in findings.reasons)


def scaled(recording: Recording, **factors: float) -> Recording:
    stream = recording.streams["torque"]
    channels = {
        name: Channel(name, factors.get(name, 1.0) * channel.values, channel.unit)
        for name, channel in stream.channels.items()
    }
    return replace(recording, streams={**recording.streams, "torque": Stream("torque", stream.time, channels)})


@pytest.mark.parametrize("factor", [1e-3, 1e3])
@pytest.mark.parametrize("name", ["torque_in", "torque_out"])
def test_one_torque_in_another_unit_is_no_swap(name: str, factor: float) -> None:
    said = refused(scaled(recording_of({}), **{name: factor}))
    assert "one of them is in another unit than declared, by about a thousand" in said
    assert "swapped" not in said


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_both_torques_in_another_unit_show_in_the_inertia(factor: float) -> None:
    findings = findings_of(scaled(recording_of({}), torque_in=factor, torque_out=factor))
    assert findings.verdict == "rejected"
    assert any("look at its unit (N m against mN m)" in reason for reason in findings.reasons)
    assert findings.one("inertia_load", run="g3").value is None


@pytest.mark.parametrize("name", ["torque_in", "torque_out"])
def test_a_sensor_that_only_makes_noise_is_refused(name: str) -> None:
    recording = recording_of({})
    stream = recording.streams["torque"]
    noise = 0.01 + 0.002 * np.random.default_rng(1).normal(size=stream.time.size)
    channels = {**stream.channels, name: Channel(name, noise, "N*m")}
    dead = replace(recording, streams={**recording.streams, "torque": Stream("torque", stream.time, channels)})
    assert f"{name} does not follow the load" in refused(dead)


@pytest.mark.parametrize(("gain", "verdict"), [(0.1, "rejected"), (0.3, "warning")])
def test_a_slope_that_no_locked_gearbox_has_is_told_and_a_wrong_unit_rejected(gain: float, verdict: str) -> None:
    findings = findings_of(recording_of({"gain_out": gain}))
    assert any("which no gearbox locked as one body has" in reason for reason in findings.reasons)
    assert findings.verdict == verdict


def test_runs_of_one_gain_and_another_are_told_apart_and_keep_their_own_slope() -> None:
    one, other = (
        synthesize({**PLAIN, "a": 1.0, "brake_capacity": 2.4, "runs": [run], "gain_out": gain}, 5)[0]
        for run, gain in (("g3", 1.0), ("g6", 0.55))
    )
    findings = identify([one, other], LoadExchangeSettings(), Context("test", {}))
    told = next(reason for reason in findings.reasons if "do not have one slope" in reason)
    assert "run g3 has 0.9" in told
    assert "run g6 0.5" in told
    assert not any("as a rigid box has" in reason for reason in findings.reasons)
    (common,) = (one for one in findings.find("torque_transfer_slope") if not one.at)
    assert common.value is None
    assert findings.one("slip_torque", run="g6").value is not None


def test_fos_under_load_has_no_part_in_the_load_fit() -> None:
    findings = findings_of(recording_of({"brakes": [[7.0, 10.0, 0.2], [12.0, 15.0, 0.4], [17.0, 22.0, 1.3]]}))
    inertia = findings.one("inertia_load", run="g3")
    assert inertia.ci95[0] < 0.0195 < inertia.ci95[1]
    assert abs(inertia.value / 0.0195 - 1) < 0.06


def test_a_run_without_its_core_numbers_is_not_ok() -> None:
    # A box whose map has slope 1, so that nothing else warns.
    box = {"a": 1.0, "brake_capacity": 2.4, "c0": 0.2, "c_s": 0.1}
    whole = findings_of(recording_of({**box, "vibration": True}))
    assert whole.verdict == "ok"
    without = findings_of(recording_of(box))
    assert without.verdict == "warning"
    assert any("Missing" in reason and "speed_in_sos" in reason for reason in without.reasons)
    short = findings_of(recording_of({**box, "vibration": True, "brake_on": 4.6}))
    assert short.verdict == "warning"
    assert any("too short for a nominal value" in reason for reason in short.reasons)


@pytest.mark.thorough
def test_another_flywheel_is_not_averaged_into_the_campaign() -> None:
    runs = [synthesize({**PLAIN, "runs": ("g3",)}, seed)[0] for seed in (1, 2, 3)]
    heavy = synthesize({**PLAIN, "runs": ("g5",), "J_L": 0.026}, 4)
    findings = identify([*runs[:1], *heavy], LoadExchangeSettings(), Context("test", {}))
    assert "the runs do not move the same inertia: run g3 moves" in messages(findings)
    assert next(p for p in findings.parameters if p.name == "inertia_load" and not p.at).value is None
    named = [replace(run, run=f"run {i}") for i, run in enumerate(runs)]
    findings = identify([*named, *heavy], LoadExchangeSettings(), Context("test", {}))
    assert "run g5 moves 2" in messages(findings)
    alike = identify(named, LoadExchangeSettings(), Context("test", {}))
    assert "same inertia" not in messages(alike)


@pytest.mark.parametrize(("stated", "verdict"), [(0.019, "ok"), (0.03, "warning"), (0.01, "warning")])
@pytest.mark.thorough
def test_a_stated_flywheel_that_contradicts_the_inertia_is_told(stated: float, verdict: str) -> None:
    recording = recording_of({"vibration": True, "a": 1.0, "brake_capacity": 2.4, "c0": 0.2, "c_s": 0.1})
    findings = findings_of(replace(recording, conditions={**recording.conditions, "flywheel_inertia": stated}))
    assert findings.verdict == verdict
    assert any("times the flywheel's stated" in reason for reason in findings.reasons)
