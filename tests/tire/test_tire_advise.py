"""What the bench is advised to measure next shrinks its intervals as predicted."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from bench_campaigns import findings, identified

from pipeline.findings import Findings
from pipeline.rigs.tire.bench.advise import advise
from pipeline.rigs.tire.bench.ring_model import NAMES
from pipeline.rigs.tire.synthetic.rig import synthesize_bench

RUNS = ("load_1000", "load_2000", "load_3000", "speed_20")
SHARED = NAMES[:8]


@cache
def campaign(seed: int, extra: str = "") -> Findings:
    """Return four runs with exact gauges, and one more."""
    runs = [*RUNS, extra] if extra else [*RUNS]
    return identified(synthesize_bench({"duration": 10.0, "runs": runs}, seed))


def test_proposals_are_sorted_within_reach_and_name_what_gains() -> None:
    found = advise(findings())
    assert 1 <= len(found.proposals) <= 8
    for proposal in found.proposals:
        assert set(proposal.conditions) == {"nominal_load", "nominal_speed", "inflation_pressure"}
        assert 500.0 < proposal.conditions["nominal_load"] < 6000.0
        assert len(proposal.why) > 30
        gains = [one.factor for one in proposal.shrinks if one.factor is not None]
        assert gains == sorted(gains, reverse=True)
        assert all(gain > 1.0 for gain in gains)
    assert any("calibrate it" in remark for remark in found.remarks)


@pytest.mark.thorough
def test_a_second_speed_is_advised_where_loss_and_lag_are_not_told_apart() -> None:
    found = identified(synthesize_bench({"duration": 10.0, "runs": ["load_1000", "load_2000", "load_3000"]}, 4))
    best = advise(found).proposals[0]
    speed = 10.0 / 3.6
    assert not 0.9 < best.conditions["nominal_speed"] / speed < 1.1
    new = {one.name for one in best.shrinks if one.now is None and one.then is not None}
    assert new == {"loss_factor", "sensor_lag"}


def test_nothing_is_proposed_on_a_model_that_does_not_fit() -> None:
    none = findings().model_copy(update={"arrays": {}})
    said = advise(none)
    assert not said.proposals
    assert "no ring fit" in said.remarks[0]


@pytest.mark.thorough
def test_the_run_that_is_made_shrinks_the_errors_as_predicted() -> None:
    """Of a fifth run at 1500 N, 10 km/h; medians over campaigns, whose own estimates of the noise scatter."""
    from pipeline.rigs.tire.bench.advise import predicted

    ratios = []
    for seed in range(4, 10):
        before, after = campaign(seed), campaign(seed, "load_1500")
        then = predicted(before, (1500.0, 10.0 / 3.6, 2.2e5))
        ratios.append([after.one(name).std_error / then[name] for name in SHARED])
    assert np.median(ratios, axis=0) == pytest.approx(1.0, abs=0.2)
