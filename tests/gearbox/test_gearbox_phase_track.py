import numpy as np
import pytest

from pipeline.rigs.gearbox.vibration.mesh import input_speed
from pipeline.rigs.gearbox.vibration.phase_track import follow

RATE, ORDERS = 2000.0, (40.0, 80.0, 140.0, 280.0)
AMPLITUDES = (1.0, 0.4, 0.7, 0.3)


def lines(angle, rng, sizes=AMPLITUDES, swell=0.0):
    """Mesh lines over the slip angle; `swell` modulates mesh 1 twice a turn, as passing planets do."""
    total = np.zeros_like(angle)
    for order, size in zip(ORDERS, sizes, strict=True):
        carrier = 1 + swell * np.cos(2 * angle) if order >= 140 else 1.0
        total += size * carrier * np.sin(order * angle + rng.uniform(0, 2 * np.pi))
    return total


def drifting(seed, drift, noise=0.5, speed=12.37, duration=9.4, **options):
    """A speed that falls by `drift` rad/s over the stretch, as that of a drive that grows warm."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, 1 / RATE)
    angle = speed * t - drift * (t**2 / 2 / duration - t / 2)
    return t, {"acc": lines(angle, rng, **options) + noise * rng.standard_normal(t.size)}


def test_the_phases_tell_the_mean_rate_however_it_moved():
    rng = np.random.default_rng(1)
    t = np.arange(0, 9.0, 1 / RATE)
    angle = 12.37 * t + 0.05 * (1 - np.cos(0.7 * t)) / 0.7
    found = follow([lines(angle, rng) + 0.3 * rng.standard_normal(t.size)], RATE, ORDERS, np.full(t.size, 12.37), 1.0)
    first, last = np.interp(found.span, t, angle)
    assert found.rate == pytest.approx((last - first) / (found.span[1] - found.span[0]), rel=1e-5)
    assert not found.steady
    assert found.wander == pytest.approx(0.05 / np.sqrt(2), rel=0.4)


def test_a_steady_rate_is_told_as_steady_and_its_error_covers():
    ratios = []
    for seed in range(30):
        t, channels = drifting(seed, 0.0)
        found = follow([channels["acc"]], RATE, ORDERS, np.full(t.size, 12.371), 1.0)
        assert found.steady
        ratios.append((found.rate - 12.37) / found.std_error)
    assert 0.7 < np.std(ratios) < 1.4


def test_noise_alone_is_no_track():
    noise = np.random.default_rng(0).standard_normal(18000)
    assert follow([noise], RATE, ORDERS, np.full(noise.size, 12.37), 1.0) is None


@pytest.mark.parametrize("drift", [0.0, 0.005, 0.02, 0.1, 0.3])
@pytest.mark.parametrize("swell", [0.0, 0.5])
def test_the_speed_in_sos_is_its_mean_over_the_stage_whatever_it_drifts(drift, swell):
    """One second of a drifting speed smears the fast lines: the intervals must hold the mean all the same."""
    errors = []
    for seed in range(12):
        t, channels = drifting(seed, drift, swell=swell)
        found = input_speed(t, channels, (0.0, 9.4), 12.566)
        errors.append((found.speed - 12.37) / found.std_error)
        assert abs(found.speed - 12.37) < 2e-5 * 12.37 + 0.02 * drift
    assert np.mean(np.abs(errors) < 1.96) > 0.8
    assert abs(np.mean(errors)) < 1.0, "one-sided"


def test_every_single_weak_channel_finds_the_same_speed():
    """Pieces of a second in noise scatter and are skewed; where the speed is steady they must not be averaged."""
    errors = []
    for seed in range(25):
        t, channels = drifting(seed, 0.0, noise=4.0)
        found = input_speed(t, channels, (0.0, 9.4), 12.566)
        errors.append((found.speed - 12.37) / found.std_error)
        assert abs(found.speed - 12.37) < 8e-4
    assert np.mean(np.abs(errors) < 1.96) > 0.85
