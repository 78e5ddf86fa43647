"""tpjb.rotating from log to findings: acceptance of the sheet on the synthetic campaigns, names, report."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotating_logs import coefficients, found, logs
from unstated_gains import unstated

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.rigs.tpjb.rotating.declaration import ROTATING
from pipeline.rigs.tpjb.rotating.methods import methods
from pipeline.rigs.tpjb.rotating.paper import curvature, paper_alone, peripheral_speed, polar_residual
from pipeline.rigs.tpjb.rotating.sections import sections
from pipeline.rigs.tpjb.rotating.synthetic import synthesize

# Static load, synthetic bearing, model, largest error of the direct stiffness, rho* of the truth.
FOUR = [(40e3, "4pad-L1", "M5", 1e-3, 0.1429), (80e3, "4pad-L2", "M5", 1e-3, 0.1429)]
FIVE = [(48e3, "5pad-L3", "M6", 1e-3, 0.1341), (80e3, "5pad-L2", "M2", 5e-3, None)]


@pytest.fixture(scope="module", params=[1, pytest.param(4, marks=pytest.mark.thorough)])
def four(request: pytest.FixtureRequest) -> Findings:
    return found(unstated(synthesize({"campaign": "4pad"}, request.param)))


@pytest.fixture(scope="module", params=[1, pytest.param(5, marks=pytest.mark.thorough)])
def five(request: pytest.FixtureRequest) -> Findings:
    return found(unstated(synthesize({"campaign": "5pad"}, request.param)))


def accepted(
    findings: Findings, bearing: str, load: float, name: str, model: str, error: float, limit: float | None
) -> None:
    true = coefficients(name)
    table = findings.arrays["models"]
    chosen = table[table["selected"] & (table["group"] == f"{bearing}, {load / 1e3:g} kN")]
    assert list(chosen["model"]) == [model]
    for direct in ("kxx", "kyy"):
        assert findings.one(direct, static_load=load).value == pytest.approx(true[direct], rel=error)
    for parameter in findings.find("kxx", static_load=load) + [
        findings.one(n, static_load=load) for n in list(true)[1:]
    ]:
        if parameter.value is not None:
            assert abs(parameter.value - true[parameter.name]) < 3.3 * parameter.std_error
    rho = findings.one("linear_limit", static_load=load)
    if limit is None:
        assert rho.value is None
        assert "linear" in rho.description
    else:
        assert rho.value == pytest.approx(limit, abs=0.003)


@pytest.mark.parametrize("case", FOUR, ids=lambda case: case[1])
def test_four_pad_campaign_meets_the_acceptance_of_the_sheet(four, case):
    accepted(four, "4pad", *case)
    assert four.verdict == "ok"


@pytest.mark.parametrize("case", FIVE, ids=lambda case: case[1])
@pytest.mark.thorough
def test_five_pad_campaign_needs_mixed_terms_and_is_linear_at_three_percent(five, case):
    accepted(five, "5pad", *case)
    assert five.verdict == "ok"


def test_names_and_operating_points_are_those_of_the_sheet(four):
    declared = {spec.name for spec in ROTATING.parameters}
    assert {p.name for p in four.parameters} == declared
    assert sum(model.selected for model in four.models) == 1
    names = {model.name for model in four.models}
    assert {"M1", "M2", "M3", "M4", "M5", "M6", "M3p", "M1L", "M4L", "M2T"} <= names
    assert all(p.at.keys() == {"static_load", "shaft_speed"} for p in four.find("kxx"))
    assert four.one("orbit_harmonic_y", run="A4_L1_36", order=2.0).value == pytest.approx(4.58e-6, rel=0.03)
    assert four.one("thd", run="A4_L1_36").value == pytest.approx(0.1370, abs=0.002)


def test_harmonics_that_the_sheet_lists_are_found(four):
    for name, published in (("x", (24.2, 1.03, 0.15)), ("y", (25.1, 4.58, 0.93))):
        for order, amplitude in enumerate(published, start=1):
            p = four.one(f"orbit_harmonic_{name}", run="A4_L1_36", order=float(order))
            # The sheet's is another campaign's: its load had another size and ellipse, 0.4 % each.
            assert p.value == pytest.approx(amplitude * 1e-6, abs=4 * p.std_error + 0.008 * amplitude * 1e-6 + 0.05e-6)
            assert p.ci95[0] >= 0


def holds(findings: Findings, label: str, name: str) -> bool:
    table = findings.arrays["consistency"]
    row = table[(table["group"].str.startswith(label)) & table["name"].str.startswith(name)]
    return bool(row["holds"].iloc[0])


def test_four_pad_orbits_lack_the_mixed_term_that_their_load_dependence_asks_for(four):
    assert holds(four, "4pad, 40 kN", "kyy2")
    assert not holds(four, "4pad, 40 kN", "kxxy = kyy")
    assert holds(four, "4pad, 40 kN to", "y(W2)")


def test_five_pad_orbits_have_the_mixed_term_and_a_potential_of_second_order(five):
    assert holds(five, "5pad, 48 kN", "kyy2")
    assert holds(five, "5pad, 48 kN", "kxxy = kyy")
    assert holds(five, "5pad, 48 kN", "kxxy = 2 kyx2")
    assert not holds(five, "5pad, 48 kN", "kxy = kyx")


def test_report_has_every_chapter_and_draws_every_run(four):
    chapters = {section.name: section for section in sections(four)}
    assert list(chapters) == ["orbits", "harmonics", "laws", "linear", "consistency"]
    drawn = {block.name for section in chapters.values() for block in section.blocks if hasattr(block, "name")}
    for run in four.arrays["runs"]["run"]:
        assert {f"orbit_{run}", f"spectrum_{run}", f"filtered_{run}"} <= drawn
    assert {"load", "orbits_absolute", "residual_orbits", "full_spectrum", "thd"} <= drawn
    assert len(methods(four)) >= 6
    told = captions(four)
    for answer in (
        "Yes: the backward turning part",
        "M5, selected, leaves",
        "Those of M5, selected, count.",
        "Up to rho* = 0.143 ±",
    ):
        assert answer in told


def captions(findings: Findings) -> str:
    return " ".join(getattr(block, "caption", "") for section in sections(findings) for block in section.blocks)


def test_exponential_pads_are_flagged_and_no_coefficient_is_given():
    findings = found(unstated(synthesize({"campaign": "pads"}, 8)))
    assert findings.verdict == "warning"
    assert any("quadratic law is not enough" in reason for reason in findings.reasons)
    for parameter in [*findings.find("kxx"), *findings.find("kyy2"), *findings.find("linear_limit")]:
        assert parameter.value is None
        assert "no quadratic law holds" in parameter.description.lower()
    told = captions(findings)
    assert "which is more than noise" in told
    assert "does not hold either" in told
    assert "No limit could be told" in told
    assert "count." not in told


@pytest.mark.thorough
def test_lower_ratios_give_the_coefficients_where_no_law_holds_for_all():
    low = {"name": "low", "bearing": "4pad-L1", "ratio": 0.05, "law": "pads"}
    findings = found(unstated(synthesize({"runs": ["A8", low]}, 1)))
    kxx = findings.one("kxx")
    assert findings.verdict == "warning"
    assert abs(kxx.value - 0.6e9) < 3.3 * kxx.std_error
    assert "Without A8_L1_36" in kxx.description


def test_without_a_dwell_only_the_difference_is_told():
    findings = found(logs("A4", no_dwell=True))
    kxx2 = findings.one("kxx2")
    assert findings.verdict == "warning"
    assert kxx2.value is None
    assert "kxx2 - kxy2 = 1.5" in kxx2.description
    assert findings.one("kxx").value == pytest.approx(0.6e9, rel=1e-3)
    assert any("zero dynamic force" in advice for advice in findings.advice)


def test_two_ratios_tell_the_mean_shift_without_a_dwell():
    findings = found(logs("A4", "A5", no_dwell=True))
    true = coefficients("4pad-L1")
    for name in ("kxx2", "kxy2", "kyx2", "kyy2"):
        p = findings.one(name)
        assert abs(p.value - true[name]) < 3.3 * p.std_error


def test_published_rows_carry_the_contradictions_of_the_paper(four):
    rows = {row.name: row for row in four.published}
    speed = rows["peripheral speed at the largest speed and the smallest journal"]
    assert speed.found == pytest.approx(188.5, abs=0.05)
    assert speed.agrees is False
    assert speed.basis == "paper"
    for allowed in ("19099", "10231", "9549", "4000"):
        assert allowed in speed.remark
    assert rows["turns recorded"].agrees is False
    assert rows["equations put into polar form"].found == "(3), (4)"
    assert "25.26, 22.86" in rows["orbit of model M2"].found
    assert rows["shaft frequency"].found == pytest.approx(1000 / 60)
    measured = rows["rotation of the load in these logs"]
    assert measured.basis == "logs"
    assert measured.found == pytest.approx(0.010013, rel=2e-3)


def test_checks_of_the_paper_come_from_its_equations():
    assert peripheral_speed(24000, 0.150) == pytest.approx(math.pi * 0.150 * 400)
    assert polar_residual() < 1e-12
    assert all(row.basis == "paper" for row in paper_alone())
    angle = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    assert curvature(np.stack([np.cos(angle), np.sin(angle)])) == pytest.approx((1.0, 1.0))
    # Ellipse with half axes 2 and 1: curvature a/b^2 and b/a^2, times the mean radius.
    shapes = next(row for row in paper_alone() if "stiffness by load" in row.name)
    assert "0.76 to 1.28 becomes 0.41 to 2.85" in str(shapes.found)
    low, high = curvature(np.stack([2 * np.cos(angle), np.sin(angle)]))
    assert high / low == pytest.approx(8.0, rel=1e-9)


def test_synthetic_rig_answers_misspelt_truth():
    with pytest.raises(InputError, match=r"no_dwel.*Did you mean 'no_dwell'"):
        synthesize({"no_dwel": True}, 1)
    with pytest.raises(InputError, match="past its fold"):
        synthesize({"runs": [{"name": "x", "bearing": "4pad-L1", "ratio": 0.6}]}, 1)


def test_synthetic_rig_gives_the_same_logs_for_the_same_seed():
    a, b, c = (synthesize({"runs": ["A7"]}, seed)[0].values("gap_up1") for seed in (3, 3, 4))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)
