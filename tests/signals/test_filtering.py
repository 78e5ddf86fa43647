import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.signals.filtering import low_pass, slope
from pipeline.signals.resampling import interpolated, stretches, to_uniform

t = np.arange(0, 4, 1e-3)


def wave(time, f=3.0):
    return np.sin(2 * np.pi * f * time + 0.7)


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("frequency", [5.0, 20.0, 40.0])
def test_gain_is_that_of_two_butterworth_passes_with_0707_at_the_cutoff(order, frequency):
    fine = np.arange(0, 4, 1e-4)  # far above the cutoff, as the formula is that of the analogue filter
    y = low_pass(fine, wave(fine, frequency), 20.0, order)
    inner = slice(10_000, 30_000)
    carrier = np.exp(-2j * np.pi * frequency * fine[inner])
    gain = (y[inner] @ carrier) / (wave(fine, frequency)[inner] @ carrier)
    ratio = (frequency / 20.0) ** (2 * order)
    assert gain.real == pytest.approx(1 / (1 + (np.sqrt(2) - 1) * ratio), rel=0.01, abs=1e-4)
    assert abs(gain.imag) < 2e-3  # zero phase


def test_ends_are_not_bent_by_the_reflection():
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(40):
        y = low_pass(t, wave(t) + 0.05 * rng.normal(size=t.size), 30.0)
        errors.append(y - wave(t))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert rms[1000:3000].max() < 0.05 * np.sqrt(2 * 30 / 1000) * 1.6
    assert rms.max() < 0.05  # at the very end still better than the raw samples


def test_jittered_stamps_and_dropouts_give_the_same_curve():
    rng = np.random.default_rng(1)
    time = np.sort(t + 2e-4 * rng.uniform(-1, 1, t.size))
    x = wave(time)
    x[rng.integers(0, t.size, 100)] = np.nan
    y = low_pass(time, x, 40.0)
    assert np.array_equal(np.isnan(y), np.isnan(x))
    assert np.nanmax(np.abs(y - wave(time))) < 5e-3


def test_stamps_half_a_step_off_the_grid_cost_no_amplitude():
    t = np.arange(0, 4, 1 / 300)
    t[600:] += 0.5 / 300  # as after a lost row
    smooth = low_pass(t, wave(t, 17.0), 60.0, order=8)
    assert np.abs(smooth - wave(t, 17.0))[30:-30].max() < 2e-3


def test_long_gaps_part_the_record():
    kept = (t < 1.5) | (t > 2.5)
    x = np.where(t < 2, wave(t), 100 + wave(t))  # a jump in the gap must not ring on either side
    y = low_pass(t[kept], x[kept], 20.0)
    assert np.abs(y - x[kept]).max() < 0.02


def test_a_cutoff_near_half_the_rate_takes_nothing_away():
    x = np.random.default_rng(2).normal(size=200)
    assert np.array_equal(low_pass(np.arange(200) / 100.0, x, 60.0), x)


def test_too_few_samples_come_back_as_they_are():
    assert np.array_equal(low_pass(np.array([0.0, 0.1]), np.array([1.0, 2.0]), 1.0), [1.0, 2.0])
    assert np.isnan(low_pass(t[:3], np.array([1.0, np.nan, np.nan]), 1.0)).sum() == 2
    with pytest.raises(InputError, match="above 0 Hz"):
        low_pass(t, t, 0.0)


def test_slope_of_a_sine_is_its_cosine_ends_included():
    expected = 6 * np.pi * np.cos(6 * np.pi * t + 0.7)
    assert np.abs(slope(t, wave(t), 0.05) - expected).max() < 0.02 * 6 * np.pi


def test_slope_at_jittered_stamps_with_a_gap():
    rng = np.random.default_rng(3)
    time = np.sort(t + 2e-4 * rng.uniform(-1, 1, t.size))
    time = time[(time < 1) | (time > 2)]
    expected = 6 * np.pi * np.cos(6 * np.pi * time + 0.7)
    assert np.abs(slope(time, wave(time), 0.05) - expected).max() < 0.03 * 6 * np.pi


def test_noise_of_the_slope_is_that_of_the_local_fit():
    # Cubic over 2 m + 1 points: the derivative's variance, Savitzky and Golay's closed form.
    noise = np.random.default_rng(4).normal(size=100_000)
    time = np.arange(noise.size) * 1e-3
    m = 10
    k = np.arange(-m, m + 1.0)
    pseudo = np.linalg.pinv(np.vander(k, 4, increasing=True))
    expected = np.sqrt((pseudo[1] ** 2).sum()) / 1e-3
    assert slope(time, noise, 0.021)[50:-50].std() == pytest.approx(expected, rel=0.02)


def test_stretches_part_at_gaps_only():
    x = np.array([0.0, 1, 2, 3, 10, 11, 12])
    values = np.array([1.0, 2, np.nan, 4, 5, 6, 7])
    assert [p.tolist() for p in stretches(x, values)] == [[0, 1, 3], [4, 5, 6]]
    assert [p.tolist() for p in stretches(x, values, 1.5)] == [[0, 1], [3], [4, 5, 6]]
    assert stretches(x, np.full(7, np.nan)) == []


def test_cubic_interpolation_keeps_an_oscillation_that_straight_lines_cut():
    coarse = np.arange(0, 2, 1 / 30)  # ten samples a cycle
    between = coarse[5:-5] + 0.5 / 30
    cubic = interpolated(coarse, wave(coarse), between)
    straight = interpolated(coarse, wave(coarse), between, linear=True)
    assert np.abs(cubic - wave(between)).max() < 0.005
    assert np.abs(straight - wave(between)).max() > 0.04


def test_gaps_stay_gaps_on_the_grid():
    kept = (t < 1) | (t > 2)
    found = to_uniform(t[kept], wave(t[kept]), rate=100.0)
    assert found.rate == pytest.approx(100.0)
    inside = (found.grid > 1.001) & (found.grid < 1.999)
    assert not found.valid[inside].any()
    assert np.isnan(found.values[inside]).all()
    assert np.abs(found.values - wave(found.grid))[found.valid].max() < 1e-6
    with pytest.raises(InputError, match="at least 2"):
        to_uniform(t[:1], t[:1])
