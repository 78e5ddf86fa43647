"""From logs of the synthetic gearbox to findings: the truth comes back, what cannot be told is null with its reason."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox import EXPERIMENTS
from pipeline.rigs.gearbox.cycle import locked_torques
from pipeline.rigs.gearbox.declaration import PARAMETERS, LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.model.friction import drag_locked
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import GearboxTruth, gearbox_truth

TRUTH = GearboxTruth()
SEED = 7


def findings_of(recordings: list[Recording]) -> Findings:
    return identify(recordings, LoadExchangeSettings(), Context("test", {}))


def of_truth(truth: Mapping[str, Any], seed: int = SEED) -> Findings:
    return findings_of(synthesize({"runs": ("g3",), **truth}, seed))


@pytest.fixture(scope="module")
def campaign() -> Findings:
    return findings_of(synthesize({}, SEED))


def value(findings: Findings, name: str, **at: float | str | bool) -> float:
    found = next(p for p in findings.find(name, **at) if at or not p.at)
    assert found.value is not None
    return found.value


def sigmas(findings: Findings, name: str, truth: float, **at: float | str | bool) -> float:
    found = next(p for p in findings.find(name, **at) if at or not p.at)
    assert found.value is not None
    assert found.std_error
    return (found.value - truth) / found.std_error


def test_every_name_of_the_sheet_is_found_and_no_other(campaign: Findings) -> None:
    assert {p.name for p in campaign.parameters} == {spec.name for spec in PARAMETERS}


def test_load_inertia_and_drag_of_the_campaign_come_back(campaign: Findings) -> None:
    assert abs(value(campaign, "inertia_load") / TRUTH.J_L - 1.0) < 0.015
    for name, truth in (("inertia_load", TRUTH.J_L), ("drag_coulomb", TRUTH.d0), ("drag_viscous", TRUTH.d1)):
        assert abs(sigmas(campaign, name, truth)) < 3.5


def test_inertia_of_each_run_lies_within_six_percent(campaign: Findings) -> None:
    single = [p.value for p in campaign.find("inertia_load") if p.at]
    assert len(single) == 8
    assert all(one is not None and abs(one / TRUTH.J_L - 1.0) < 0.06 for one in single)


def test_nominal_torques_lie_within_the_acceptance_of_the_sheet(campaign: Findings) -> None:
    for run, _ in known_runs(TRUTH, SEED):
        t_in, t_out = locked_torques(TRUTH, run.speed)
        for stage in ("fos", "fos_after"):
            assert abs(value(campaign, "torque_in_nominal", run=run.name, stage=stage) - t_in) < 0.015
            assert abs(value(campaign, "torque_out_nominal", run=run.name, stage=stage) - t_out) < 0.012


def test_events_and_input_speed_of_a_run_come_back(campaign: Findings) -> None:
    run = next(run for run, _ in known_runs(gearbox_truth({"runs": ("g1",)}), SEED))
    for event, time in run.events.items():
        if event != "motor_on":
            assert abs(value(campaign, "event_time", run="g1", event=event) - time) < 0.15
    held = (run.motion.time > 12.0) & (run.motion.time < 19.0)
    assert value(campaign, "speed_in_sos", run="g1") == pytest.approx(float(run.motion.w1[held].mean()), rel=2e-4)


def test_slope_drag_lock_and_slip_torque_come_back(campaign: Findings) -> None:
    assert abs(sigmas(campaign, "torque_transfer_slope", TRUTH.a)) < 3.5
    assert abs(sigmas(campaign, "slip_torque_slope", TRUTH.M_v)) < 3.5
    for parameter in campaign.find("drag_locked"):
        w = float(parameter.at["speed"])
        truth = drag_locked(w, TRUTH.c0, TRUTH.c_s, TRUTH.w_s, TRUTH.b0)
        assert parameter.value == pytest.approx(truth, abs=0.035)
    for run, _ in known_runs(TRUTH, SEED):
        assert value(campaign, "lock_torque", run=run.name) == pytest.approx(run.lock_torque, abs=0.12)


def test_heat_in_sos_is_input_torque_times_input_speed(campaign: Findings) -> None:
    for run in ("g1", "g5"):
        product = value(campaign, "torque_in_nominal", run=run, stage="sos") * value(campaign, "speed_in_sos", run=run)
        assert value(campaign, "power_dissipated_sos", run=run) == pytest.approx(product, rel=1e-12)


def test_relief_and_residual_add_up_to_one(campaign: Findings) -> None:
    for side in ("in", "out"):
        total = value(campaign, f"torque_relief_{side}", run="g7") + value(
            campaign, f"torque_residual_{side}", run="g7"
        )
        assert total == pytest.approx(1.0)


def test_a_slope_that_is_not_one_asks_for_cross_calibration(campaign: Findings) -> None:
    assert campaign.verdict == "warning"
    assert any("not 1" in reason for reason in campaign.reasons)
    assert any("Cross-calibrate" in advice for advice in campaign.advice)


def test_the_papers_reductions_are_told_to_be_residuals(campaign: Findings) -> None:
    rows = [row for row in campaign.published if row.name.startswith("torque reduction") and row.basis == "logs"]
    assert len(rows) == 4
    assert all(row.agrees is False and "residual" in row.remark for row in rows)


def test_the_report_has_its_chapters(campaign: Findings) -> None:
    chapters = [section.name for section in EXPERIMENTS[0].sections(campaign)]
    assert chapters == ["stages", "torques", "map", "power", "inertia", "friction", "speeds", "vibration"]
    assert len(EXPERIMENTS[0].methods(campaign)) == 6


def test_without_vibration_the_nominal_input_speed_is_an_assumption() -> None:
    findings = of_truth({"vibration": False})
    speed, power = findings.one("speed_in_sos"), findings.one("power_dissipated_sos")
    assert speed.value is None
    assert "assumed nominal" in speed.description
    assert power.value is not None
    assert power.ci95 is not None
    assert power.ci95[0] < 0.75 * power.value < power.value < power.ci95[1]
    assert "assumed nominal" in power.description
    assert [section.name for section in EXPERIMENTS[0].sections(findings)][-1] == "speeds"


def test_without_standstill_ratios_are_null_and_differences_are_not() -> None:
    findings = of_truth({"fixture": "no_standstill"})
    for name in ("efficiency_fos", "torque_ratio_sos", "torque_relief_in", "lock_torque", "drag_coulomb"):
        assert all(p.value is None and "zero offsets are unknown" in p.description for p in findings.find(name))
    assert value(findings, "breakaway_rise_in", run="g3") == pytest.approx(2.17 - 0.94, abs=0.1)
    assert abs(value(findings, "inertia_load") / TRUTH.J_L - 1.0) < 0.08
    level = findings.one("torque_in_nominal", stage="fos")
    assert level.value is not None
    assert level.ci95 is None


def test_two_speeds_give_drag_by_speed_and_no_stribeck_curve() -> None:
    findings = findings_of(synthesize({"runs": ("g3", "g7"), "vibration": False}, SEED))
    assert len(findings.find("drag_locked")) == 2
    assert all(findings.one(name).value is None for name in ("c0", "c_s", "w_s", "b0"))


def test_offsets_cancel_where_they_must() -> None:
    plain = of_truth({"vibration": False})
    shifted = of_truth({"vibration": False, "offset_in": 0.2, "offset_out": -0.15})
    for name in ("efficiency_fos", "breakaway_drop_in", "lock_torque", "inertia_load"):
        first, second = (f.find(name)[0].value for f in (plain, shifted))
        assert first is not None
        assert second == pytest.approx(first, rel=0.01)


def test_a_log_without_noise_needs_no_made_up_error() -> None:
    findings = of_truth({"noise": 0.0, "ripple_in": 0.0, "ripple_out": 0.0})
    assert abs(value(findings, "inertia_load") / TRUTH.J_L - 1.0) < 0.02
    assert all(p.std_error is None or (math.isfinite(p.std_error) and p.std_error >= 0) for p in findings.parameters)
    assert np.isfinite(value(findings, "efficiency_fos", run="g3"))
