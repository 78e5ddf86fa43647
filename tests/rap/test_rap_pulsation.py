"""Roller passages and harmonics of signals whose frequency, amplitudes and phases are known."""

import numpy as np
import pytest

from pipeline.rigs.rap.pulsation.harmonics import harmonics
from pipeline.rigs.rap.pulsation.passages import find_passages
from pipeline.rigs.rap.pulsation.pump import pump
from pipeline.rigs.rap.pulsation.steady import held, steady_windows, steps
from pipeline.rigs.rap.pulsation.windows import Windows, cut

F, A = 1.958, (800.0, 250.0, 70.0)
PHASES = (0.3, -1.1, 2.0)


def pressure(rate=20.0, duration=200.0, seed=0, noise=25.0, sub=60.0, frequency=F, level=3000.0):
    """Return stamps with jitter and a pulsating pressure with roller asymmetry at a third of the passages."""
    rng = np.random.default_rng(seed)
    n = int(duration * rate)
    time = np.sort(np.arange(n) / rate + rng.normal(0.0, 0.002, n))
    phase = 2.0 * np.pi * frequency * time
    values = level + sum(a * np.cos(k * phase + p) for k, (a, p) in enumerate(zip(A, PHASES, strict=True), 1))
    return time, values + sub * np.cos(phase / 3.0) + rng.normal(0.0, noise, n)


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
def test_frequency_and_amplitude_are_recovered_at_every_sampling_rate(rate):
    time, values = pressure(rate)
    found = find_passages(time, values)
    assert found.turning.all()
    assert np.abs(found.frequency - F).max() < 0.004
    assert np.abs(found.amplitude / A[0] - 1.0).max() < 0.03


def test_a_gap_costs_its_samples_only():
    time, values = pressure()
    lost = (time > 52.0) & (time < 55.0)
    found = find_passages(time[~lost], values[~lost])
    assert found.turning.all()
    assert np.abs(found.frequency - F).max() < 0.004


def test_a_window_without_most_of_its_samples_is_lost():
    time, values = pressure()
    lost = (time > 50.0) & (time < 58.0)
    found = find_passages(time[~lost], values[~lost])
    assert found.state[5] == "lost"
    assert np.isnan(found.frequency[5])
    assert found.turning.sum() == found.state.size - 1


def test_standard_error_of_the_frequency_covers_the_truth_under_white_noise():
    errors = []
    for seed in range(6):
        time, values = pressure(duration=400.0, seed=seed, sub=0.0, noise=60.0)
        found = find_passages(time, values)
        errors.append((found.frequency - F) / found.frequency_error)
    z = np.concatenate(errors)
    assert 0.85 < z.std() < 1.15
    assert abs(z.mean()) < 0.25


def test_a_standing_pump_has_no_passages():
    rng = np.random.default_rng(1)
    time = np.arange(2000) / 20.0
    found = find_passages(time, 80.0 + rng.normal(0.0, 25.0, time.size))
    assert (found.state == "stopped").all()
    assert np.isnan(found.frequency).all()


def test_the_strongest_line_is_rejected_where_it_jumps_to_the_rotor_rate_at_the_same_level():
    time, values = pressure(frequency=2.7)
    strong = (time > 80.0) & (time < 110.0)
    worn = values + np.where(strong, 2500.0 * np.cos(2.0 * np.pi * 0.9 * time), 0.0)
    found = find_passages(time, worn)
    assert set(np.flatnonzero(found.state == "jump")) == {8, 9, 10}
    assert np.abs(found.frequency[found.turning] - 2.7).max() < 0.004


def test_a_pump_that_is_set_to_twice_the_speed_is_no_jump():
    rng = np.random.default_rng(3)
    time = np.arange(4000) / 20.0
    f = np.where(time < 100.0, 1.2, 2.4)
    values = 1500.0 * f + 800.0 * np.cos(2.0 * np.pi * np.cumsum(f) / 20.0) + rng.normal(0.0, 25.0, time.size)
    found = find_passages(time, values)
    assert found.turning.all()


def test_a_window_in_which_the_speed_changes_is_unsteady():
    rng = np.random.default_rng(4)
    time = np.arange(4000) / 20.0
    f = np.where(time < 95.0, 1.4, 2.5)
    values = 1500.0 * f + 800.0 * np.cos(2.0 * np.pi * np.cumsum(f) / 20.0) + rng.normal(0.0, 25.0, time.size)
    found = find_passages(time, values)
    assert list(np.flatnonzero(found.state == "unsteady")) == [9]


def test_harmonics_of_another_channel_have_its_delay_as_phase():
    time, values = pressure(sub=0.0, noise=5.0)
    delay = 0.013
    phase = 2.0 * np.pi * F * (time - delay)
    late = 0.5 * sum(a * np.cos(k * phase + p) for k, (a, p) in enumerate(zip(A, PHASES, strict=True), 1))
    windows = cut(0.0, 200.0, 10.0)
    f = np.full(windows.size, F)
    ratio = harmonics(time, late, windows, f).coefficients / harmonics(time, values, windows, f).coefficients
    lag = -np.angle(ratio) / (2.0 * np.pi * F * np.array([1.0, 2.0, 3.0]))
    assert np.abs(np.median(lag, axis=0) - delay).max() < 2e-4
    assert np.median(np.abs(ratio), axis=0) == pytest.approx(0.5, rel=0.01)


def test_errors_of_the_harmonics_cover_under_white_noise():
    time, values = pressure(duration=2000.0, sub=0.0)
    windows = cut(0.0, 2000.0, 10.0)
    found = harmonics(time, values, windows, np.full(windows.size, F))
    turn = np.exp(2j * np.pi * F * np.outer(windows.centre, [1, 2, 3]))
    true = np.array(A) * np.exp(1j * np.array(PHASES)) * turn
    z = (found.coefficients - true).real / found.errors
    assert np.abs(z.std(axis=0) - 1.0).max() < 0.15


def test_orders_above_the_sampling_limit_are_left_out():
    time, values = pressure(10.0)
    found = harmonics(time, values, cut(0.0, 200.0, 10.0), np.full(20, F))
    assert np.isfinite(found.coefficients[:, :2]).all()
    assert np.isnan(found.coefficients[:, 2]).all()


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0])
def test_starts_and_stops_of_the_pump_are_told(rate):
    rng = np.random.default_rng(5)
    time = np.arange(int(400 * rate)) / rate
    on = ((time > 20.0) & (time <= 150.0)) | ((time > 170.0) & (time <= 380.0))
    values = 80.0 + on * (3000.0 + 800.0 * np.cos(2.0 * np.pi * F * time)) + rng.normal(0.0, 25.0, time.size)
    found = pump(time, values)
    assert found.changes == pytest.approx([20.0, 150.0, 170.0, 380.0], abs=0.25)
    assert found.on(np.array([10.0, 100.0, 160.0, 300.0, 390.0])).tolist() == [False, True, False, True, False]


def test_a_pump_that_never_stops_has_no_rest():
    time, values = pressure()
    found = pump(time, values)
    assert found.rests == ()
    assert found.stretches[0].start is None
    assert found.stretches[0].stop is None


def test_a_pulsation_that_becomes_weak_is_no_stop():
    time, values = pressure(sub=0.0)
    weak = np.where(time > 120.0, 0.12, 1.0)
    found = pump(time, 3000.0 + weak * (values - 3000.0))
    assert len(found.stretches) == 1
    assert found.changes.size == 0


def test_windows_keep_clear_of_changes():
    found = steady_windows([(20.0, 140.0)], np.array([80.0]), 10.0, settle=5.0, before=1.0)
    assert found.start.tolist() == [25.0, 35.0, 45.0, 55.0, 65.0, 85.0, 95.0, 105.0, 115.0, 125.0]
    assert found.end.max() <= 139.0


def test_a_set_value_holds_until_the_next():
    time, values = np.array([0.0, 10.0, 20.0]), np.array([1.0, 1.0, 2.0])
    assert held(time, values, np.array([-5.0, 5.0, 19.9, 20.0, 30.0])).tolist() == [1.0, 1.0, 1.0, 2.0, 2.0]
    assert steps(time, values, 0.01).tolist() == [20.0]


def test_no_windows_and_no_samples_give_empty_answers():
    assert cut(0.0, 5.0, 10.0).size == 0
    assert find_passages(np.empty(0), np.empty(0)).state.size == 0
    assert pump(np.empty(0), np.empty(0)).stretches == ()
    assert harmonics(np.empty(0), np.empty(0), Windows(np.empty(0), np.empty(0)), np.empty(0)).mean.size == 0
