"""Captions of the tire's reports answer from the tables that they stand under, also where these are bad or empty."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from pipeline.findings import Parameter
from pipeline.rigs.in_words import chance, known, span, times_noise
from pipeline.rigs.tire.bench import captions as bench
from pipeline.rigs.tire.road import captions as road


def test_chances_and_misfits_have_no_powers_of_ten() -> None:
    assert [chance(p) for p in (1.2e-5, 1e-3, 0.98, 0.999, math.nan)] == [
        "less than 1 in 10\u00a0000", "0.1 %", "98 %", "more than 99 %", "",
    ]  # fmt: skip
    assert times_noise(1e6) == "1000 times the noise"
    length = Parameter(name="L", symbol="L", value=0.31711, std_error=2e-5, ci95=(0.31707, 0.31714), unit="m")
    assert known(length, 1e-3, "mm") == "317.110 mm (95 %: 317.070 to 317.140 mm)"
    assert known(None, 1.0, "m") == ""
    assert [span([1.0, 1.04], 1), span([-0.01], 1), span([math.nan], 1)] == ["1.0", "0.0", "unknown"]


def runs(chi2: list[float]) -> pd.DataFrame:
    return pd.DataFrame({"load": [1e3, 1.5e3, 2e3, 2.5e3, 3e3], "rotation": 8.8, "chi2_reduced": chi2})


def test_a_misfit_that_rises_with_load_is_told_to_rise() -> None:
    assert bench.grows_with(runs([1.02, 1.04, 1.0, 1.01, 0.98])).startswith("Not with load: it is 0.98 to 1.04.")
    assert bench.grows_with(runs([1.0, 2.1, 4.2, 6.0, 9.3])).startswith("Yes, with load:")
    assert bench.grows_with(runs([1.0] * 5).head(2)).startswith("Too few loads")


def test_an_order_that_is_missed_ends_what_the_prediction_holds() -> None:
    orders = pd.DataFrame({"order": [2, 3, 4, 5], "measured": 1.0, "predicted": [1.0, 0.99, 0.8, 1.0]})
    assert bench.holds_up_to(orders).startswith("Up to order 3: within 10 %")
    assert bench.holds_up_to(orders.assign(predicted=0.5)).startswith("At no order")
    assert bench.holds_up_to(orders.assign(predicted=1.02)).startswith("Up to order 5, the highest")


def test_loads_read_back_outside_of_their_intervals_are_counted() -> None:
    table = pd.DataFrame({
        "load": [1e3, 2e3, 2e3], "read_load": [1001.0, 1998.0, 1960.0], "read_low": [990.0, 1990.0, 1950.0],
        "read_high": [1010.0, 2005.0, 1970.0], "used": [True, True, False],
    })  # fmt: skip
    assert bench.read_back(table) == (
        "Runs in the calibration come back within 2.0 N, the others within 40 N; 2 of 3 intervals hold the load cell's reading."
    )


def test_a_filter_whose_mean_a_few_jumps_make_is_called_too_wide() -> None:
    rng = np.random.default_rng(1)
    true = rng.standard_normal(2000) ** 2
    assert "too wide" not in road.consistent({"load": true}, {"load": 1.0})
    assert "too wide" in road.consistent({"load": np.r_[np.full(99, 0.01), 99.0]}, {"load": 1.0})
    assert road.consistent({}, {}) == "No track is told."


def test_a_waveform_off_the_ring_and_dips_that_do_not_follow_are_told() -> None:
    angle = np.linspace(-3, 3, 101)
    good = pd.DataFrame({"residual": 1e-4 * np.sin(9 * angle), "std_error": 1e-3, "signal": np.exp(-(angle**2))})
    assert road.fits_ring(good).startswith("Yes")
    assert road.fits_ring(good.assign(residual=0.1)).startswith("No")
    dips = pd.DataFrame({"force": [-900.0, 0.0, 10.0, 900.0], "asymmetry": [-450.0, 1.0, 4.0, 451.0]})
    ring = pd.DataFrame({"force": [-1e3, 1e3], "asymmetry": [-480.0, 480.0]})
    assert "A grows by 0.50" in road.deepened(dips, ring)
    assert "by the ring 0.480" in road.deepened(dips, ring)
    assert road.deepened(dips.assign(asymmetry=[5.0, -4.0, 3.0, 1.0]), ring).startswith("A does not grow")
    assert road.deepened(dips.assign(force=0.0), ring) == "One force does not tell."
