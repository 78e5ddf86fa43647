import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from pipeline.errors import InputError
from pipeline.signals.cycles import cut, turning_points
from pipeline.signals.periodicity import classify

t = np.arange(0, 10, 2e-3)


def sine(f=3.0, start=0.0, end=np.inf, amplitude=1.0):
    moving = (t >= start) & (t < end)
    last = np.sin(2 * np.pi * f * (min(end, 1e9) - start))
    return amplitude * np.where(moving, np.sin(2 * np.pi * f * (t - start)), np.where(t < start, 0.0, last))


def noise(sigma, seed=0):
    return sigma * np.random.default_rng(seed).normal(size=t.size)


@pytest.mark.parametrize("sigma", [0.0, 0.003, 0.03])
def test_a_sine_is_periodic_with_all_its_whole_cycles(sigma):
    found = classify(t, 5 + sine(3.05) + noise(sigma))
    assert found.kind == "periodic"
    assert found.frequency == pytest.approx(3.05, rel=1e-3)
    assert found.cycles == found.steady_cycles == 30
    assert found.amplitude == pytest.approx(1.0, abs=0.01)
    assert found.remarks == ()


@pytest.mark.parametrize(("start", "end"), [(2.0, np.inf), (0.0, 7.1), (1.37, 8.2)])
def test_still_stretches_before_and_after_do_not_enter(start, end):
    found = classify(t, sine(1.5, start, end) + noise(0.001))
    assert found.kind == "periodic"
    assert found.moving[0] == pytest.approx(start, abs=0.01)
    assert found.moving[1] == pytest.approx(min(end, t[-1]), abs=0.02)
    assert found.steady[0] >= start - 0.01
    assert found.still_before == pytest.approx(start, abs=0.01)


@pytest.mark.parametrize("samples", [5, 12, 300])
@pytest.mark.parametrize("cycles", [2.5, 10.4])
def test_few_samples_a_cycle_are_enough(samples, cycles):
    phase = np.arange(int(samples * cycles)) / samples
    found = classify(phase / 0.02, 1e-4 * np.sin(2 * np.pi * phase + 0.3))
    assert found.kind == "periodic"
    assert found.frequency == pytest.approx(0.02, rel=0.02)


def test_a_drifting_mean_is_told_and_does_not_hide_the_period():
    found = classify(t, sine() + 0.5 * np.sin(0.7 * t) + 0.1 * t)
    assert found.kind == "periodic"
    assert found.frequency == pytest.approx(3.0, rel=1e-3)
    assert found.mean_drift > 0.5
    assert any("mean drifts" in remark for remark in found.remarks)


def test_a_soft_start_is_a_transient():
    found = classify(t, np.minimum(t / 3, 1) * sine())
    assert found.kind == "periodic"
    assert found.steady[0] == pytest.approx(3.0, abs=0.34)
    assert found.steady_cycles == pytest.approx(21, abs=1)
    assert any("not steady yet" in remark for remark in found.remarks)


def test_an_amplitude_that_never_settles_is_told():
    found = classify(t, np.exp(-t / 3) * sine(1.0))
    assert found.kind == "periodic"
    assert found.steady is None
    assert found.amplitude_change > 1
    assert "no two cycles are alike" in found.remarks[0]


@pytest.mark.parametrize("order", [2, 3])
def test_the_period_is_that_of_the_whole_wave_not_of_its_strongest_harmonic(order):
    found = classify(t, 0.3 * sine(2.0) + sine(2.0 * order) + noise(0.01))
    assert found.kind == "periodic"
    assert found.frequency == pytest.approx(2.0, rel=1e-3)


def test_gaps_cost_cycles_but_not_the_verdict():
    x = sine(2.0)
    x[(t > 4) & (t < 4.6)] = np.nan
    found = classify(t, x)
    assert found.kind == "periodic"
    assert found.steady_cycles == 20
    assert any("gaps" in remark for remark in found.remarks)


@pytest.mark.parametrize("shape", [np.sign, np.arcsin, lambda s: np.clip(s, -0.4, 0.4), lambda s: np.abs(s) ** 3])
def test_the_form_of_the_wave_does_not_matter(shape):
    assert classify(t, shape(sine(2.0)) + noise(0.002)).kind == "periodic"


def test_repeated_triangles_are_periodic_and_a_single_one_is_half_a_cycle():
    triangle = np.abs((t + 1.0) % 2.0 - 1.0)
    assert classify(t, triangle).kind == "periodic"
    assert classify(t, triangle).cycles == 5
    one = classify(t[:1000], triangle[:1000] + noise(1e-3)[:1000])
    assert one.kind == "half_cycle"
    assert one.strokes == 2
    assert one.remarks == ()


def test_half_a_cycle_may_have_a_hold_and_come_back_in_part():
    found = classify(t, np.clip(np.minimum(t - 1, 8.0 - t), 0.4, 2))
    assert found.kind == "half_cycle"
    assert found.still_before == pytest.approx(1.4, abs=0.05)
    partly = classify(t, np.interp(t, [0, 5, 10], [0, 2, 0.6]))
    assert partly.kind == "half_cycle"
    assert "70 %" in partly.remarks[0]


def test_a_ramp_has_one_stroke():
    assert classify(t, 0.2 * t + noise(0.005)).kind == "ramp"
    assert classify(t, np.clip(t - 4, 0, 3)).still_before == pytest.approx(4, abs=0.05)


@pytest.mark.parametrize("cycles", [1.0, 1.4])
def test_a_single_cycle_is_periodic_with_one_cycle(cycles):
    inside = t <= 2.0 * cycles
    found = classify(t[inside], np.sin(np.pi * t[inside]))
    assert found.kind == "periodic"
    assert found.cycles == 1
    assert found.frequency == pytest.approx(0.5, rel=0.05)


def test_a_sweep_is_told_with_its_range():
    found = classify(t, np.sin(2 * np.pi * (2 * t + 0.5 * t**2)) * (1 + 0.3 * np.sin(t)))
    assert found.kind == "sweep"
    assert found.band[0] == pytest.approx(2.5, abs=0.6)
    assert found.band[1] == pytest.approx(11.5, abs=0.6)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("band", [(0.5, 40.0), (4.0, 6.0), (4.5, 5.5)])
def test_band_limited_noise_is_not_periodic(seed, band):
    sections = butter(2, band, "band", fs=500.0, output="sos")
    x = sosfilt(sections, np.random.default_rng(seed).normal(size=2 * t.size))[t.size :]
    assert classify(t, x).kind == "non_periodic"


def test_noise_sampled_near_its_band_is_motion_not_stillness():
    sections = butter(6, 50.0, fs=150.0, output="sos")
    x = sosfilt(sections, np.random.default_rng(0).normal(size=4000))[500:]
    assert classify(np.arange(x.size) / 150.0, x).kind == "non_periodic"


@pytest.mark.parametrize("x", [np.full(t.size, 3.0), noise(1.0)])
def test_nothing_but_noise_is_still(x):
    found = classify(t, x)
    assert found.kind == "still"
    assert found.still_before == pytest.approx(t[-1])


def test_a_known_noise_decides():
    assert classify(t, sine(amplitude=0.01), noise=0.01).kind == "still"
    assert classify(t, sine(amplitude=0.01), noise=0.0001).kind == "periodic"


def test_every_verdict_gives_its_numbers():
    assert "30 whole cycles of 3 Hz" in classify(t, sine()).reason
    assert "without a common period" in classify(t, np.cumsum(noise(1.0))).reason
    with pytest.raises(InputError, match="8 are needed"):
        classify(t[:5], t[:5])


def test_turning_points_ignore_reversals_below_the_height():
    x = np.sin(2 * np.pi * 0.5 * t) + noise(0.02)
    assert turning_points(x, 0.5).size == 11  # ten half cycles of full stroke, quarter strokes at both ends
    assert turning_points(np.zeros(5), 0.1).size == 0


def test_cycles_correct_a_frequency_that_is_slightly_wrong():
    cycles = cut(t, sine(3.0), 0.0, t[-1], 3.02)
    assert 1 / cycles.period == pytest.approx(3.0, rel=1e-5)
    assert cycles.similarity == pytest.approx(1.0, abs=1e-6)


def test_long_records_are_classified_too():
    long = np.arange(0, 400, 5e-4)
    found = classify(long, np.sin(2 * np.pi * 5.0 * long))
    assert (found.kind, found.cycles) == ("periodic", 2000)
