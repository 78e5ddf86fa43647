"""Channels and conditions are declared once, and what the synthetic rig logs is among them."""

import pytest

from pipeline.recording.units import conversion
from pipeline.rigs.tire.conditions import CONDITIONS, OPERATING, channels
from pipeline.rigs.tire.synthetic.rig import synthesize_bench, synthesize_road


def logs():
    everything = {"hub_height": True, "wheel_index": True, "duration": 1.0, "runs": ["load_2000"]}
    return [
        *synthesize_bench(everything, 1),
        *synthesize_bench({**everything, "as_voltage": True}, 1),
        *synthesize_road({"duration": 2.0, "pulses": ()}, 1),
    ]


def test_every_logged_channel_is_declared_in_its_unit_and_within_what_is_plausible():
    declared = {spec.name: spec for spec in channels()}
    for log in logs():
        for channel in log:
            spec = declared[channel.name]
            assert channel.unit == spec.unit
            assert spec.limit is None or abs(channel.values).max() < spec.limit


def test_every_logged_condition_is_declared_and_in_its_range():
    declared = {spec.name: spec for spec in CONDITIONS}
    for log in logs():
        for name, value in log.conditions.items():
            spec = declared[name]
            assert isinstance(value, str | bool) == (spec.unit == "")
            if not isinstance(value, str | bool):
                assert value in spec.range


def test_names_are_unique_and_units_are_si():
    for specs in (channels(), CONDITIONS, OPERATING):
        names = [spec.name for spec in specs]
        assert len(set(names)) == len(names)
        for spec in specs:
            if spec.unit:
                assert conversion(spec.unit, spec.unit, spec.name)(1.0) == pytest.approx(1.0)


def test_an_experiment_requires_only_the_channels_that_it_names():
    asked = {spec.name for spec in channels("sample_index", "flex_voltage") if spec.required}
    assert asked == {"sample_index", "flex_voltage"}
