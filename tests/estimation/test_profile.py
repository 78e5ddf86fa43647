import math

import numpy as np
import pytest

from pipeline.estimation.least_squares import Unknown, fit
from pipeline.estimation.profile import profile_interval


def test_a_parabola_gives_the_textbook_interval_in_few_refits():
    calls = []

    def misfit(a):
        calls.append(a)
        return 7.0 + ((a - 3.0) / 0.2) ** 2

    found = profile_interval(misfit, 3.0, 7.0, 0.2)
    assert (found.low, found.high) == pytest.approx((3 - 1.96 * 0.2, 3 + 1.96 * 0.2), abs=1e-4)
    assert (found.low_side, found.high_side) == ("closed", "closed")
    assert len(calls) <= 6


@pytest.mark.parametrize("guess", [0.002, 20.0])
def test_a_wrong_standard_error_only_costs_refits(guess):
    found = profile_interval(lambda a: ((a - 3.0) / 0.2) ** 2, 3.0, 0.0, guess, reach=1e4)
    assert (found.low, found.high) == pytest.approx((2.608, 3.392), abs=1e-3)


def test_a_lopsided_valley_gives_a_lopsided_interval():
    found = profile_interval(lambda a: (math.log(a) / 0.5) ** 2, 1.0, 0.0, 0.5, low=1e-6)
    assert found.low == pytest.approx(math.exp(-0.98), rel=1e-3)
    assert found.high == pytest.approx(math.exp(0.98), rel=1e-3)


def test_noise_that_was_estimated_scales_the_rise_and_uses_student():
    found = profile_interval(lambda a: 4.0 * (a - 1.0) ** 2, 1.0, 0.0, 1.0, dof=4, scale=4.0)
    assert found.high == pytest.approx(1 + 2.776, abs=1e-3)


def test_a_bound_ends_one_side():
    found = profile_interval(lambda a: (a - 0.1) ** 2 / 0.04, 0.1, 0.0, 0.2, low=0.0)
    assert (found.low, found.low_side, found.high_side) == (0.0, "bound", "closed")


def test_an_optimum_on_its_bound_has_a_one_sided_interval():
    found = profile_interval(lambda a: 1.0 + 3 * a, 0.0, 1.0, math.nan, low=0.0)
    assert (found.low, found.low_side) == (0.0, "bound")
    assert found.high == pytest.approx(1.96**2 / 3, rel=1e-3)


def test_a_flat_side_is_open():
    found = profile_interval(lambda a: 3.0 * (1 - math.exp(-a)) if a > 0 else a**2 * 100, 0.0, 0.0, 0.1)
    assert (found.high, found.high_side) == (math.inf, "open")
    assert found.low_side == "closed"


def test_a_refit_that_gives_up_ends_cleanly():
    def misfit(a):
        if a > 1.5:
            raise ArithmeticError("no solution")
        return (a / 1.0) ** 2

    found = profile_interval(misfit, 0.0, 0.0, 1.0)
    assert (found.high, found.high_side) == (math.inf, "failed")
    assert found.low == pytest.approx(-1.96, abs=1e-3)


def test_a_better_optimum_on_the_way_is_told():
    found = profile_interval(lambda a: (a - 1.0) ** 2 / 0.04, 0.5, 6.25, 0.2)  # a search that stopped early
    assert found.better is not None
    assert found.better > 0.8


def test_coverage_where_the_covariance_fails():
    """Two decays that are nearly one: the linear interval of the ratio misses, the profile holds."""
    rng = np.random.default_rng(0)
    x = np.linspace(0.1, 3, 25)
    truth = 2.0
    hits = []
    for _ in range(60):
        y = np.exp(-x) * truth / (truth + x) + 0.02 * rng.normal(size=x.size)

        def misfit(b, y=y):
            column = np.exp(-x) / (b + x)
            return float(((y - column * (column @ y) / (column @ column)) ** 2).sum() / 0.02**2)

        found = fit(
            lambda p, y=y: (p["a"] * np.exp(-x) / (p["b"] + x) - y) / 0.02,
            [Unknown("a", 2.0), Unknown("b", 2.0, 1e-2, 1e4, logarithmic=True)],
            noise="known",
        )
        interval = profile_interval(
            misfit, found.values["b"], found.chi2, found.std_error["b"], low=1e-2, high=1e4, reach=1e5
        )
        hits.append(interval.low < truth < interval.high)
    assert np.mean(hits) >= 0.88  # 95 % less 2.5 standard deviations of 60 trials
