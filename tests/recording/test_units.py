"""Units as labs write them become SI; what is no unit, or of another dimension, is answered with what is known."""

from __future__ import annotations

import math

import pytest

from pipeline.errors import InputError
from pipeline.recording.units import conversion, is_unit, quantity


@pytest.mark.parametrize(
    ("unit", "value", "si", "name"),
    [
        ("kN", 2.0, 2000.0, "N"),
        ("[mm]", 5.0, 5e-3, "m"),
        ("(µm)", 3.0, 3e-6, "m"),
        ("m/s²", 1.0, 1.0, "m/s^2"),
        ("m/s2", 1.0, 1.0, "m/s^2"),
        ("Nm", 1.0, 1.0, "N m"),
        ("N·s/m", 4.0, 4.0, "N s/m"),
        ("°C", 20.0, 293.15, "K"),
        ("℃", 20.0, 293.15, "K"),
        ("%", 5.0, 0.05, "1"),
        ("-", 5.0, 5.0, "1"),
        ("G", 1.0, 1e-4, "T"),
        ("U/min", 60.0, 2 * math.pi, "rad/s"),
        ("毫米", 1.0, 1e-3, "m"),
        ("mmHg", 1.0, 133.322387415, "Pa"),
        ("N/mm", 1.0, 1e3, "N/m"),
    ],
)
def test_a_unit_as_found_becomes_si(unit: str, value: float, si: float, name: str) -> None:
    found = conversion(unit)
    assert found(value) == pytest.approx(si, rel=1e-12)
    assert found.unit == name


@pytest.mark.parametrize(
    ("unit", "si_unit", "factor"),
    [
        ("rpm", "Hz", 1 / 60),
        ("Hz", "rad/s", 2 * math.pi),
        ("1/min", "rad/s", 2 * math.pi / 60),
        ("deg", "rad", math.pi / 180),
    ],
)
def test_a_cycle_is_two_pi_whichever_way_a_rate_is_declared(unit: str, si_unit: str, factor: float) -> None:
    assert conversion(unit, si_unit)(1.0) == pytest.approx(factor, rel=1e-12)


def test_c_is_celsius_where_a_temperature_is_wanted_and_the_coulomb_elsewhere() -> None:
    assert conversion("C", "K")(25.0) == pytest.approx(298.15)
    assert conversion("C").unit == "C"


@pytest.mark.parametrize("text", ["furlogs", "9**9**9**9", "m^99", "m" * 100, "__import__('os')", "1e400 m"])
def test_what_is_no_unit_is_refused_at_once(text: str) -> None:
    assert not is_unit(text)
    with pytest.raises(InputError, match=r"log\.csv, channel 'x': unknown unit"):
        conversion(text, "m", "log.csv, channel 'x'")


def test_a_unit_of_another_dimension_is_answered_with_those_that_fit() -> None:
    with pytest.raises(InputError, match=r"'kN' does not measure the same as 'm'. Units that do: m, cm, mm"):
        conversion("kN", "m")


def test_quantities_carry_their_unit_or_are_si() -> None:
    assert quantity("52 kN", "N") == 52e3
    assert quantity("0,4 mm", "m") == pytest.approx(4e-4)
    assert quantity("−3", "N") == -3
    assert quantity(7, "N") == 7.0
    with pytest.raises(InputError, match="is not a number with a unit"):
        quantity("thick", "m")


@pytest.mark.parametrize(
    ("unit", "si", "factor"),
    [("mil", "m", 25.4e-6), ("g", "m/s^2", 9.80665), ("mg", "m/s^2", 9.80665e-3), ("g", "kg", 1e-3)],
)
def test_a_symbol_with_two_meanings_means_what_the_channel_measures(unit: str, si: str, factor: float) -> None:
    assert conversion(unit, si).factor == pytest.approx(factor)


@pytest.mark.parametrize("unit", ["m^3/(s Pa)", "[m^3/(s Pa)]", "(m^3/(s Pa))"])
def test_brackets_that_belong_to_a_unit_are_told_from_those_about_it(unit: str) -> None:
    assert conversion(unit, "m^3/(s Pa)").factor == pytest.approx(1.0)
