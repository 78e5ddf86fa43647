import numpy as np
import pytest

from pipeline.rigs.gearbox.vibration import (
    aliased_lines,
    high_passed,
    order_levels,
    order_spectrum,
    stage_vibration,
    transient,
)

RATE = 2500.0
T = np.arange(0, 10, 1 / RATE)


def test_a_sine_has_its_rms_crest_and_kurtosis():
    found = stage_vibration(T, 2.0 * np.sin(2 * np.pi * 50 * T), (0.0, 10.0))
    assert found.rms == pytest.approx(np.sqrt(2), rel=1e-3)
    assert found.crest == pytest.approx(np.sqrt(2), rel=4e-3), "sampled beside its top"
    assert found.kurtosis == pytest.approx(1.5, rel=1e-3)


def test_gaussian_noise_has_kurtosis_three_and_an_honest_error():
    covered = []
    for seed in range(60):
        found = stage_vibration(T, np.random.default_rng(seed).normal(size=T.size), (0.0, 10.0))
        covered.append(abs(found.rms - 1.0) < 2.0 * found.rms_error)
        assert found.kurtosis == pytest.approx(3.0, abs=0.2)
    assert np.mean(covered) > 0.85


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
