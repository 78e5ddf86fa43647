"""The table of the coverage studies says of known errors what is known of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.coverage import dirt
from benchmarks.coverage.study import Outcome, Row
from benchmarks.coverage.table import lines, summary, text
from pipeline.recording import Channel, Recording, Stream


def outcomes(claimed: float, bias: float = 0.0, campaigns: int = 400, truth: float | None = 10.0) -> list[Outcome]:
    """Campaigns whose value errs by a normal error of one, and claims `claimed`."""
    rng = np.random.default_rng(2)
    found = []
    for seed in range(campaigns):
        value = 10.0 + bias + rng.standard_normal()
        half = 1.96 * claimed
        row = Row("k", "", value, claimed, (value - half, value + half), truth, 1.0)
        found.append(Outcome(seed, "ok", (row, Row("c", "", None, None, None, 1.0, None))))
    return found


def test_an_honest_error_is_within_the_goal() -> None:
    k, c = lines(outcomes(1.0))
    assert k.share == pytest.approx(0.95, abs=0.03)
    assert k.share95[0] < 0.95 < k.share95[1]
    assert k.spread == pytest.approx(1.0, abs=0.08)
    assert k.efficiency == pytest.approx(1.0, abs=0.16)
    assert k.rms == pytest.approx(0.1, abs=0.01)
    assert k.judged == ""
    assert (c.told, c.untold, c.judged) == (0, 400, "")


@pytest.mark.parametrize(("claimed", "judged"), [(0.7, "too narrow"), (1.6, "too wide")])
def test_a_wrong_error_is_named(claimed: float, judged: str) -> None:
    assert lines(outcomes(claimed))[0].judged == judged
    assert judged in text(lines(outcomes(claimed)))


def test_a_bias_shows_in_units_of_the_error() -> None:
    assert lines(outcomes(2.0, bias=3.0))[0].bias == pytest.approx(1.5, abs=0.1)


def test_a_statistic_of_the_noise_is_held_against_its_mean() -> None:
    line = lines(outcomes(1.0, bias=5.0, truth=None))[0]
    assert line.over_seeds
    assert abs(line.bias) < 1e-9
    assert line.share == pytest.approx(0.95, abs=0.03)


def test_the_share_of_few_campaigns_is_told_as_uncertain() -> None:
    low, high = lines(outcomes(1.0, campaigns=20))[0].share95
    assert high - low > 0.1


def test_refusals_are_counted() -> None:
    told = summary([*outcomes(1.0, campaigns=3), Outcome(3, "refused", (), "no run holds 10 samples")])
    assert told["verdicts"] == {"ok": 3, "refused": 1}
    assert told["refused"] == ["no run holds 10 samples"]


def test_dirt_is_what_it_says() -> None:
    time = np.arange(20_000) / 1000.0
    quiet = Recording("r", {"": Stream("", time, {"x": Channel("x", np.full(time.size, 2.0), "m")})})
    noise = dirt.coloured([quiet], np.random.default_rng(1), {"x": 0.5}, 0.01)[0].values("x") - 2.0
    assert noise.std() == pytest.approx(0.5, rel=0.1)
    assert np.corrcoef(noise[:-10], noise[10:])[0, 1] == pytest.approx(math.exp(-1.0), abs=0.06)
    stamps = dirt.jitter([quiet], np.random.default_rng(1), 0.2)[0].streams[""].time
    assert np.all(np.diff(stamps) > 0)
    assert (stamps - time).std() == pytest.approx(0.2e-3, rel=0.1)
    thinned = dirt.dropouts([quiet], np.random.default_rng(1), 3, 50)[0].streams[""]
    assert time.size - 400 < thinned.size < time.size
    assert thinned.time[-1] == time[-1]
    off = dirt.gains([quiet], np.random.default_rng(1), {"x": 0.01})[0].values("x")
    assert np.ptp(off) == 0
    assert off[0] != 2.0
