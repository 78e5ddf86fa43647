"""Bench campaigns that cannot determine something say null, why, and what to measure; what they do tell is right (tire.md, 5.9)."""

from __future__ import annotations

from functools import cache

import pytest
from bench_campaigns import identified

from benchmarks.coverage.studies.tire_bench import true_of_all
from pipeline.findings import Findings
from pipeline.rigs.tire.synthetic.rig import synthesize_bench

SCALE = (
    "bending_stiffness",
    "belt_width",
    "foundation_radial",
    "foundation_tangential",
    "tread_stiffness",
    "sensor_gain",
)
LOPSIDED = ("loss_factor", "sensor_lag")
SEEDS = [4, pytest.param(5, marks=pytest.mark.thorough), pytest.param(6, marks=pytest.mark.thorough)]


@cache
def of(runs: tuple[str, ...], seed: int) -> Findings:
    return identified(synthesize_bench({"duration": 10.0, "runs": list(runs)}, seed))


def nothing_is_off(findings: Findings) -> None:
    """Every number of the tire that is told holds the truth within three standard errors."""
    for p in findings.parameters:
        true = true_of_all(p)
        if p.value is not None and p.std_error is not None and true is not None:
            assert abs(p.value - true) < 3.0 * p.std_error, (p.name, p.at, p.value, p.std_error, true)


@pytest.mark.parametrize("seed", SEEDS)
def test_one_load_tells_no_scale_of_stiffness_and_no_calibration(seed: int) -> None:
    found = of(("load_2000", "speed_05", "speed_20"), seed)
    for name in SCALE:
        p = found.one(name)
        assert p.value is None
        assert "three loads" in p.description
    assert found.one("calibration_1").value is None
    for name in LOPSIDED:
        assert found.one(name).value is not None
    assert any("five loads or more" in one for one in found.advice)
    assert any("hub's height" in one for one in found.advice)
    nothing_is_off(found)


@pytest.mark.parametrize("seed", SEEDS)
def test_one_speed_tells_loss_and_lag_not_apart(seed: int) -> None:
    found = of(("load_1000", "load_2000", "load_3000"), seed)
    for name in LOPSIDED:
        p = found.one(name)
        assert p.value is None
        assert "two speeds" in p.description
    assert found.one("bending_stiffness").value is not None
    assert any("two speeds or more" in one for one in found.advice)
    nothing_is_off(found)


@pytest.mark.thorough
def test_two_loads_at_one_speed_give_no_calibration() -> None:
    found = of(("load_1000", "load_3000", "speed_20"), 4)
    assert found.one("calibration_2").value is None
    nothing_is_off(found)
