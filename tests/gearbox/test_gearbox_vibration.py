import numpy as np
import pytest

from pipeline.rigs.gearbox.vibration.levels import (
    aliased_lines,
    high_passed,
    order_levels,
    order_spectrum,
    stage_vibration,
    transient,
)
from pipeline.rigs.gearbox.vibration.vibration_numbers import StageLevel

RATE = 2500.0
T = np.arange(0, 10, 1 / RATE)


def test_a_sine_has_its_rms_crest_and_kurtosis():
    found = stage_vibration(T, 2.0 * np.sin(2 * np.pi * 50 * T), (0.0, 10.0))
    assert found.rms == pytest.approx(np.sqrt(2), rel=1e-3)
    assert found.crest == pytest.approx(np.sqrt(2), rel=4e-3), "sampled beside its top"
    assert found.kurtosis == pytest.approx(1.5, rel=1e-3)


def level_of(x, span):
    found = stage_vibration(T, x, span)
    return StageLevel("r1", "sos", "acc_in_radial", found.rms, found.rms_error, found.dof, found.crest, found.kurtosis)


@pytest.mark.parametrize("span", [(0.0, 10.0), (2.0, 2.3), (2.0, 2.15)])
def test_intervals_of_the_level_of_noise_cover_and_stay_positive(span):
    covered = []
    for seed in range(300):
        estimate = level_of(np.random.default_rng(seed).normal(size=T.size), span).estimate
        assert estimate.ci95[0] > 0
        covered.append(estimate.ci95[0] <= 1.0 <= estimate.ci95[1])
    assert 0.92 < np.mean(covered) < 0.985


def test_gaussian_noise_has_kurtosis_three():
    x = np.random.default_rng(1).normal(size=T.size)
    assert stage_vibration(T, x, (0.0, 10.0)).kurtosis == pytest.approx(3.0, abs=0.2)


def test_a_level_that_rises_within_the_stage_is_no_error_of_its_mean():
    """Slip grows while the brake stops the output: the rms of the stage is its own, and only the noise leaves it open."""
    swell = np.clip(T - 2.0, 0.0, 0.3) / 0.3
    true, covered, widths = np.sqrt(np.mean(swell[(T >= 2.0) & (T < 2.3)] ** 2)), [], []
    for seed in range(200):
        low, high = level_of(swell * np.random.default_rng(seed).normal(size=T.size), (2.0, 2.3)).estimate.ci95
        covered.append(low <= true <= high)
        widths.append((high - low) / 2 / true)
    assert 0.9 < np.mean(covered) < 0.99
    assert np.median(widths) < 0.15


def test_a_stage_too_short_for_an_error_says_so_instead_of_an_interval_below_zero():
    estimate = level_of(np.random.default_rng(0).normal(size=T.size), (2.0, 2.05)).estimate
    assert estimate.value is None
    assert "too short" in estimate.reason


def test_a_dead_channel_has_no_level():
    estimate = level_of(np.zeros_like(T), (2.0, 4.0)).estimate
    assert estimate.value is None
    assert "dead" in estimate.reason


def test_the_high_pass_leaves_no_step_at_the_ends_of_a_noisy_log():
    ends = []
    for seed in range(100):
        x = high_passed(T, np.random.default_rng(seed).normal(size=T.size))
        ends.append(np.mean(x[-1250:] ** 2))
    assert np.mean(ends) == pytest.approx(1.0, abs=0.03)


def test_shocks_raise_the_kurtosis():
    x = np.random.default_rng(0).normal(size=T.size)
    x[::1250] += 15
    assert stage_vibration(T, x, (0.0, 10.0)).kurtosis > 6


def test_gravity_and_drift_are_not_vibration():
    x = 9.81 + 0.5 * T + 0.1 * np.sin(2 * np.pi * 50 * T)
    assert stage_vibration(T, high_passed(T, x), (1.0, 9.0)).rms == pytest.approx(0.1 / np.sqrt(2), rel=0.02)


def test_a_stage_of_a_few_samples_has_no_vibration_level():
    assert stage_vibration(T, np.ones_like(T), (0.0, 0.01)) is None


def test_orders_stay_sharp_while_the_speed_wanders():
    angle = 12.566 * T + 0.8 * np.sin(0.9 * T)
    x = 0.3 * np.sin(angle) + 0.2 * np.sin(40 * angle) + 0.05 * np.random.default_rng(1).normal(size=T.size)
    spectrum = order_spectrum(T, x, (0.0, 10.0), angle)
    levels = {level.order: level for level in order_levels(spectrum, (1, 2, 40, 80), {140: 2})}
    assert levels[1].amplitude == pytest.approx(0.3, rel=0.05)
    assert levels[40].amplitude == pytest.approx(0.2, rel=0.05)
    assert levels[1].stands_out
    assert levels[40].stands_out
    assert not levels[2].stands_out
    assert not levels[80].stands_out
    assert {136, 138, 142, 144} < set(levels)


def test_sidebands_of_passing_carriers_are_read():
    angle = 12.566 * T
    x = 0.2 * (1 + 0.5 * np.cos(2 * angle)) * np.sin(140 * angle) + 0.01 * np.random.default_rng(1).normal(size=T.size)
    levels = {level.order: level for level in order_levels(order_spectrum(T, x, (0.0, 10.0), angle), (140,), {140: 2})}
    assert levels[138].amplitude == pytest.approx(0.05, rel=0.1)
    assert not levels[144].stands_out


def test_a_shaft_that_stands_has_no_orders():
    assert order_spectrum(T, np.sin(T), (0.0, 10.0), np.zeros_like(T)) is None


def test_a_knock_shows_as_transient_energy():
    x = 0.1 * np.random.default_rng(2).normal(size=T.size)
    calm = transient(T, x, 6.0, (1.0, 5.0))
    x[(T > 5.95) & (T < 6.0)] *= 10
    assert calm == pytest.approx(1.0, abs=0.3)
    assert transient(T, x, 6.0, (1.0, 5.0)) > 10


def test_a_mesh_line_folded_at_the_sampling_rate_is_named():
    rate, speed = 800.0, 21.6
    t = np.arange(0, 10, 1 / rate)
    x = np.sin(140 * speed * t) + 0.3 * np.random.default_rng(3).normal(size=t.size)
    ((order, frequency),) = aliased_lines(t, x, (0.0, 10.0), speed, (40, 80, 140, 280))
    assert order == 140
    assert frequency == pytest.approx(rate - 140 * speed / (2 * np.pi), abs=0.2)
    quiet = 0.3 * np.random.default_rng(3).normal(size=t.size)
    assert aliased_lines(t, quiet, (0.0, 10.0), speed, (40, 80, 140, 280)) == []
