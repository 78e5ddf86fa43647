"""The online filter along a record, and what is said of its numbers: converged, not, diverged."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from rich_logs import rich, samples, true_values

from pipeline.rigs.mre.rich.joint_filter import Start
from pipeline.rigs.mre.rich.joint_state import to_logs
from pipeline.rigs.mre.rich.online import Online
from pipeline.rigs.mre.rich.online_verdict import judge_online


def follow(online: Online, *series: np.ndarray, size: int = 4000) -> Online:
    for i in range(0, series[0].size, size):
        online.feed(*(v[i : i + size] for v in series))
    online.finish()
    return online


@cache
def whole(current: float) -> Online:
    return follow(Online(viscous=current > 0), *samples(rich(current, duration=60.0)))


def ends(online: Online) -> dict[str, float]:
    return {name: float(values[-1]) for name, values in online.history.band().items()}


def test_a_minute_of_chirp_gives_the_parameters() -> None:
    found, truth = ends(whole(0.0)), true_values(0.0)
    for name, near in {
        "k1": 0.02,
        "s1": 0.03,
        "k2": 0.01,
        "alpha_bw": 0.02,
        "rho": 0.01,
        "c_bw": 0.02,
        "n_bw": 0.02,
    }.items():
        assert found[name] == pytest.approx(truth[name], rel=near), name
    assert found["force_lag"] == pytest.approx(60e-6, abs=20e-6)
    verdict = judge_online(whole(0.0))
    assert verdict.converged
    assert "times the noise" in verdict.reason


def test_with_a_field_a_viscous_state_finds_the_fields_damping() -> None:
    found, truth = ends(whole(6.0)), true_values(6.0)
    for name, near in {"k1": 0.1, "s1": 0.15, "k2": 0.02, "alpha_bw": 0.03, "rho": 0.02, "s_mr": 0.15}.items():
        assert found[name] == pytest.approx(truth[name], rel=near), name
    assert "s_mr" not in ends(whole(0.0))


def test_the_band_narrows_as_the_log_grows() -> None:
    history = whole(0.0).history
    half = history.band(1.96)["k2"] - history.band()["k2"]
    at = [int(np.searchsorted(history.time, t)) - 1 for t in (5.0, 20.0, 59.0)]
    assert half[at[0]] > 2 * half[at[1]] > 4 * half[at[2]]


@pytest.mark.parametrize("size", [97, 20000])
def test_blocks_of_any_size_end_at_the_same_numbers(size: int) -> None:
    series = samples(rich(duration=20.0))
    reference = ends(follow(Online(viscous=False), *series))
    assert ends(follow(Online(viscous=False), *series, size=size)) == pytest.approx(reference, rel=1e-6)


def test_a_short_record_has_not_converged_and_says_that_the_annealing_goes_on() -> None:
    verdict = judge_online(follow(Online(viscous=False), *samples(rich(duration=10.0))))
    assert verdict.word == "not converged"
    assert "annealing has not faded" in verdict.reason


@pytest.mark.thorough
def test_a_start_far_off_is_never_called_converged_at_wrong_numbers() -> None:
    series, truth = samples(rich(duration=60.0)), true_values(0.0)
    own = whole(0.0).filter
    assert own is not None
    wrong = 0
    for factors in ((8.0, 0.1), (0.1, 10.0), (20.0, 0.02)):
        values = {**truth, "k1": truth["k1"] * factors[0], "tau": truth["tau"] * factors[1], "alpha_bw": 10.0}
        start = Start(to_logs(values), own.start.excursion, own.start.swing, 0.0, 20.0, 5e-5, None)
        online = follow(Online(viscous=False, start=start, annealed=False), *series)
        off = max(abs(ends(online)[name] / truth[name] - 1) for name in ("k1", "tau", "k2", "alpha_bw", "rho"))
        if off > 0.2:
            wrong += 1
            assert not judge_online(online).converged, factors
    assert wrong > 0  # constant R does lose its way from such starts


def test_a_gap_in_the_log_costs_the_memory_and_not_the_parameters() -> None:
    t, x, force = samples(rich(duration=60.0))
    kept = (t < 30) | (t > 33)
    online = follow(Online(viscous=False), t[kept], x[kept], force[kept])
    assert judge_online(online).converged
    assert ends(online)["k2"] == pytest.approx(2.6e5, rel=0.01)


def test_wild_and_missing_samples_of_the_force_do_not_lead_astray() -> None:
    t, x, force = samples(rich(duration=60.0))
    force = force.copy()
    force[::5000] += 1e4
    force[20000:20400] = np.nan
    online = follow(Online(viscous=False), t, x, force)
    assert ends(online)["k2"] == pytest.approx(2.6e5, rel=0.02)


def test_without_motion_there_is_no_filter() -> None:
    t = np.arange(0, 5, 1e-3)
    noise = 1e-9 * np.random.default_rng(0).standard_normal((2, t.size))
    online = follow(Online(viscous=False), t, 0 * noise[0], noise[1])
    verdict = judge_online(online)
    assert verdict.word == "no filter"
    assert "hardly anything moves" in verdict.reason


def test_a_force_that_drives_the_motion_does_not_start_the_filter() -> None:
    t, x, force = samples(rich(duration=10.0))
    online = follow(Online(viscous=False), t, x, -force)
    assert judge_online(online).word == "no filter"


def test_what_the_batch_fit_leaves_counts_as_noise_where_it_is_more() -> None:
    online = whole(0.0)
    assert judge_online(online, 10.0).noise == 10.0
    loud = judge_online(replace_sigma(online, online.sigma / 3))
    assert loud.word == "diverged"
    assert "the noise of the force" in loud.reason


def replace_sigma(online: Online, sigma: float) -> Online:
    other = Online(viscous=False)
    other.history, other.filter, other.sigma = online.history, online.filter, sigma
    return other


def test_a_known_lag_is_not_searched() -> None:
    online = follow(Online(viscous=False, force_lag=60e-6), *samples(rich(duration=20.0)))
    assert abs(ends(online)["force_lag"]) < 1e-9


@pytest.mark.parametrize("seed", [101, pytest.param(102, marks=pytest.mark.thorough)])
def test_a_record_in_full_motion_at_its_start_converges_with_a_field(seed: int) -> None:
    time, x, force = samples(rich(6.0, seed, 61.0, 1000.0))
    moving = time > 1.0
    online = follow(Online(viscous=True), time[moving], x[moving], force[moving])
    assert judge_online(online).converged
    for name in ("k1", "k2", "alpha_bw", "rho", "c_bw", "n_bw"):
        assert ends(online)[name] == pytest.approx(true_values(6.0)[name], rel=0.08), name
