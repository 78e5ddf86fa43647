"""A drive against the car's channels: clocks, units, slip, direction."""

import numpy as np
import pytest
from drives_of_truth import drive

from pipeline.rigs.tire.road.reference import ReferenceTable, compare, own_direction

RADIUS = 0.3171


def compared(without=(), seed=1, **overrides):
    found = drive(seed, **overrides)
    stream = found.recording.streams["vehicle"]
    names = {
        "load": "vertical_load", "force": "longitudinal_force", "speed": "vehicle_speed",
        "acceleration": "longitudinal_acceleration",
    }  # fmt: skip
    channels = {short: stream.channels[name].values for short, name in names.items() if short not in without}
    return compare(found.forces, ReferenceTable(stream.time, **channels), RADIUS, 45.0)


def test_references_of_the_standard_drive_agree_with_load_and_force():
    found = compared()
    assert found.load_rms < 40.0
    assert found.force_rms < 100.0
    assert abs(found.load_bias) < 5.0
    assert not found.offset_applied
    assert (found.direction, found.speed_unit, found.load_unit) == ("right", "m/s", "N")


def test_slip_is_told_as_slip():
    found = compared()
    assert found.slip_driving == pytest.approx(0.0188, abs=0.002)
    assert found.slip_braking == pytest.approx(-0.0146, abs=0.002)
    assert any("slip" in remark for remark in found.remarks)


@pytest.mark.parametrize("without", [(), ("load", "force"), ("force", "acceleration")])
@pytest.mark.thorough
def test_clocks_that_are_apart_are_put_together(without):
    found = compared(without, reference_shift=0.7)
    assert found.offset_applied
    assert found.offset == pytest.approx(0.7, abs=0.02)


def test_without_a_change_in_both_tables_no_offset_is_told():
    found = compared(pulses=(), speeds=((0.0, 12.0), (1.0, 12.0)))
    assert not found.offset_applied
    assert "not told" in found.offset_verdict


def test_a_reversed_direction_is_told_by_the_reference_and_by_the_wheel_itself():
    assert compared(force_sign=-1).direction == "wrong"
    assert own_direction(drive(1, force_sign=-1).forces, RADIUS)[0] == "wrong"
    assert own_direction(drive(1).forces, RADIUS)[0] == "right"
    steady = drive(1, pulses=(), speeds=((0.0, 12.0), (1.0, 12.0)))
    assert own_direction(steady.forces, RADIUS)[0] == "untold"


@pytest.mark.parametrize(("scale", "unit"), [(3.6, "km/h"), (30 / np.pi / RADIUS, "rpm"), (2.2369, "mph")])
@pytest.mark.thorough
def test_a_speed_in_another_unit_is_named_and_not_compared(scale, unit):
    found = compared(speed_scale=scale)
    assert found.speed_unit == unit
    assert found.speed is None
    assert np.isnan(found.speed_rms)


def test_a_load_in_kilograms_is_named_and_not_compared():
    found = compared(load_scale=1 / 9.80665)
    assert found.load_unit == "kg"
    assert np.isnan(found.load_rms)
    assert any("kg" in remark for remark in found.remarks)


def test_a_reference_with_holes_is_compared_where_it_is():
    found = drive(1)
    stream = found.recording.streams["vehicle"]
    time, load = stream.time, stream.channels["vertical_load"].values.copy()
    load[(time > 15.0) & (time < 20.0)] = np.nan
    seen = compare(found.forces, ReferenceTable(time, load=load), RADIUS, 45.0).load
    at = found.forces.time
    assert np.isnan(seen[(at > 15.5) & (at < 19.5)]).all()
    assert np.isfinite(seen[(at > 1.0) & (at < 14.5)]).all()
