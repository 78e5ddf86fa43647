"""What `mre.hold` finds on the synthetic rig: names of the sheet, accuracy, saturation, relaxation, field, blank test."""

from __future__ import annotations

import numpy as np
import pytest
from hold_logs import captions, hold, said, without

from pipeline.findings import Findings
from pipeline.findings.figures import Figure, Line, Points
from pipeline.report.palette import style
from pipeline.rigs.mre.hold.analysis import analyse
from pipeline.rigs.mre.hold.blank import pole_pull
from pipeline.rigs.mre.hold.declaration import HOLD, HoldSettings
from pipeline.rigs.mre.hold.identify import usable
from pipeline.rigs.mre.hold.law import saturation
from pipeline.rigs.mre.hold.synthetic import HoldTruth, synthesize

TRUTH = HoldTruth()


def increment(current: float, truth: HoldTruth = TRUTH) -> float:
    z = np.array([current / truth.saturation_current])
    return float(truth.force_gain * saturation(z, truth.sharpness)[0])


@pytest.fixture(scope="module")
def findings() -> Findings:
    return hold(synthesize({}, 4))


def test_the_truth_is_recovered_to_the_accuracy_of_the_sheet(findings: Findings) -> None:
    assert findings.one("force_initial").value == pytest.approx(200.0, rel=3 * 0.0009)
    assert findings.one("force_gain").value == pytest.approx(0.65, abs=3 * 0.0015)
    assert findings.one("saturation_current").value == pytest.approx(5.7, abs=3 * 0.010)
    assert findings.one("sharpness").value == pytest.approx(12.0, abs=3 * 0.35)
    assert findings.one("relaxation").value == pytest.approx(0.02, abs=1e-3)
    assert findings.one("force_increment", coil_current=6.0).value == pytest.approx(0.6271, abs=3 * 0.0012)
    assert findings.one("flux_slope").value == pytest.approx(0.158, rel=3 * 0.0037)
    assert findings.one("flux_saturation").value == pytest.approx(0.95, rel=3 * 0.018)


def test_increments_are_told_at_the_held_currents_by_their_round_names(findings: Findings) -> None:
    told = findings.find("force_increment")
    assert [p.at for p in told] == [{"coil_current": 0.5 * n} for n in range(1, 17)]
    for p in told:
        current = float(p.at["coil_current"])
        assert p.value == pytest.approx(increment(current), abs=4 * (p.std_error or 0))


def test_only_remanence_is_doubted_on_the_good_rig(findings: Findings) -> None:
    assert findings.verdict == "warning"
    assert len(findings.reasons) == 1
    assert said(findings, "remanence", "12 mT")
    assert hold([without(r, "flux_density") for r in synthesize({}, 4)]).verdict == "ok"


def test_the_s_law_wins_by_aicc_over_hinge_tanh_and_fk(findings: Findings) -> None:
    aicc = {model.name: model.aicc for model in findings.models}
    assert min(aicc, key=lambda name: aicc[name] or 0.0) == "S law"
    assert (aicc["hinge"] or 0) < (aicc["tanh"] or 0) < (aicc["FK"] or 0) < (aicc["straight line"] or 0)
    assert [model.name for model in findings.models if model.selected] == ["S law"]


def test_no_sweep_has_the_colour_of_the_law(findings: Findings) -> None:
    blocks = [b for chapter in HOLD.sections(findings) for b in chapter.blocks if isinstance(b, Figure)]
    for figure in (b for b in blocks if b.name in ("law", "time", "flux")):
        points = {m.role for panel in figure.panels for m in panel.marks if isinstance(m, Points)}
        lines = {m.role for panel in figure.panels for m in panel.marks if isinstance(m, Line) and m.role == "model"}
        assert not {style(role).light for role in points} & {style(role).light for role in lines}
        assert len(points) == 2


def test_captions_answer_with_the_numbers_of_the_campaign(findings: Findings) -> None:
    told = captions(findings)
    bend = findings.one("saturation_current")
    assert bend.ci95 is not None
    assert (
        f"Yes: it bends at I_s = {bend.value:.4f} A (95 %: {bend.ci95[0]:.4f} to {bend.ci95[1]:.4f} A)" in told["law"]
    )
    assert "Yes: of up to" in told["time"]
    assert "N between them r = 2.01" in told["time"]
    assert "At 8 A by 65.02 % (95 %: " in told["increments"]
    assert "It tends to B_s = 9" in told["flux"]
    assert "which could be all of the 1" in told["pull"]


@pytest.mark.parametrize("largest", [4.0, 5.5, 6.0])
def test_a_sweep_that_does_not_pass_saturation_leaves_the_limit_open(largest: float) -> None:
    found = hold(synthesize({"largest_current": largest}, 2))
    for name in ("force_gain", "saturation_current", "sharpness"):
        assert found.one(name).value is None
        assert "saturation" in found.one(name).description
    assert said(found, "saturation", "not determined")
    last = found.one("force_increment", coil_current=largest)
    assert last.value == pytest.approx(increment(largest), abs=4 * (last.std_error or 0))
    if largest == 5.5:
        assert "has begun and was not passed: at 5.5 A the slope is still" in captions(found)["law"]
        assert "Saturation is not told: the field only begins" in captions(found)["flux"]
    if largest == 6.0:
        assert "at least 5." in found.one("saturation_current").description


def test_a_law_that_is_straight_then_flat_has_a_least_sharpness_only() -> None:
    found = hold(synthesize({"sharpness": 150.0}, 2))
    assert found.one("sharpness").value is None
    assert "at least" in found.one("sharpness").description
    assert found.one("saturation_current").value == pytest.approx(5.7, abs=0.03)


def test_a_law_that_bends_for_long_is_not_called_saturated() -> None:
    assert hold(synthesize({"sharpness": 1.0}, 2)).one("force_gain").value is None
    assert hold(synthesize({"sharpness": 2.0}, 2)).one("sharpness").value == pytest.approx(2.0, abs=0.15)


def test_one_sweep_direction_is_doubted_and_ignoring_relaxation_is_shown_to_be_wrong() -> None:
    found = hold(synthesize({"down": False}, 2))
    assert "There is one sweep only; r = " in captions(found)["time"]
    assert said(found, "one way only", "59.")
    at_six = found.one("force_increment", coil_current=6.0)
    assert at_six.ci95 is not None
    assert at_six.ci95[0] < increment(6.0) < at_six.ci95[1]
    both = hold(synthesize({}, 2)).one("force_increment", coil_current=6.0)
    assert (at_six.std_error or 0) > 3 * (both.std_error or 0)


def test_creep_within_the_holds_tells_relaxation_without_the_way_down() -> None:
    record = usable(synthesize({"down": False, "hold_duration": 40.0, "current_step": 1.0}, 3)[0], HoldSettings())
    fit = analyse(record, None, None).saturation.fit
    assert fit.r == pytest.approx(0.02, abs=4 * fit.sd({"r": 1.0}))
    assert fit.sd({"r": 1.0}) < 2e-3


def test_hold_to_hold_scatter_widens_the_intervals() -> None:
    quiet, rough = (hold(synthesize({"hold_scatter": s}, 6)).one("force_initial") for s in (0.0, 0.5))
    assert (rough.std_error or 0) > 2 * (quiet.std_error or 0)


def test_a_field_map_of_its_own_belongs_to_the_same_findings() -> None:
    found = hold(synthesize({"field": "own"}, 2))
    assert found.one("flux_slope").value == pytest.approx(0.158, rel=5e-3)
    assert found.one("force_gain").value == pytest.approx(0.65, abs=5e-3)
    assert {run.run for run in found.runs if run.used} == {"hold", "field"}


def test_a_field_map_alone_leaves_the_force_open() -> None:
    found = hold(synthesize({"field": "own"}, 2)[1:])
    assert found.one("force_initial").value is None
    assert found.one("flux_saturation").value == pytest.approx(0.95, rel=0.02)
    assert found.verdict == "warning"


def test_the_pull_of_the_poles_is_taken_off_where_a_blank_test_tells_it() -> None:
    logs = synthesize({"blank": True, "pull": 60.0}, 3)
    at = {"coil_current": 6.0}
    found = hold(logs)
    assert found.one("force_increment", **at).value == pytest.approx(0.627, abs=0.005)
    assert "Both: the blank test shows 53.2 N at 8 A" in captions(found)["pull"]
    assert abs((hold(logs[:1]).one("force_increment", **at).value or 0) - 0.627) > 0.1
    assert float(pole_pull(0.8, np.pi * 0.025**2)) == pytest.approx(500, abs=1)


def test_remanence_is_told_for_each_sweep(findings: Findings) -> None:
    assert findings.one("remanence", sweep="up").value == pytest.approx(0.006, abs=1e-3)
    assert findings.one("remanence", sweep="down").value == pytest.approx(0.012, abs=1e-3)


def test_two_sweeps_are_told_by_run() -> None:
    first, second = synthesize({}, 1)[0], synthesize({"force_gain": 0.4}, 2)[0]
    from dataclasses import replace

    found = hold([replace(first, run="a"), replace(second, run="b")])
    assert found.one("force_gain", run="a").value == pytest.approx(0.65, abs=5e-3)
    assert found.one("force_gain", run="b").value == pytest.approx(0.40, abs=5e-3)


def test_the_papers_contradiction_stands_beside_what_was_found(findings: Findings) -> None:
    rows = {row.name: row for row in findings.published}
    assert rows["force increment at 6 A, gap held"].agrees is True
    clash = rows["axial stiffening at 2 A beside the force increment at 2 A"]
    assert clash.agrees is False
    assert clash.published == 0.65
    assert clash.found == pytest.approx(0.228, abs=0.005)
    assert "ratio 2.8" in clash.remark or "ratio 2.9" in clash.remark
    pull = rows["pull of the poles at 6 A on the area of a pad"]
    assert pull.found == pytest.approx(505, rel=0.02)


def test_flux_levels_are_handed_to_the_micromechanical_chapter(findings: Findings) -> None:
    table = findings.arrays["flux_levels"]
    six = table[table["current"] == 6.0]["flux_density"].iloc[0]
    assert six == pytest.approx(0.807, abs=0.005)  # both sweeps together
