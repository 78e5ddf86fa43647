import numpy as np
import pytest

from pipeline.estimation.residuals import chi_square, normality, runs_test, whiteness

CHECKS = (runs_test, whiteness, normality)


@pytest.mark.parametrize("check", CHECKS)
def test_white_normal_noise_passes_but_for_one_in_a_hundred(check):
    rng = np.random.default_rng(0)
    p = np.array([check(rng.normal(size=300)).p_value for _ in range(400)])
    assert np.mean(p < 0.01) <= 0.03
    assert np.mean(p < 0.5) == pytest.approx(0.5, abs=0.1)  # p-values are uniform where nothing is wrong


@pytest.mark.parametrize("check", [runs_test, whiteness])
def test_a_missed_slow_part_fails(check):
    rng = np.random.default_rng(1)
    found = check(rng.normal(size=300) + np.sin(np.linspace(0, 12, 300)))
    assert not found.passed
    assert found.p_value < 1e-4


def test_runs_statistic_against_the_closed_form():
    residual = np.tile([1.0, 2.0, -1.0, -2.0], 10)  # 20 above, 20 below, 20 runs
    expected, spread = 21.0, np.sqrt(20 * 19 / 39)
    assert runs_test(residual).statistic == pytest.approx((20 - expected) / spread)


def test_oscillation_from_sample_to_sample_is_told_apart_from_a_slow_part():
    assert "oscillates" in runs_test(np.tile([1.0, -1.1], 100) + 1e-6 * np.arange(200)).verdict
    assert "misses a slow part" in runs_test(np.linspace(-1, 1, 100)).verdict


def test_whiteness_tells_how_many_samples_count():
    slow = np.repeat(np.random.default_rng(2).normal(size=100), 20)
    assert "2000 samples count as" in whiteness(slow).verdict


def test_chi_square_fails_on_both_sides():
    assert chi_square(103.0, 100).passed
    high, low = chi_square(400.0, 100), chi_square(25.0, 100)
    assert not high.passed
    assert "2 times the noise" in high.verdict
    assert not low.passed
    assert "overstated" in low.verdict


def test_shape_of_the_distribution_is_named():
    rng = np.random.default_rng(3)
    assert "lopsided" in normality(rng.exponential(size=500)).verdict
    assert "heavy-tailed" in normality(rng.standard_t(3, size=800)).verdict
    assert "flat" in normality(np.sin(np.linspace(0, 100, 800))).verdict


@pytest.mark.parametrize("check", CHECKS)
def test_too_few_residuals_are_not_judged(check):
    found = check(np.array([1.0, np.nan, 2.0]))
    assert found.passed
    assert np.isnan(found.p_value)
    assert "not tested" in found.verdict
    assert "not tested" in chi_square(0.0, 0).verdict


@pytest.mark.parametrize("check", CHECKS)
def test_gaps_in_the_residual_are_closed_up(check):
    residual = np.random.default_rng(4).normal(size=200)
    residual[50:60] = np.nan
    assert check(residual).passed
