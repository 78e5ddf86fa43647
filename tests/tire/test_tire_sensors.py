"""Flex sensor, divider and PVDF film: eqs 3-4 and T6-T8, the sheet's voltages, marks of a waveform (tire.md, 3.3-3.5)."""

import numpy as np
import pytest

from pipeline.rigs.tire.ring.contact import compliance, pressed
from pipeline.rigs.tire.ring.pvdf import Film, film_over_flex, film_shape, high_pass, liner_strain, strain_from_voltage
from pipeline.rigs.tire.ring.ring import Ring, Shape, shape_of
from pipeline.rigs.tire.ring.sensor import (
    Sensor,
    averaging,
    divider_resistance,
    divider_voltage,
    flex_shape,
    highest_order,
    resistance,
    voltage_slope,
)
from pipeline.rigs.tire.ring.shape_lengths import lengths

R = 0.3171
RING = Ring(R=R, EI=6.0, p0b=46200.0, kw=6e5, kv=2e5, eta=0.08)
FLEX = Sensor(c=5000.0, R0=1e4, length=0.05, lag=1e-3)
LOADS = (1000.0, 1500.0, 2000.0, 2500.0, 3000.0)


@pytest.fixture(scope="module")
def voltages():
    """Peak and dips in volts of the truth tire by load, 10 km/h, without noise."""
    known, found = compliance(RING), {}
    for Fz in LOADS:
        shape = pressed(known, 1.2e8, 0.3266, Fz).shape
        marks = lengths(flex_shape(shape, FLEX, R, 10 / 3.6 / R), R)
        found[Fz] = divider_voltage(FLEX.R0 + np.array([marks.peak, marks.dip_leading, marks.dip_trailing]), 3.3, 1e4)
    return found


def test_peak_voltages_of_the_truth_tire_are_those_of_the_sheet(voltages):
    peaks = [voltages[Fz][0] for Fz in LOADS]
    assert peaks == pytest.approx([1.905, 2.000, 2.078, 2.142, 2.195], abs=5.5e-4)
    assert voltages[2000.0][1:] == pytest.approx([1.540, 1.547], abs=6e-4)


def test_peak_slope_is_the_papers_seventy_millivolt_per_fifty_kilogram(voltages):
    slope = (voltages[2500.0][0] - voltages[1500.0][0]) / 1000.0
    assert slope * 50.0 * 9.80665 * 1e3 == pytest.approx(69.9, abs=0.05)


def test_divider_and_its_inverse():
    assert resistance(np.array([1.0 / R]), 5000.0, 1e4) == pytest.approx([1e4 + 5000.0 / R])
    R2 = np.array([10.0, 3e3, 1e4, 4.7e4])
    V = divider_voltage(R2, 5.0, 2e4)
    assert V[2] == pytest.approx(5.0 / 3.0)
    assert divider_resistance(V, 5.0, 2e4) == pytest.approx(R2, rel=1e-12)
    step = 1e-3
    slope = (divider_voltage(R2 + step, 5.0, 2e4) - divider_voltage(R2 - step, 5.0, 2e4)) / (2 * step)
    assert voltage_slope(R2, 5.0, 2e4) == pytest.approx(slope, rel=1e-6)


def test_no_resistance_stands_behind_a_voltage_at_or_beyond_the_supply():
    assert np.isnan(divider_resistance(np.array([-0.1, 0.0, 3.3, 3.5, np.nan]), 3.3, 1e4)).all()


def test_a_flat_spot_is_bent_by_one_over_the_radius():
    assert pytest.approx(3.154, abs=5e-4) == 1.0 / R
    assert liner_strain(1.0 / R, 0.012) == pytest.approx(0.0189, abs=5e-5)


def test_orders_kept_reach_the_sheets_ninety_and_grow_for_a_short_sensor():
    assert highest_order(0.05, R) == 90
    assert highest_order(0.04, R) > 110
    # What is cut off changes the marks by less than the noise of an averaged waveform does.
    shape = pressed(compliance(RING), 1.2e8, 0.3266, 1000.0).shape
    whole = shape.times(averaging(shape.orders, 0.05, R))
    cut = whole.cut(highest_order(0.05, R))
    assert lengths(cut, R).peak == pytest.approx(lengths(whole, R).peak, rel=5e-4)
    assert lengths(cut, R).deformation == pytest.approx(lengths(whole, R).deformation, abs=1e-3)


def test_pvdf_inverse_gives_back_the_strain():
    rate, tau, G, mid = 12e3, 2e-3, 200.0, 1.65
    t = np.arange(6000) / rate
    eps = 4e-3 * np.sin(2 * np.pi * 7 * t) ** 3
    # The analogue high-pass, integrated far finer than it is sampled.
    fine = np.linspace(0.0, t[-1], 40 * (t.size - 1) + 1)
    strain = 4e-3 * np.sin(2 * np.pi * 7 * fine) ** 3
    low, step = np.zeros(fine.size), fine[1]
    for i in range(1, fine.size):
        low[i] = low[i - 1] + step / tau * (0.5 * (strain[i - 1] + strain[i]) - low[i - 1])
    V = (mid + G * (strain - low))[::40]
    found = strain_from_voltage(V, 1 / rate, G, tau, mid)
    assert found == pytest.approx(eps - eps[0], abs=2e-3 * np.abs(eps).max())


def test_pvdf_is_a_derivative_when_slow_and_strain_when_fast():
    n = np.array([1.0])
    assert high_pass(n, 1e-2, 2e-3) == pytest.approx(1j * 1e-2 * 2e-3, rel=1e-4)
    assert high_pass(n, 1e6, 2e-3) == pytest.approx(1.0, abs=1e-3)


def test_film_over_flex_is_the_ratio_of_what_each_makes_of_one_order():
    n, speed = np.arange(2, 33), 8.76
    k = pressed(compliance(RING, 1024), 1.2e8, 0.3266, 2000.0).shape
    flex, film = flex_shape(k, FLEX, R, speed), film_shape(k, Film(200.0, 0.03, 2e-3, 0.02), 0.012, R, speed)
    ratio = film_over_flex(
        n, speed, gain=200.0 * 0.012 / (2 * 5000.0), time_constant=2e-3, offset_angle=0.02, film_length=0.03,
        flex_length=0.05, flex_lag=1e-3, R=R,
    )  # fmt: skip
    assert ratio == pytest.approx((film.harmonics / np.where(flex.harmonics, flex.harmonics, 1.0))[n], rel=1e-9)


@pytest.mark.parametrize("turned", [0.0, 0.5, -2.9, 3.1])
def test_marks_of_a_cosine_stand_where_they_must_wherever_the_patch_is(turned):
    harmonics = np.zeros(9, dtype=complex)
    harmonics[4] = 1.5 * np.exp(-4j * turned)
    found = lengths(Shape(harmonics), R)
    assert found.peak == pytest.approx(3.0, rel=1e-6)
    # Four peaks alike: the first found is one of them, a quarter turn apart.
    off = (found.peak_angle - turned) / (np.pi / 2)
    assert off == pytest.approx(round(off), abs=1e-4)
    assert found.dip_leading == pytest.approx(-3.0, rel=1e-6)
    assert found.asymmetry == pytest.approx(0.0, abs=1e-6)
    assert found.deformation == pytest.approx(R * np.pi / 2, rel=1e-5)
    assert found.slope == pytest.approx(R * np.pi / 4, rel=1e-5)
    assert found.zero == pytest.approx(R * np.pi / 4, rel=1e-5)


def test_marks_of_sampled_values_turn_with_the_waveform():
    shape = pressed(compliance(RING, 1024), 1.2e8, 0.3266, 2000.0).shape
    _, values = shape.times(averaging(shape.orders, 0.05, R)).on_grid(1024)
    still = lengths(shape_of(values, 90), R)
    rolled = lengths(shape_of(np.roll(values, 300), 90), R)
    for name in ("peak", "dip_leading", "dip_trailing", "deformation", "slope", "zero"):
        assert getattr(rolled, name) == pytest.approx(getattr(still, name), rel=1e-4)
    assert rolled.peak_angle - still.peak_angle == pytest.approx(300 * 2 * np.pi / 1024, abs=1e-4)


def test_a_waveform_that_never_crosses_zero_has_no_zero_length():
    harmonics = np.zeros(9, dtype=complex)
    harmonics[0], harmonics[4] = 5.0, 0.5
    assert np.isnan(lengths(Shape(harmonics), R).zero)
