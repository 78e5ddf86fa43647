"""Campaigns that cannot determine something say null, why, and what to measure; what they do tell is right (gearbox.md, 5.6)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pytest

from benchmarks.coverage.studies.gearbox_load_exchange import Truth
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Findings
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.identify import identify
from pipeline.rigs.gearbox.synthetic import known_runs, synthesize
from pipeline.rigs.gearbox.truth import gearbox_truth

SHORT = {"brake_on": 8.0, "brake_off": 13.0, "rundown_start": 17.0, "duration": 20.0, "vibration": False}
STRIBECK = ("c0", "c_s", "w_s", "b0")


def campaign(design: Mapping[str, Any], seed: int) -> tuple[Findings, Truth]:
    options = {**SHORT, **design}
    known = gearbox_truth(options)
    truth = Truth(known, {run.name: run for run, _ in known_runs(known, seed)})
    return identify(synthesize(options, seed), LoadExchangeSettings(), Context("test", {})), truth


def one_of_all_runs(findings: Findings, name: str) -> Any:
    (found,) = (p for p in findings.find(name) if "run" not in p.at and "phase" not in p.at)
    return found


def off(findings: Findings, truth: Truth, *names: str) -> list[str]:
    """Return the numbers that lie farther off than one in a thousand does, by the degrees of freedom of its own interval."""
    found = []
    for p in findings.parameters:
        if p.name not in names or p.value is None or p.ci95 is None or (true := truth.of(p)) is None:
            continue
        error = p.std_error or 0.0
        ratio = 0.5 * (p.ci95[1] - p.ci95[0]) / error
        dof = next((dof for dof in range(1, 200) if t_quantile(dof) <= ratio), math.inf)
        if abs(p.value - true) > t_quantile(dof, 0.999) * error:
            found.append(f"{p.name} {p.at}: {p.value} +- {p.std_error}, truth {true}")
    return found


LOAD = ("inertia_load", "drag_coulomb", "drag_viscous", "drag_locked", "slip_torque", "lock_torque")


@pytest.mark.parametrize(
    "seed", [1, pytest.param(2, marks=pytest.mark.thorough), pytest.param(3, marks=pytest.mark.thorough)]
)
def test_one_speed_tells_neither_the_drags_law_nor_the_slip_torques(seed: int) -> None:
    findings, truth = campaign({"runs": ("g3", "g4")}, seed)
    for name in (*STRIBECK, "slip_torque_slope", "slip_torque_intercept"):
        p = one_of_all_runs(findings, name)
        assert p.value is None
        assert "speed" in p.description
    assert any("speed" in one for one in findings.advice), findings.advice
    assert not off(findings, truth, *LOAD)


@pytest.mark.parametrize(
    "seed", [1, pytest.param(2, marks=pytest.mark.thorough), pytest.param(3, marks=pytest.mark.thorough)]
)
def test_two_speeds_give_the_drag_at_each_and_no_law(seed: int) -> None:
    findings, truth = campaign({"runs": ("g3", "g7")}, seed)
    assert all(one_of_all_runs(findings, name).value is None for name in STRIBECK)
    assert [p.value is not None for p in findings.find("drag_locked")] == [True, True]
    assert any("at 5 speeds or more (now 2 speeds)" in one for one in findings.advice), findings.advice
    assert not off(findings, truth, *LOAD)


def test_a_run_that_is_never_braked_tells_no_lock_slip_or_slope() -> None:
    findings, truth = campaign({"runs": ("g3",), "brake_capacity": 0.0}, 1)
    for name in ("lock_torque", "slip_torque", "torque_ratio_sos"):
        p = findings.one(name, run="g3")
        assert p.value is None
        assert "brake" in p.description or "SOS" in p.description
    assert one_of_all_runs(findings, "torque_transfer_slope").value is None
    assert any("brak" in one for one in findings.advice), findings.advice
    assert not off(findings, truth, "inertia_load", "torque_in_nominal", "torque_out_nominal", "speed_out_nominal")
