import numpy as np
import pytest
from scipy.signal import csd
from scipy.signal import welch as reference

from pipeline.errors import InputError
from pipeline.signals.periodogram import block_means, strongest_line
from pipeline.signals.spectra import hum, near_mains, welch


def test_spectra_are_those_of_scipy():
    rng = np.random.default_rng(0)
    x = rng.normal(size=5000)
    y = np.convolve(x, [0.2, 0.5, 0.1], "same") + 0.1 * rng.normal(size=5000)
    found = welch(x, y, 20.0, 256)
    np.testing.assert_allclose(found.pxx, reference(x, 20.0, nperseg=256)[1], rtol=1e-10)
    np.testing.assert_allclose(found.pxy, csd(x, y, 20.0, nperseg=256)[1], rtol=1e-10)


def test_power_spectrum_integrates_to_the_variance():
    x = np.random.default_rng(1).normal(size=20_000)
    found = welch(x, x, 100.0, 512)
    assert found.pxx.sum() * (found.frequency[1]) == pytest.approx(x.var(), rel=0.02)


def test_coherence_of_independent_signals_stays_below_the_threshold():
    rng = np.random.default_rng(2)
    above = []
    for _ in range(100):
        found = welch(rng.normal(size=1500), rng.normal(size=1500), 20.0, 256)
        above.append(found.coherence[2:-2] > found.coherence_threshold())
    assert np.mean(above) == pytest.approx(0.05, abs=0.01)


def test_threshold_of_eleven_segments_is_the_published_one():
    found = welch(np.random.default_rng(3).normal(size=128 * 12), np.zeros(128 * 12), 20.0, 256)
    assert found.coherence_threshold() == pytest.approx(0.273, abs=0.002)


def test_segments_with_gaps_are_left_out():
    x = np.random.default_rng(4).normal(size=4000)
    broken = x.copy()
    broken[1000] = np.nan
    assert np.isfinite(welch(broken, x, 1.0, 200).pxx).all()
    assert welch(broken, x, 1.0, 200).averages < welch(x, x, 1.0, 200).averages
    with pytest.raises(InputError, match="gap"):
        welch(np.full(100, np.nan), x[:100], 1.0, 50)
    with pytest.raises(InputError, match="no segment"):
        welch(x[:20], x[:20], 1.0, 50)


def test_hum_is_measured_and_its_absence_too():
    t = np.arange(20_000) / 5000
    noise = np.random.default_rng(5).normal(size=t.size)
    lines = hum(t, noise + 0.3 * np.sin(2 * np.pi * 49.98 * t))
    assert [line.present for line in lines] == [True, False, False]
    assert lines[0].amplitude == pytest.approx(0.3, abs=4 * lines[0].noise)
    assert lines[0].noise == pytest.approx(2 / np.sqrt(t.size), rel=0.3)
    assert hum(np.arange(200) / 60.0, np.zeros(200)) == []  # 50 Hz cannot be seen at 60 Hz


def test_harmonics_near_the_mains_are_marked():
    marked = near_mains(15.0 * np.arange(1, 11), 4.0)
    assert np.flatnonzero(marked).tolist() == [9]  # order 10 is 150 Hz


def test_block_means_drop_blocks_across_a_gap():
    t = np.r_[np.arange(10.0), 100 + np.arange(10.0)]
    times, values = block_means(t, 2 * t, 4)
    assert np.array_equal(values, 2 * times)
    assert times.tolist() == [1.5, 5.5, 103.5, 107.5]


@pytest.mark.parametrize("cycles", [1.2, 3.7, 25.0, 1234.5])
def test_strongest_line_is_good_to_a_tenth_of_the_resolution(cycles):
    t = np.linspace(5, 7, int(20 * cycles) + 50)
    x = np.cos(np.pi * cycles * (t - 5) + 1) + 0.4 * t
    assert strongest_line(t, x) * 2 == pytest.approx(cycles, abs=0.2)
