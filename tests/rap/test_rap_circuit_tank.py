"""Tank, housing, membrane, battery and sensor pair against closed forms and the sheet's numbers (rap.md, 3.2, 3.6-3.8, 3.11)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.rigs.rap.circuit.battery import current, energy_used, open_circuit_voltage, runtime
from pipeline.rigs.rap.circuit.membrane import T_REF, coefficient, water_viscosity
from pipeline.rigs.rap.circuit.sensor_pair import bench_time, device_over_bench, device_time
from pipeline.rigs.rap.circuit.tank import (
    Tank,
    distance_from_height,
    floor_margin,
    height_from_distance,
    sound_speed,
    up_vector,
)
from pipeline.rigs.rap.circuit.thermal import housing_temperature

TANK = Tank()


def tilted(pitch: float, roll: float) -> np.ndarray:
    return up_vector(np.array([[math.tan(math.radians(pitch)), math.tan(math.radians(roll)), 1.0]]))


def test_tank_of_the_sheet_holds_2_2_litres_and_a_millimetre_is_8_5_millilitres() -> None:
    assert TANK.capacity == pytest.approx(2.2e-3, rel=1e-3)
    assert TANK.area * 1e-3 == pytest.approx(8.46e-6, rel=1e-3)
    assert TANK.area * TANK.blind == pytest.approx(84.6e-6, rel=1e-3)


def test_surface_is_a_plane_through_the_centroid_whatever_the_tilt() -> None:
    # The point of the surface under the sensor, found from the plane itself.
    for pitch, roll in ((0.0, 0.0), (5.0, 0.0), (-7.0, 4.0)):
        n, h = tilted(pitch, roll), 0.1
        below = h - (n[0, 0] * TANK.dx + n[0, 1] * TANK.dy) / n[0, 2]
        D = (TANK.z - below) * sound_speed(TANK.reference) / sound_speed(300.0)
        assert height_from_distance(TANK, D, n, 300.0)[0] == pytest.approx(h, abs=1e-12)


@pytest.mark.parametrize("echo", ["axis", "specular"])
def test_distance_undoes_height(echo: str) -> None:
    tank = replace(TANK, echo=echo)
    n = tilted(6.0, -3.0)
    D = distance_from_height(tank, 0.12, n, 301.0)
    assert height_from_distance(tank, D, n, 301.0)[0] == pytest.approx(0.12, abs=1e-12)


def test_specular_echo_is_shorter_by_the_cosine_of_the_tilt() -> None:
    n = tilted(10.0, 0.0)
    axis = distance_from_height(TANK, 0.1, n, 293.15)[0]
    specular = distance_from_height(replace(TANK, echo="specular"), 0.1, n, 293.15)[0]
    assert specular / axis == pytest.approx(math.cos(math.radians(10.0)))
    assert 1.0 - specular / axis == pytest.approx(0.015, abs=5e-4)


def test_sound_is_faster_in_warmer_air_as_the_sheet_reckons() -> None:
    share = float(sound_speed(303.15) / sound_speed(298.15)) - 1.0
    assert share == pytest.approx(0.0084, abs=5e-5)
    assert share * 0.2 * TANK.area == pytest.approx(14e-6, abs=0.5e-6)


def test_tilted_surface_cuts_the_floor_where_the_lower_edge_meets_it() -> None:
    leaning = tilted(10.0, 0.0)
    assert float(floor_margin(TANK, leaning)[0]) == pytest.approx(0.5 * TANK.Lx * math.tan(math.radians(10.0)))
    both = tilted(6.0, -4.0)
    lowest = 0.5 * (TANK.Lx * math.tan(math.radians(6.0)) + TANK.Ly * math.tan(math.radians(4.0)))
    assert float(floor_margin(TANK, both)[0]) == pytest.approx(lowest)
    assert float(floor_margin(TANK, tilted(0.0, 0.0))[0]) == 0.0


def test_housing_warms_by_all_but_a_share_e_within_the_time_constant() -> None:
    assert housing_temperature(0.0, 298.15, 303.15, 1200.0) == 298.15
    assert housing_temperature(1200.0, 298.15, 303.15, 1200.0) == pytest.approx(303.15 - 5.0 / math.e)


def test_membrane_resistance_grows_in_proportion_to_time() -> None:
    K = coefficient(np.array([0.0, T_REF, 2.0 * T_REF]), 2e-11, 0.25)
    assert np.allclose(np.diff(1.0 / K), 0.25 / 2e-11)


def test_viscosity_of_water_is_that_of_the_tables() -> None:
    for celsius, mPa_s in ((20.0, 1.002), (25.0, 0.890), (37.0, 0.692)):
        assert water_viscosity(celsius + 273.15) == pytest.approx(mPa_s * 1e-3, rel=3e-3)


def test_battery_gives_the_power_that_is_asked_for() -> None:
    rest = open_circuit_voltage(0.6)
    amperes = current(13.9, rest, 0.15)
    assert (rest - 0.15 * amperes) * amperes == pytest.approx(13.9)
    assert current(13.9, rest, 0.0) * rest == pytest.approx(13.9)
    assert energy_used(np.array([0.0, 10.0, 30.0]), np.array([13.9, 13.9, 13.9]))[-1] == pytest.approx(417.0)


@pytest.mark.parametrize(("efficiency", "hours"), [(1.0, 5.432), (0.90, 4.89), (0.85, 4.62)])
def test_battery_lasts_as_the_sheet_reckons(efficiency: float, hours: float) -> None:
    assert runtime(75.5 * 3600.0, efficiency, 13.9) / 3600.0 == pytest.approx(hours, abs=0.005)


def test_stamps_of_the_device_and_bench_time_undo_each_other() -> None:
    t_d = np.array([0.0, 100.0, 18000.0])
    t = bench_time(t_d, 3.37, 40e-6, 310.0)
    assert np.allclose(t, t_d + 3.37 + 40e-6 * (t - 310.0), atol=1e-9)
    assert np.allclose(device_time(t, 3.37, 40e-6, 310.0), t_d, atol=1e-9)


def test_pole_looks_like_a_lag_of_its_time_constant_at_low_frequency() -> None:
    omega = 2.0 * math.pi * 1e-3
    with_pole = device_over_bench(omega, 1.0, 0.030, 0.005, 0.0)
    assert -np.angle(with_pole) / omega == pytest.approx(0.025, rel=1e-6)
    assert np.angle(device_over_bench(omega, 1.0, 0.0, 0.0, 0.025)) / omega == pytest.approx(0.025)
