"""Curved valleys of few or alike loops: no number is told that quite another one would replace."""

from __future__ import annotations

import pytest

from pipeline.findings import Findings
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.model.harmonic_fit import identify_loops
from pipeline.rigs.mre.model.other_optima import without_other_optima
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.shear.runs import sort_runs
from pipeline.rigs.mre.synthetic import ShearTruth

TRUTH = ShearTruth()
DESIGN = {"duration": 2.0, "preload_runs": False, "currents": [0.0]}


def found(design: dict[str, object], seed: int) -> Findings:
    return SHEAR.identify(SHEAR.synthesize({**DESIGN, **design}, seed), ShearSettings(), Context("test", {}))


def assert_numbers_hold(findings: Findings) -> None:
    truth = {name: getattr(TRUTH, name) for name in ("k1", "s1", "k2", "alpha_bw", "rho", "c_bw", "n_bw")}
    truth |= {"tau": TRUTH.s1 / TRUTH.k1, "k1_plus_k2": TRUTH.k1 + TRUTH.k2}
    truth["k2_plus_alpha_rho"] = TRUTH.k2 + TRUTH.alpha_bw * TRUTH.rho
    for name, true in truth.items():
        for parameter in findings.find(name):
            if parameter.value is not None:
                assert parameter.std_error is not None
                assert abs(parameter.value - true) < 4.5 * parameter.std_error, name


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.thorough
def test_small_loops_never_tell_alpha_or_rho_by_themselves(seed: int) -> None:
    findings = found({"amplitudes": [1e-4]}, seed)
    assert findings.one("alpha_bw").value is None
    assert findings.one("rho").value is None
    assert_numbers_hold(findings)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_one_loop_tells_no_number_that_is_far_off(seed: int) -> None:
    findings = found({"frequencies": [10.0]}, seed)
    assert findings.one("k1").value is None
    assert_numbers_hold(findings)


@pytest.mark.thorough
def test_the_reason_tells_over_which_range_others_fit_as_well() -> None:
    reasons = [
        parameter.description
        for seed in range(6)
        for parameter in found({"frequencies": [10.0]}, seed).parameters
        if "fit these runs as well" in parameter.description
    ]
    assert reasons
    assert any("from" in reason and "to" in reason for reason in reasons)


def test_a_sound_design_is_left_as_it_is() -> None:
    runs = sort_runs(SHEAR.synthesize({**DESIGN, "currents": [0.0, 6.0]}, 1), ShearSettings())
    fit = identify_loops([usable.loop for usable in runs.loops if usable.loop is not None]).selected
    assert without_other_optima(fit) is fit
