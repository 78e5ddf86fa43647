"""Digits that the uncertainty warrants, units for reading, columns that align."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.findings.figures import Column, Table
from pipeline.report.numbers import (
    aligned,
    aligned_readings,
    alike,
    fixed,
    plain,
    range_of,
    reading,
    warranted_decimals,
)
from pipeline.report.reading_units import reading_unit, size_of, spelt, typical
from pipeline.report.table import table_view


@pytest.mark.parametrize(
    ("value", "error", "size", "shown"),
    [
        (260_041.7, 347.0, 1e3, "260.04 ± 0.35"),
        (60.3e-6, 1.6e-6, 1e-6, "60.3 ± 1.6"),
        (-0.004, 0.5, 1.0, "0.00 ± 0.50"),  # never minus zero
        (12.0, 480.0, 1.0, "10 ± 480"),  # smaller than its error
        (0.0, 1.2e-6, 1e-6, "0.0 ± 1.2"),
        (0.0996, 0.0996, 1.0, "0.10 ± 0.10"),  # rounding carries into a new digit
        (99.96, 0.996, 1.0, "100.0 ± 1.0"),
        (-1234567.0, 2300.0, 1.0, "−1\u202f234\u202f600 ± 2300"),
        (0.004, 0.0006, 1.0, "0.00400 ± 0.00060"),
        (1e-9, 1e-10, 1.0, "1.00×10⁻⁹ ± 0.10×10⁻⁹"),
        (1e12, 1e9, 1.0, "1.0000×10¹² ± 0.0010×10¹²"),
        (1.4, 0.0, 1.0, "1.4 ± 0"),  # held: exact
        (1e5, 1e-9, 1.0, "100\u202f000.000 ± 1×10⁻⁹"),  # digits end where doubles do
        (3.14159265, None, 1.0, "3.142"),
        (0.0, None, 1.0, "0"),
        (123_456.0, None, 1.0, "123\u202f456"),  # whole digits are not rounded away without an error
        (9.9999e-7, None, 1.0, "1×10⁻⁶"),
        (math.nan, 1.0, 1.0, "–"),
    ],
)
def test_a_number_is_written_to_two_digits_of_its_error(value, error, size, shown):
    assert str(reading(value, error, size=size)) == shown


def test_an_asymmetric_interval_keeps_its_asymmetry():
    found = reading(3.0, None, (2.91, 3.62))
    assert (found.low, found.high) == ("2.910", "3.620")
    assert found.error == ""


def test_an_interval_that_ends_at_a_bound_needs_no_error():
    assert reading(0.5, None, (0.5, 0.9)).interval == "0.50 … 0.90"


def test_an_unbounded_interval_says_so():
    assert reading(2.0, 0.1, (-math.inf, math.inf)).interval == "−∞ … ∞"


@given(
    st.floats(-1e15, 1e15, allow_nan=False),
    st.floats(1e-12, 1e12, allow_nan=False),
)
def test_what_is_written_is_within_a_twentieth_of_the_error(value, error):
    shown = reading(value, error)
    text = shown.value.replace("−", "-").replace("\u202f", "")
    number, _, power = text.partition("×10")
    exponent = int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
    decimals = len(number.partition(".")[2])
    last_digit = 10.0 ** (exponent - decimals)
    written = float(number) * 10.0**exponent
    limit = max(0.0500001 * 10 ** math.floor(math.log10(error) + 1e-9) * 1.1, 0.5000001 * last_digit)
    assert abs(written - value) <= limit + 1e-9 * abs(value)


@pytest.mark.parametrize(("error", "decimals"), [(1.0, 1), (0.35, 2), (0.0996, 2), (99.6, -1), (1000.0, -2), (1e-7, 8)])
def test_two_significant_digits_of_the_error_decide(error, decimals):
    assert warranted_decimals(error) == decimals


def test_decimal_points_stand_under_each_other():
    texts = aligned(["1.25", "−30", "4.5", "not determined", "1\u202f234.5"])
    widths = [
        len(text) - (text.index(".") if "." in text else text.index("\u2008")) for text in texts if text[0] != "n"
    ]
    assert len(set(widths)) == 1
    assert texts[3] == "not determined"


def test_errors_of_a_column_align_too():
    column = aligned_readings([reading(1.0, 0.12), reading(20.0, 12.0), None])
    assert column[0] == "1.00 ± \u20070.12"
    assert column[1].startswith("20\u2008\u2007\u2007 ± 12\u2008")
    assert column[2] == ""


def test_fixed_and_plain_cope_with_infinity():
    assert fixed(-math.inf, 2) == "−∞"
    assert plain(math.inf) == "–"


@pytest.mark.parametrize(
    ("unit", "magnitude", "name"),
    [
        ("m", 0.4e-3, "mm"), ("m", 40e-6, "µm"), ("m", 1.8, "m"), ("s", 60e-6, "µs"), ("s", 0.5, "s"),
        ("N/m", 2.6e5, "kN/m"), ("N/m", 330.0, "N/m"), ("N s/m", 1200.0, "kN·s/m"), ("Pa", 0.66e6, "MPa"),
        ("N m/rad", 2e3, "kN·m/rad"), ("rad", 0.5, "°"), ("rad", 1e-3, "mrad"), ("1", 0.21, ""), ("1/m", 4000.0, "1/mm"),
        ("m^2", 1.96e-3, "mm²"), ("kg m^2", 2e-4, "kg·cm²"), ("kg/m^3", 7800.0, "kg/m³"), ("N", 0.0, "N"),
        ("ohm", 4.7e3, "kΩ"), ("m/s^2", 9.81, "m/s²"), ("N/m^3", 4.2e10, "GN/m³"), ("count", 300.0, "counts"),
        ("%", 0.02, "%"), ("%", 0.0, "%"), ("1", 3e-7, "×10⁻⁹"), ("kg^2/K", 5e9, "10⁹ kg²/K"), ("V", float("nan"), "V"),
    ],
)  # fmt: skip
def test_the_unit_for_reading_follows_the_magnitude(unit, magnitude, name):
    assert reading_unit(unit, magnitude).name == name


@given(st.sampled_from(["m", "s", "N/m", "rad", "kg m^2", "1", "m^3/s", "A^2 s"]), st.floats(1e-20, 1e20))
def test_a_number_in_its_unit_for_reading_is_short(unit, magnitude):
    shown = reading_unit(unit, magnitude)
    assert 1e-3 * 0.999 <= magnitude / shown.size < 1e6 * 1.001


def test_an_angle_becomes_degrees_exactly():
    assert math.pi / reading_unit("rad", math.pi).size == pytest.approx(180, rel=1e-15)


def test_units_are_printed_as_engineers_write_them():
    assert [spelt(unit) for unit in ("N s/m", "kg m^2", "m^-1", "1", "N m s/rad")] == [
        "N·s/m", "kg·m²", "m⁻¹", "", "N·m·s/rad",
    ]  # fmt: skip


def test_a_zero_is_as_large_as_its_uncertainty():
    assert size_of(0.0, None, (0.0, 7.3e-5)) == 7.3e-5
    assert size_of(0.0, 2e-6, (-1.0, 1.0)) == 2e-6
    assert size_of(3.0, 20.0) == 20.0
    assert size_of(None) == 0.0


def test_the_typical_size_ignores_what_is_missing():
    assert typical([None, 0.0, math.nan, -3.0, 5.0, 4.0]) == 4.0
    assert typical([None, 0.0]) == 0.0


def test_numbers_that_come_written_stand_as_numbers_with_their_unit_in_the_heading():
    rows = [["0 A", "+0.25 ± 0.20 %", "3 %"], ["10.5 A", "−12.1 ± 4.0 %", "1 K"], [None, "", "off"]]
    view = table_view(Table("t", "t", "", [Column("current"), Column("found"), Column("limit")], rows))
    assert [(head.unit, head.number) for head in view.heads] == [("A", True), ("%", True), ("", False)]
    current, found, limit = zip(*view.rows, strict=True)
    assert [cell.text for cell in current] == ["0\u2008\u2007", "10.5", "–"]
    assert [cell.text for cell in found] == ["+0.25 ± 0.20", "−12.1\u2007 ± 4.0\u2007", "–"]
    assert {cell.kind for cell in (*current[:2], *found[:2])} == {"number"}
    assert [cell.text for cell in limit] == ["3 %", "1 K", "off"]


def test_what_was_rounded_keeps_its_decimals():
    assert alike([44.88, 0.1, 0.0]) == ["44.88", "0.10", "0.00"]
    assert alike([44.88, 0.0123]) is None


def test_a_range_has_the_same_decimals_at_both_ends():
    assert range_of([0.42, 0.376, 0.4]) == "0.376 … 0.420"
    assert range_of([1.5, 0.782]) == "0.782 … 1.500"
    assert range_of([3.0, 3.0]) == "3"
    assert range_of([1.23456e-3, 45.678]) == "0.00123 … 45.7", "too far apart for that"
