"""What `mre.shear` proposes to measure next: the gain that is promised is the gain that comes."""

from __future__ import annotations

import numpy as np
import pytest
from faulty_logs import TRUTH
from loops_of_truth import measured

from pipeline.findings import Findings
from pipeline.recording import Recording
from pipeline.rigs.advice import Advice, Proposal
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, identify_loops
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.synthetic import ShearRun, shear_runs, shear_truth, sine_run

_SMALLEST = {"campaign": "smallest", "preload_runs": False}
_FEW = FitOptions(variants=("ks",), starts=1)


def identify(logs: list[Recording]) -> Findings:
    return SHEAR.identify(logs, ShearSettings(starts=2), Context("test", {}))


def advice_of(findings: Findings) -> Advice:
    assert SHEAR.advise is not None
    found = SHEAR.advise(findings)
    assert isinstance(found, Advice)
    return found


def as_run(proposal: Proposal) -> ShearRun:
    f, X, i = (float(proposal.conditions[name]) for name in ("frequency", "amplitude", "coil_current"))
    return ShearRun("proposed", "shear", f, X, i)


@pytest.fixture(scope="module")
def campaign() -> list[Recording]:
    return SHEAR.synthesize(_SMALLEST, 2)


@pytest.fixture(scope="module")
def first(campaign: list[Recording]) -> Proposal:
    return advice_of(identify(campaign)).proposals[0]


def test_a_proposed_run_that_is_made_shrinks_the_intervals_as_promised(
    campaign: list[Recording], first: Proposal
) -> None:
    made = sine_run(shear_truth(_SMALLEST), as_run(first), np.random.default_rng(5))
    after = identify([*campaign, made])
    assert len(first.shrinks) > 5
    assert [s.factor or 0.0 for s in first.shrinks] == sorted((s.factor or 0.0 for s in first.shrinks), reverse=True)
    for s in first.shrinks:
        assert after.one(s.name, **s.at).std_error == pytest.approx(s.then, rel=0.2), s


@pytest.mark.thorough
def test_the_spread_of_many_campaigns_shrinks_as_promised(first: Proposal) -> None:
    runs = shear_runs(shear_truth(_SMALLEST))
    values: dict[str, list[float]] = {}
    for seed in range(120):
        fit = identify_loops(measured([*runs, as_run(first)], _SMALLEST, seed), _FEW).selected
        for e in fit.estimates:
            if e.value is not None:
                values.setdefault(f"{e.name} {float(e.at.get('coil_current', 0)):.0f}", []).append(e.value)
    for s in first.shrinks:
        told = values[f"{s.name} {float(s.at.get('coil_current', 0)):.0f}"]
        # 120 campaigns tell a spread to 6.5 %.
        assert np.std(told) == pytest.approx(s.then, rel=0.2), s


def test_what_one_frequency_leaves_open_is_what_the_next_run_tells() -> None:
    truth = {"duration": 1.5, "preload_runs": False, "frequencies": [10.0], "currents": [0.0, 6.0]}
    logs = SHEAR.synthesize(truth, 2)
    before = identify(logs)
    assert before.one("k1").value is None
    advice = advice_of(before)
    best = advice.proposals[0]
    frequency = float(best.conditions["frequency"])
    assert not 7 < frequency < 13, "another frequency is what is missing"
    promised = {s.name for s in best.shrinks if s.now is None}
    assert {"k1", "tau"} <= promised
    assert any("not determined yet" in remark for remark in advice.remarks)
    after = identify([*logs, sine_run(shear_truth(truth), as_run(best), np.random.default_rng(5))])
    for name in promised:
        told = after.one(name)
        true = {"tau": TRUTH.s1 / TRUTH.k1}.get(name) or float(getattr(TRUTH, name))
        assert told.value is not None, name
        assert told.std_error is not None
        assert abs(told.value - true) < 3.5 * told.std_error


def test_rejected_findings_and_loops_without_a_model_get_no_advice(campaign: list[Recording]) -> None:
    findings = identify(campaign)
    assert not advice_of(findings.model_copy(update={"verdict": "rejected"})).proposals
    bare = findings.model_copy(update={"arrays": {}})
    assert "no fit of loops" in advice_of(bare).remarks[0]
