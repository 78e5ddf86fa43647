"""Tracks are filterpy's Kalman filter, consistent with what they follow, deaf to wild values but not to manoeuvres."""

import numpy as np
import pytest
from drives_of_truth import drive

from pipeline.rigs.tire.road.tracking import nyquist, smoothed, track


def wandering(n=600, q=1000.0, sd=25.0, seed=1):
    """A walk of the filter's own kind: times, truth, measurements, standard errors."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.12, 0.25, n))
    truth, x = np.zeros(n), np.array([3500.0, 0.0])
    for i, dt in enumerate(np.diff(time, prepend=time[0] - 0.2)):
        Q = q**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        x = np.array([[1, dt], [0, 1]]) @ x + np.linalg.cholesky(Q) @ rng.standard_normal(2)
        truth[i] = x[0]
    se = rng.uniform(0.5, 1.5, n) * sd
    return time, truth, truth + se * rng.standard_normal(n), se


@pytest.mark.parametrize("gaps", [False, True])
def test_the_compiled_loop_is_filterpy(gaps):
    time, _, values, se = wandering(150)
    values[40] += 5000.0
    values[100:] += 4000.0
    if gaps:
        values[60:75] = np.nan
    one, other = (track(time, values, se, q=700.0, tune=False, compiled=how) for how in (True, False))
    assert np.allclose(one.value, other.value, rtol=1e-10)
    assert np.allclose(one.se, other.se, rtol=1e-9)
    assert np.allclose(one.nis, other.nis, rtol=1e-8, equal_nan=True)
    assert np.array_equal(one.gated, other.gated)
    assert one.gated[40]
    assert not one.gated[100]


def test_tuning_finds_the_walk_and_the_filter_is_consistent():
    covered = []
    for seed in range(1, 9):
        time, truth, values, se = wandering(seed=seed)
        found = track(time, values, se, q=100.0)
        assert found.q == pytest.approx(1000.0, rel=0.3)
        covered.append(np.abs(found.value - truth) < 1.96 * found.se)
        later, later_se = smoothed(found)
        assert np.std(later - truth) < np.std(found.value - truth)
        assert np.mean(np.abs(later - truth) < 1.96 * later_se) > 0.9
    assert 0.93 < np.mean(covered) < 0.97


def test_about_95_in_100_consistent_filters_are_called_so():
    verdicts = [
        track(*wandering(300, seed=seed)[::2], wandering(300, seed=seed)[3], q=1000.0, tune=False).consistent
        for seed in range(60)
    ]
    assert 0.85 < np.mean(verdicts) <= 1.0


@pytest.mark.parametrize(("factor", "word"), [(0.5, "too sure"), (2.0, "too careful")])
def test_wrong_errors_are_told(factor, word):
    time, _, values, se = wandering()
    found = track(time, values, factor * se, q=1000.0, tune=False)
    assert not found.consistent
    assert word in found.verdict


def test_a_gap_is_predicted_through_with_growing_error():
    time, _, values, se = wandering()
    values[200:230] = np.nan
    found = track(time, values, se, q=1000.0, tune=False)
    assert np.all(np.diff(found.se[200:230]) > 0.0)
    assert np.isnan(found.nis[200:230]).all()
    assert found.se[235] < found.se[229]


def test_a_wild_value_is_passed_over_and_braking_is_not():
    time = 0.15 * np.arange(200)
    force = np.where(time > 15.0, -875.0, 0.0)
    rng = np.random.default_rng(2)
    values = force + 30.0 * rng.standard_normal(200)
    values[60] += 2000.0
    found = track(time, values, np.full(200, 30.0), q=1000.0, tune=False)
    assert found.gated[60]
    assert abs(found.value[60]) < 100.0
    assert abs(found.value[np.searchsorted(time, 15.0) + 2] + 875.0) < 150.0


def test_half_the_rate_of_revolutions_is_the_fastest_change_seen():
    time = np.arange(20) * (2 * np.pi * 0.3171 / (50 / 3.6))
    assert nyquist(time) == pytest.approx(3.49, abs=0.02)


def test_tracks_of_the_standard_drive_are_closer_than_asked():
    found = drive(1)
    f = found.forces
    for values, se, truth, most in ((f.load, f.load_se, found.Fz, 40.0), (f.force, f.force_se, found.Fx, 100.0)):
        course = track(f.time, values, se, q=1000.0, usable=f.fits)
        assert np.sqrt(np.mean((course.value - truth) ** 2)) < 0.6 * most
        assert course.consistent
    rotation = track(f.time, f.speed, f.speed_se, q=1.0)
    assert np.sqrt(np.mean((0.3171 * rotation.value / (1 + found.Fx / 6e4) - found.speed) ** 2)) < 0.05


def test_nothing_measured_is_no_track():
    with pytest.raises(ValueError, match="nothing to track"):
        track(np.arange(5.0), np.full(5, np.nan), np.ones(5), q=1.0)
