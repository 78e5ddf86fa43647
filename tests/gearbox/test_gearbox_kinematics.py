"""Teeth, speeds, orders and lossless torques of the planetary gearbox, in exact fractions (gearbox.md, 3.1-3.3)."""

from fractions import Fraction

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.rigs.gearbox.model.kinematics import (
    member_coefficients,
    member_speeds,
    mesh_orders,
    planet_speed_over_sun,
    ring_speed,
    sos_orders,
    sun_speed,
)
from pipeline.rigs.gearbox.model.statics import (
    carried_torque,
    carrier_force,
    dissipated_power,
    efficiency_locked,
    ground_torque,
    lossless_torques,
    planet_mesh_force,
)
from pipeline.rigs.gearbox.model.teeth import (
    TABLE_1,
    Teeth,
    Train,
    assembly_faults,
    contact_ratios,
    interference_warnings,
    smallest_pinion,
    teeth_of,
    tip_radius_limit,
)

OTHER = Teeth(Train(24, 18, 60), Train(30, 45, 120, planets=3))


def test_every_member_of_table_1_turns_by_exact_fractions_of_the_carriers():
    assert (TABLE_1.first.ratio, TABLE_1.second.ratio) == (Fraction(-5, 3), Fraction(-25, 3))
    assert member_coefficients(TABLE_1) == {
        "ring": (Fraction(-2, 5), Fraction(7, 5)),
        "sun": (Fraction(10, 3), Fraction(-7, 3)),
        "planet_1": (Fraction(-6), Fraction(7)),
        "planet_2": (Fraction(-10, 11), Fraction(21, 11)),
    }


@pytest.mark.parametrize("teeth", [TABLE_1, OTHER])
def test_locked_gearbox_turns_as_one_body(teeth):
    assert all(c1 + c2 == 1 for c1, c2 in member_coefficients(teeth).values())


@pytest.mark.parametrize(("rpm", "ring", "sun", "planet_1", "planet_2"), [
    (120, -48, 400, -720, -109.1), (210, -84, 700, -1260, -190.9),
])  # fmt: skip
def test_speeds_with_held_output_are_those_of_the_sheet(rpm, ring, sun, planet_1, planet_2):
    speeds = member_speeds(float(rpm), 0.0, TABLE_1)
    assert speeds["ring"] == pytest.approx(ring)
    assert speeds["sun"] == pytest.approx(sun)
    assert speeds["planet_1"] == pytest.approx(planet_1)
    assert speeds["planet_2"] == pytest.approx(planet_2, abs=0.05)


@pytest.mark.parametrize("teeth", [TABLE_1, OTHER])
def test_pitch_circles_roll_on_each_other_without_sliding(teeth):
    """Independent of Willis' formula: equal speeds of both gears at each of the four pitch points."""
    w1, w2 = Fraction(7), Fraction(-3)
    w = {name: c1 * w1 + c2 * w2 for name, (c1, c2) in member_coefficients(teeth).items()}
    for train, carrier, planet in ((teeth.first, w1, w["planet_1"]), (teeth.second, w2, w["planet_2"])):
        pin = carrier * (train.sun + train.planet)
        assert w["sun"] * train.sun == pin - planet * train.planet
        assert w["ring"] * train.ring == pin + planet * train.planet
        assert planet_speed_over_sun(w["sun"], carrier, train) == planet


def test_speeds_go_through_as_arrays():
    w1 = np.array([1.0, 2.0])
    ring = ring_speed(w1, 0.0, -5 / 3, -25 / 3)
    np.testing.assert_allclose(ring, -0.4 * w1)
    np.testing.assert_allclose(sun_speed(ring, w1, -5 / 3), w1 * 10 / 3)


def test_orders_with_held_output_are_exact():
    assert mesh_orders(TABLE_1) == (140, 40)
    assert sos_orders(TABLE_1) == {
        "mesh_1": 140, "mesh_2": 40, "ring": Fraction(2, 5), "sun": Fraction(10, 3), "spin_1": 7, "spin_2": Fraction(10, 11),
        "fault_sun_1": Fraction(14, 3), "fault_planet_1": 7, "fault_ring_1": Fraction(14, 5),
        "fault_sun_2": Fraction(20, 3), "fault_planet_2": Fraction(10, 11), "fault_ring_2": Fraction(4, 5), "carrier_1": 2,
    }  # fmt: skip


@pytest.mark.parametrize("teeth", [TABLE_1, OTHER])
def test_mesh_orders_are_the_same_seen_from_the_sun(teeth):
    sun = member_coefficients(teeth)["sun"][0]
    assert mesh_orders(teeth) == (teeth.first.sun * abs(sun - 1), teeth.second.sun * abs(sun))


def test_gears_of_table_1_can_be_put_together():
    assert assembly_faults(TABLE_1) == []
    assert TABLE_1.first.carrier_radius == pytest.approx(0.040)
    assert TABLE_1.second.carrier_radius == pytest.approx(0.028)


def test_only_the_small_sun_of_table_1_is_undercut():
    (warning,) = interference_warnings(TABLE_1)
    assert "train 2" in warning
    assert "16 teeth" in warning
    assert smallest_pinion(44 / 12) == pytest.approx(15.3, abs=0.05)
    assert 1e3 * tip_radius_limit(TABLE_1.second) == pytest.approx(22.78, abs=0.005)


def test_a_pinion_against_a_rack_needs_the_textbook_seventeen_point_one_teeth():
    assert smallest_pinion(1e6) == pytest.approx(2 / np.sin(np.radians(20.0)) ** 2, rel=1e-5)


def test_contact_ratios_are_those_of_the_sheet():
    assert contact_ratios(TABLE_1.first) == pytest.approx((1.67, 1.86), abs=0.005)
    assert contact_ratios(TABLE_1.second) == pytest.approx((1.58, 1.95), abs=0.005)


@pytest.mark.parametrize(("train", "words"), [
    (Train(60, 21, 100), "one axis"),
    (Train(60, 20, 100, planets=3), "equal angles"),
    (Train(20, 60, 140, planets=4), "neighbours touch"),
])  # fmt: skip
def test_gears_that_do_not_go_together_are_told(train, words):
    assert words in " ".join(assembly_faults(Teeth(train, TABLE_1.second)))


def test_teeth_are_read_with_and_without_planets():
    assert teeth_of("60 20 100; 12 44 100") == TABLE_1
    assert teeth_of("24/18/60/2, 30/45/120/3") == OTHER


@pytest.mark.parametrize(
    "text", ["", "60 20 100", "60 20 100 12 44 0", "60 20.5 100 12 44 100", "60 20 100; 60 20 100"]
)
def test_teeth_that_make_no_exchanging_gearbox_are_refused(text):
    with pytest.raises(InputError, match="teeth"):
        teeth_of(text)


def test_lossless_torques_need_a_torque_on_the_ring():
    assert lossless_torques(TABLE_1) == (1, Fraction(-7, 2), Fraction(5, 2))


@pytest.mark.parametrize("teeth", [TABLE_1, OTHER])
def test_lossless_torques_do_no_net_work_at_any_speeds(teeth):
    torques, (c1, c2) = lossless_torques(teeth), member_coefficients(teeth)["ring"]
    for w1, w2 in ((Fraction(1), Fraction(0)), (Fraction(0), Fraction(1)), (Fraction(3), Fraction(-5))):
        assert torques[0] * w1 + torques[1] * w2 + torques[2] * (c1 * w1 + c2 * w2) == 0


def test_carrier_forces_are_those_of_the_example():
    assert carrier_force(2.17, 0.040) == pytest.approx(54.3, abs=0.06)
    assert carrier_force(0.97, 0.028) == pytest.approx(34.6, abs=0.06)
    assert planet_mesh_force(2.17, 0.040, 2) == pytest.approx(54.25 / 4)


def test_lock_carries_what_virtual_power_says():
    assert carried_torque(2.17, 0.387, TABLE_1) == pytest.approx(1.783)
    assert carried_torque(1.0, 0.0, TABLE_1, torque_ring=2.5) == pytest.approx(0.0)


def test_powers_of_the_published_states():
    w = 120 * 2 * np.pi / 60
    assert efficiency_locked(0.94, 0.30) == pytest.approx(0.319, abs=5e-4)
    assert dissipated_power(1.41, 0.56, w, 0.0) == pytest.approx(17.7, abs=0.05)
    assert dissipated_power(0.94, 0.30, w, w) == pytest.approx(11.8 - 3.8, abs=0.1)
    assert ground_torque(0.94, 0.30, 6e-4, 10.0) == pytest.approx(0.634)
