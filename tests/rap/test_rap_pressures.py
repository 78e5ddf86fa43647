"""`rap.pressures` from recordings to findings: known truth is found, campaigns of several runs, reports draw."""

from __future__ import annotations

import numpy as np
import pytest
from pressure_logs import ML_MIN, MMHG, SHORT, found, pressures, told, usual, without

from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.rap.pressures.declaration import PARAMETERS
from pipeline.rigs.rap.pressures.methods import methods
from pipeline.rigs.rap.pressures.paper import paper_alone, reynolds, tube_inertance, womersley
from pipeline.rigs.rap.pressures.sections import sections

TRUTH = {
    ("gain", "access"): 1.012, ("gain", "prefilter"): 1.015, ("gain", "return"): 0.990, ("gain", "uf"): 1.008,
    ("offset", "access"): -60.0, ("offset", "prefilter"): 80.0, ("offset", "return"): 40.0, ("offset", "uf"): -30.0,
}  # fmt: skip
CIRCUIT = {
    "r_access": 1.4e9, "r_filter": 1.2e9, "r_return": 1.4e9, "c_return": 6e-11, "l_return": 1.2e8, "c_uf": 3e-11, "k_uf": 2.0835e-11,
}  # fmt: skip


@pytest.fixture(scope="module")
def whole() -> Recording:
    return pressures(3)


@pytest.fixture(scope="module")
def findings(whole: Recording) -> Findings:
    return found(whole)


def test_sound_run_is_ok_and_tells_every_parameter(findings: Findings) -> None:
    assert findings.verdict == "ok"
    assert {p.name for p in findings.parameters} == {spec.name for spec in PARAMETERS}
    assert all(p.value is not None and p.ci95 is not None for p in findings.parameters)


def test_clock_is_found_as_in_the_sheet(findings: Findings) -> None:
    lag, rate, pole = (findings.one(name) for name in ("lag", "clock_rate", "sensor_pole"))
    assert lag.value == pytest.approx(3.37 + 40e-6 * 311.7, abs=5e-4)
    assert rate.value == pytest.approx(40e-6, abs=2e-6)
    assert pole.value == pytest.approx(0.030, abs=5e-4)


def test_gains_and_offsets_are_those_of_the_truth(findings: Findings) -> None:
    for (name, tap), truth in TRUTH.items():
        one = findings.one(name, channel=tap)
        assert one.value == pytest.approx(truth, abs=0.003 if name == "gain" else 6.0), (name, tap)


def test_limits_of_agreement_are_as_narrow_as_in_the_sheet(findings: Findings) -> None:
    for tap, half in (("access", 0.45), ("prefilter", 0.59), ("return", 0.41), ("uf", 0.45)):
        low, high = findings.one("limit_lower", channel=tap).value, findings.one("limit_upper", channel=tap).value
        assert low is not None
        assert high is not None
        assert (high - low) / (2 * MMHG) == pytest.approx(half, abs=0.05), tap
        assert low < (findings.one("bias", channel=tap).value or 0.0) < high


def test_hydraulics_are_those_of_the_truth(findings: Findings) -> None:
    for name, truth in CIRCUIT.items():
        assert findings.one(name).value == pytest.approx(truth, rel=0.01), name


def test_coherence_is_told_at_each_line_tap_and_set_point(findings: Findings) -> None:
    at = [p.at for p in findings.find("coherence")]
    assert {a["channel"] for a in at} == {"access", "prefilter", "return", "uf"}
    assert {round(float(a["flow_set"]) / ML_MIN) for a in at} == {60, 80, 100}
    first = findings.find("coherence", channel="prefilter", harmonic=1.0)
    assert all(p.value is not None and p.value > 0.99 for p in first)


@pytest.mark.thorough
def test_uncertainty_of_the_flow_meter_is_told_apart_and_carried(whole: Recording) -> None:
    sure, unsure = found(whole), found(told(whole, {"flowmeter_gain_u": 0.01}))
    a, b = sure.one("r_return"), unsure.one("r_return")
    assert a.std_error is not None
    assert b.std_error is not None
    assert b.value is not None
    assert b.std_error == pytest.approx(np.hypot(a.std_error, 0.01 * b.value), rel=1e-3)
    assert "type B" in b.description
    assert b.type_b == pytest.approx(0.01 * b.value)
    assert a.type_b is None


def test_report_draws_every_chapter_of_the_sheet(findings: Findings) -> None:
    names = [chapter.name for chapter in sections(findings)]
    assert names == ["answers", "clock", "gain", "agreement", "coherence", "set_points", "hydraulics", "checks"]
    assert len(methods(findings)) == 4


def test_gain_outside_its_tolerance_is_told_and_advised() -> None:
    findings = found(pressures(**SHORT, gain_return=0.93))
    assert findings.verdict == "warning"
    assert any("return gain within 2 % of 1: no" in reason for reason in findings.reasons)
    assert any("Recalibrate the device's return sensor" in advice for advice in findings.advice)


def test_runs_of_a_campaign_stand_side_by_side() -> None:
    other = pressures(2, **SHORT, run="second", R_r=1.6e9)
    findings = found(usual(), other)
    assert {p.at.get("run") for p in findings.parameters} == {"rap_press_steps", "second"}
    assert findings.one("r_return", run="second").value == pytest.approx(1.6e9, rel=0.02)
    assert findings.one("r_return", run="rap_press_steps").value == pytest.approx(1.4e9, rel=0.02)
    assert sections(findings)


def test_bad_run_is_left_out_and_the_good_one_stands() -> None:
    names = [c.name for c in usual() if c.name.startswith("pressure_")]
    empty = without(pressures(2, **SHORT, run="second"), *names)
    findings = found(usual(), empty)
    assert findings.verdict == "warning"
    assert [run.used for run in findings.runs] == [True, False]
    assert findings.one("gain", channel="access").value is not None


def test_poles_that_differ_are_told_by_channel() -> None:
    findings = found(pressures(**SHORT, pole_return=0.045))
    assert findings.one("sensor_pole", channel="return").value == pytest.approx(0.045, abs=0.004)
    assert findings.one("sensor_pole", channel="prefilter").value == pytest.approx(0.030, abs=0.004)


def test_run_without_ultrafiltration_leaves_the_membrane_untold() -> None:
    findings = found(pressures(**SHORT, uf_flow=0.0))
    assert findings.one("k_uf").value is None
    assert findings.one("c_uf").value is None
    assert findings.one("r_access").value == pytest.approx(1.4e9, rel=0.02)
    assert findings.verdict == "warning"


def test_paper_alone_is_computed_from_what_it_prints() -> None:
    by = {row.name: row for row in paper_alone()}
    assert "7.2 L" in str(by["accelerated ultrafiltration"].found)
    assert by["heparin flow"].found == "1 to 3 mL/h"
    assert "8.33 / 6.25 / 5.00 %" in by["flow that the resistances rest on"].remark
    assert "2.15 m" in by["priming volume"].remark
    assert all(row.basis == "paper" for row in by.values())


def test_tube_numbers_follow_their_definitions() -> None:
    assert tube_inertance(1.0, 4e-3) == pytest.approx(1004.0 / (np.pi * 4e-6))
    assert reynolds(60 * ML_MIN, 4e-3) == pytest.approx(354, rel=0.01)
    assert womersley(2.2, 4e-3) == pytest.approx(7.9, rel=0.02)
