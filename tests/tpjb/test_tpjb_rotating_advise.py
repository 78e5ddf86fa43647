"""What to run next: predicted standard errors are those of the campaign with the proposed run."""

from __future__ import annotations

import numpy as np
import pytest
from rotating_logs import found, logs

from pipeline.rigs.tpjb.rotating.advise import load_of
from pipeline.rigs.tpjb.rotating.declaration import ROTATING, RotatingSettings
from pipeline.rigs.tpjb.rotating.linear_limit import linear_limit
from pipeline.rigs.tpjb.rotating.model_fit import ModelFit, fit_model
from pipeline.rigs.tpjb.rotating.models import M5
from pipeline.rigs.tpjb.rotating.record import record_of

QUADRATIC = {"kxx2", "kxy2", "kyx2", "kyy2"}
CASES = {
    "one ratio": ("A6", {}, "4pad-L2"),
    "no dwell": ("A5", {"no_dwell": True}, "4pad-L1"),
    "linear": ("A7", {}, "4pad-L2"),
}
NULL = {"one ratio": set(), "no dwell": QUADRATIC, "linear": QUADRATIC}


def joined(base: str, kw: dict, bearing: str, ratio: float, seed: int) -> ModelFit:
    runs = logs(base, seed=seed, **kw) + logs({"name": "next", "bearing": bearing, "ratio": ratio}, seed=seed + 1000)
    return fit_model([record_of(run, RotatingSettings()).orbit for run in runs], M5)


@pytest.mark.parametrize("case", CASES)
def test_the_proposed_run_shrinks_the_standard_errors_as_predicted(case):
    base, kw, bearing = CASES[case]
    best = ROTATING.advise(found(logs(base, **kw))).proposals[0]
    fits = [joined(base, kw, bearing, best.conditions["load_ratio"], seed) for seed in (100, 101, 102)]
    assert {s.name for s in best.shrinks} >= {"kxx", "kyy", *QUADRATIC}
    for one in best.shrinks:
        if one.name != "linear_limit":
            assert np.mean([fit.estimates[one.name].std_error for fit in fits]) == pytest.approx(one.then, rel=0.2)
        assert (one.now is None) == (one.name in NULL[case])
        assert one.factor is None or one.factor > 1


@pytest.mark.thorough
@pytest.mark.parametrize("case", CASES)
def test_the_estimates_scatter_as_predicted_once_the_proposed_run_is_there(case):
    base, kw, bearing = CASES[case]
    best = ROTATING.advise(found(logs(base, **kw))).proposals[0]
    fits = [joined(base, kw, bearing, best.conditions["load_ratio"], seed) for seed in range(100, 160)]
    load = best.conditions["static_load"]
    for one in best.shrinks:
        values = [
            linear_limit(f, load).ratio if one.name == "linear_limit" else f.estimates[one.name].value for f in fits
        ]
        # Sixty campaigns tell a spread to 9 %.
        assert np.std(values, ddof=1) == pytest.approx(one.then, rel=0.27)


def test_a_linear_orbit_is_told_what_load_would_show_the_quadratic_terms():
    advice = ROTATING.advise(found(logs("A7")))
    best = advice.proposals[0]
    assert best.conditions["load_ratio"] > 0.1
    assert {s.name for s in best.shrinks if s.now is None} == QUADRATIC
    assert "tells kxx2" in best.why
    assert any("a second one" in remark for remark in advice.remarks)


def test_no_run_is_proposed_that_the_actuators_cannot_push_or_the_law_cannot_bear():
    findings = found(logs("A4"))
    design = findings.arrays["design"].iloc[0]
    for proposal in ROTATING.advise(findings).proposals:
        force = np.hypot(*load_of(design, proposal.conditions["load_ratio"])[1])
        assert force.max() <= 40e3
        assert proposal.conditions["load_ratio"] <= 0.45  # det J falls to 0.3 of det K near there
    broken = findings.model_copy(update={"arrays": {}})
    assert ROTATING.advise(broken).proposals == ()
