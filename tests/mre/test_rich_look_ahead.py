"""Symmetric filters that look ahead: no phase shift, gaps kept, any blocks give the same steps."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.rigs.mre.rich.look_ahead import LookAhead, Steps


def sine(t: np.ndarray, frequency: float = 12.0) -> np.ndarray:
    return np.asarray(np.sin(2 * np.pi * frequency * t))


def test_motion_passes_without_phase_shift_and_noise_does_not() -> None:
    t = np.arange(0, 4, 2e-4)
    noise = 0.01 * np.random.default_rng(0).standard_normal(t.size)
    ahead = LookAhead(60.0)
    steps = ahead.feed(t, sine(t) + noise, 3 * sine(t))
    assert ahead.delay == pytest.approx(0.05)
    assert np.diff(steps.time) == pytest.approx(1e-3)
    assert np.std(steps.path[:, -1] - sine(steps.time)) < 0.0025  # 0.01 sqrt(60/2500) = 0.0015
    assert steps.force == pytest.approx(3 * sine(steps.time), abs=2e-3)
    quiet = LookAhead(60.0).feed(t, sine(t), sine(t))
    assert quiet.path[:, -1] == pytest.approx(sine(quiet.time), abs=1e-3)
    true = 2 * np.pi * 12 * np.cos(2 * np.pi * 12 * quiet.time)
    assert quiet.velocity == pytest.approx(true, abs=2e-3 * 2 * np.pi * 12)


def test_each_step_begins_where_the_last_one_ended() -> None:
    t = np.arange(0, 1, 2e-4)
    steps = LookAhead(60.0).feed(t, sine(t), sine(t))
    assert (steps.path[1:, 0] == steps.path[:-1, -1]).all()
    assert steps.fresh.tolist() == [True] + [False] * (steps.fresh.size - 1)


@pytest.mark.parametrize("size", [1, 37, 1000])
def test_blocks_of_any_size_give_the_same_steps(size: int) -> None:
    rng = np.random.default_rng(1)
    t = np.arange(0, 0.6, 1e-3)
    t = t[rng.random(t.size) > 0.01]
    x, force = sine(t), 2 * sine(t)
    whole = LookAhead(60.0).feed(t, x, force)
    ahead = LookAhead(60.0)
    parts = [ahead.feed(*(v[i : i + size] for v in (t, x, force))) for i in range(0, t.size, size)]
    joined = Steps.joined([part for part in parts if part.time.size])
    assert joined.time == pytest.approx(whole.time, abs=1e-12)
    assert joined.path == pytest.approx(whole.path, abs=1e-12)
    assert joined.force == pytest.approx(whole.force, abs=1e-12)


def test_a_gap_parts_the_stream_and_a_lost_sample_does_not() -> None:
    t = np.arange(0, 2, 2e-4)
    kept = (t < 0.9) | (t > 1.1)
    kept[700] = False
    steps = LookAhead(60.0).feed(t[kept], sine(t[kept]), sine(t[kept]))
    assert steps.fresh.sum() == 2
    assert not ((steps.time > 0.86) & (steps.time < 1.14)).any()
    assert steps.path[:, -1] == pytest.approx(sine(steps.time), abs=2e-3)


def test_where_the_force_was_not_measured_none_is_given() -> None:
    t = np.arange(0, 1, 2e-4)
    force = np.where((t > 0.5) & (t < 0.6), np.nan, sine(t))
    steps = LookAhead(60.0).feed(t, sine(t), force)
    lost = np.isnan(steps.force)
    assert lost[(steps.time > 0.5) & (steps.time < 0.6)].all()
    assert not lost[(steps.time < 0.48) | (steps.time > 0.62)].any()
    assert np.isfinite(steps.path).all()


def test_a_coarse_log_gets_places_between_its_samples() -> None:
    t = np.arange(0, 3, 1 / 250)
    ahead = LookAhead(60.0)
    steps = ahead.feed(t, sine(t), sine(t))
    assert ahead.pieces == 4
    between = steps.time[:, None] + np.linspace(-1 / 250, 0, 5)
    assert steps.path[1:] == pytest.approx(sine(between)[1:], abs=2e-3)


def test_a_known_lag_of_the_force_is_taken_out() -> None:
    t = np.arange(0, 1, 2e-4)
    for lag in (3e-3, -3e-3):
        steps = LookAhead(60.0, force_lag=lag).feed(t, sine(t), sine(t - lag))
        assert steps.force == pytest.approx(sine(steps.time), abs=2e-3)
