"""Designs that cannot determine something: it is null with the reason, the advice says what to measure, the rest holds the truth."""

from __future__ import annotations

import numpy as np
import pytest
from dynamic_logs import conditions, found_in, true_value
from dynamic_logs import logs as dynamic_logs
from rotating_logs import coefficients, found, logs
from unstated_gains import unstated

from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb.baseline.declaration import BASELINE, BaselineSettings
from pipeline.rigs.tpjb.bump.declaration import BUMP, BumpSettings

QUADRATIC = {"kxx2", "kxy2", "kyx2", "kyy2"}
SEEDS = (1, 2, 3)


def null(findings: Findings) -> set[str]:
    """Return the names that are told nowhere; each must say why."""
    untold = [p for p in findings.parameters if p.value is None]
    assert all(len(p.description) > 20 for p in untold)
    return {p.name for p in untold} - {p.name for p in findings.parameters if p.value is not None}


def within(findings: Findings, true: dict[str, float]) -> None:
    """Every coefficient that is told lies within 3.3 standard errors of its truth."""
    for p in findings.parameters:
        if p.value is not None and p.name in true:
            assert abs(p.value - true[p.name]) < 3.3 * p.std_error, p


@pytest.mark.parametrize("seed", SEEDS)
def test_one_load_ratio_without_a_dwell_tells_no_quadratic_term(seed: int) -> None:
    findings = found(logs("A5", seed=seed, no_dwell=True))
    assert null(findings) >= QUADRATIC
    assert "without a stretch at zero force" in findings.one("kxx2").description
    assert "kxx2 - kxy2" in findings.one("kxx2").description
    assert any("Hold 60 s at zero dynamic force" in advice for advice in findings.advice)
    within(findings, coefficients("4pad-L1"))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_load_of_three_per_cent_tells_neither_quadratic_terms_nor_the_linear_limit(seed: int) -> None:
    findings = found(logs("A7", seed=seed))
    assert null(findings) == {*QUADRATIC, "kxxy", "kyxy", "linear_limit"}
    assert any("higher load ratio" in advice for advice in findings.advice)
    within(findings, coefficients("4pad-L2"))


@pytest.mark.parametrize("seed", SEEDS)
def test_tones_above_the_shaft_alone_tell_nothing_at_shaft_speed(seed: int) -> None:
    findings = found_in(dynamic_logs(seed, tones=(19.0, 23.0, 29.0, 37.0, 43.0)))
    told = [p for p in findings.parameters if p.value is not None]
    assert told
    assert all("frequency" in p.at for p in told)
    assert "it would be extrapolated" in findings.one("kxx", synchronous=True).description
    assert any("below the shaft" in advice for advice in findings.advice)
    z = [(p.value - true_value(p.name, float(p.at["frequency"]))) / p.std_error for p in told]
    assert np.abs(z).max() < 4.0  # 40 of them, by Student's t


def test_one_tone_tells_k_and_c_there_and_no_law() -> None:
    findings = found_in(dynamic_logs(1, tones=(13.0,)))
    told = [p for p in findings.parameters if p.value is not None]
    assert {(p.name, p.at["frequency"]) for p in told} == {(p.name, 13.0) for p in told}
    assert len(told) == 8
    assert "it would be extrapolated" in findings.one("cyy", synchronous=True).description


def test_one_excitation_tells_no_coefficient() -> None:
    findings = found_in(dynamic_logs(1)[:1])
    assert findings.verdict == "rejected"
    assert null(findings) == {"kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy"}
    assert any("both actuators in phase, and in antiphase" in advice for advice in findings.advice)


def baseline(recordings: list[Recording]) -> Findings:
    return BASELINE.identify(unstated(recordings), BaselineSettings(), Context("t0", {}))


def test_one_tone_tells_mass_and_stiffness_as_one_number_only() -> None:
    findings = baseline(BASELINE.synthesize({"tones": (29.0,)}, 1))
    assert null(findings) == {"stator_mass", "stabilizer_stiffness"}
    assert "does not tell a mass from a stiffness" in findings.one("stator_mass").description
    assert any("at least two tones" in text for text in findings.advice)


@pytest.mark.parametrize("seed", SEEDS)
def test_one_tone_with_a_stated_stiffness_tells_the_mass_alone(seed: int) -> None:
    stated = [conditions(r, stabilizer_stiffness=5e6) for r in BASELINE.synthesize({"tones": (29.0,)}, seed)]
    findings = baseline(stated)
    assert null(findings) == {"stabilizer_stiffness"}
    within(findings, {"stator_mass": 900.0})


def bump(truth: dict[str, object], seed: int = 3) -> Findings:
    return BUMP.identify(unstated(BUMP.synthesize(truth, seed)), BumpSettings(), Context("bump", {}))


def test_a_third_of_a_turn_leaves_the_centre_open() -> None:
    findings = bump({"arc": 0.3})
    assert {"center_x", "center_y"} & null(findings)
    assert findings.verdict != "ok"
    assert findings.advice


def test_probes_in_one_plane_leave_the_tilt_open() -> None:
    findings = bump({"planes": "1"})
    assert null(findings) == {"tilt_x", "tilt_y"}
    assert "one plane only" in findings.one("tilt_x").description
    within(findings, {"contact_stiffness": 1.5e9, "support_stiffness": 2e6, "rotation": float(np.radians(0.8))})
