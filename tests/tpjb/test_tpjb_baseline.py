"""`tpjb.baseline`: mass and stiffness of the stator come back with honest errors; faults are named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dynamic_logs import changed, conditions, messages, without
from unstated_gains import unstated

from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb.baseline.declaration import BASELINE, BaselineSettings
from pipeline.rigs.tpjb.baseline.identify import identify
from pipeline.rigs.tpjb.baseline.synthetic import synthesize


def found_in(recordings: list[Recording]) -> Findings:
    return identify(recordings, BaselineSettings(), Context("t0", {}))


def logs(seed: int, **truth: Any) -> list[Recording]:
    return unstated(synthesize(truth, seed))


@pytest.mark.parametrize("campaigns", [10, pytest.param(30, marks=pytest.mark.thorough)])
def test_mass_and_stiffness_come_back_as_well_as_the_sheet_says_and_intervals_hold(campaigns: int) -> None:
    errors = []
    for seed in range(campaigns):
        findings = found_in(logs(seed))
        assert findings.verdict == "ok"
        mass, stiffness = findings.one("stator_mass"), findings.one("stabilizer_stiffness")
        assert (mass.std_error or 9) < 0.11
        assert (stiffness.std_error or 9e9) < 3e3
        errors.append(((mass.value or 0) - 900, (stiffness.value or 0) - 5e6))
        errors[-1] = (errors[-1][0] / (mass.std_error or 1), errors[-1][1] / (stiffness.std_error or 1))
    z = np.array(errors)
    assert np.mean(np.abs(z) < 1.99) > 0.88
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3


def test_without_noise_it_is_exact() -> None:
    findings = found_in(logs(1, force_noise=0.0, acceleration_noise=0.0, bench={"stator_mass": 1234.0}))
    assert findings.one("stator_mass").value == pytest.approx(1234.0, rel=1e-9)
    assert findings.one("stabilizer_stiffness").value == pytest.approx(5e6, rel=1e-6)


def test_one_log_and_one_axis_will_do() -> None:
    one = without(logs(3)[0], "acc_va", "acc_vb")
    findings = found_in([one])
    assert findings.verdict == "warning"
    assert "no accelerometer along v" in messages(findings)
    mass = findings.one("stator_mass")
    assert abs((mass.value or 0) - 900) < 4 * (mass.std_error or 0)


@pytest.mark.parametrize(
    ("channels", "factor", "words", "verdict"),
    [
        (("acc_ua", "acc_ub", "acc_va", "acc_vb"), 1 / 9.80665, "in g", "warning"),
        (("force_u",), 1.1, "one stator has one mass", "warning"),
        (("acc_ua",), 0.0, "acc_ua does not move", "warning"),
        (("acc_va",), 1.2, "acc_va, acc_vb differ", "warning"),
        (("force_u", "force_v"), -1.0, "sign of the force", "rejected"),
    ],
)
def test_gains_units_and_signs_are_doubted(channels: tuple[str, ...], factor: float, words: str, verdict: str) -> None:
    runs = logs(2, weighed=True)
    for name in channels:
        runs = [changed(r, name, lambda _, v: factor * v) for r in runs]
    findings = found_in(runs)
    assert findings.verdict == verdict
    assert words in messages(findings)
    if verdict == "rejected":
        assert all(p.value is None for p in findings.parameters)


def test_contact_in_the_bearing_is_seen() -> None:
    def touched(time: np.ndarray, force: np.ndarray) -> np.ndarray:
        turning = np.exp(2j * np.pi * 41 * time)
        return force + 0.03 * (2 * np.mean(force * turning.conj()) * turning).real

    runs = [changed(changed(r, "force_u", touched), "force_v", touched) for r in logs(4)]
    findings = found_in(runs)
    assert findings.verdict == "warning"
    assert "does not follow m - k/w^2" in messages(findings)


def test_a_log_without_excitation_is_refused() -> None:
    still = [changed(changed(r, "force_u", lambda _, v: 0 * v), "force_v", lambda _, v: 0 * v) for r in logs(1)]
    with pytest.raises(InputError, match="was the drive on"):
        found_in(still)


def test_findings_are_declared_and_drawn() -> None:
    findings = found_in(logs(1))
    assert {p.name for p in findings.parameters} == {spec.name for spec in BASELINE.parameters}
    (chapter,) = BASELINE.sections(findings)
    assert [block.name for block in chapter.blocks] == ["ratio", "ratios"]
    assert "of 24 ratios lie on the fit" in chapter.blocks[0].caption
    assert "None stands out of its error" in chapter.blocks[1].caption
    assert len(BASELINE.methods(findings)) == 2


@pytest.mark.parametrize("stated", [None, 5e6])
def test_one_tone_does_not_tell_a_mass_from_a_stiffness(stated: float | None) -> None:
    runs = [conditions(r, stabilizer_stiffness=stated) for r in logs(1, tones=(30.0,))]
    findings = found_in(runs)
    mass, stiffness = findings.one("stator_mass"), findings.one("stabilizer_stiffness")
    assert findings.verdict == "warning"
    assert "one tone" in findings.reasons[0]
    assert "k_s = 0" not in messages(findings)
    assert stiffness.value is None
    assert "one tone" in stiffness.description
    if stated is None:
        assert mass.value is None
        assert "one tone" in mass.description
    else:
        assert abs((mass.value or 0) - 900) < 4 * (mass.std_error or 0)


def test_findings_that_do_not_serve_are_named() -> None:
    other = Findings(campaign="b", experiment="tpjb.bump", verdict="ok")
    findings = identify(logs(1), BaselineSettings(), Context("t0", {"b": other}))
    assert findings.verdict == "ok"
    assert "'b' (tpjb.bump) was handed over and is not used" in messages(findings)
