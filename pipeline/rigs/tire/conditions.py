"""Channels and conditions of the tire rig, which bench and road share (tire.md, sections 1 and 11)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pipeline.rigs.experiment import ChannelSpec, ConditionSpec, Range

_CODE = "code of the analogue-digital converter"
_CHANNELS = (
    ChannelSpec("sample_index", "1", "number of the sample since the microcontroller began", counts_samples=True),
    ChannelSpec(
        "packet_counter", "1", "number of the radio packet, counted modulo 2^counter_bits", counts_samples=True
    ),
    ChannelSpec("flex_code", "1", f"flex sensor, {_CODE}", limit=2.0**24),
    ChannelSpec("flex_voltage", "V", "flex sensor, voltage of the divider's lower leg", limit=30.0),
    ChannelSpec("pvdf_code", "1", f"PVDF film, {_CODE}", limit=2.0**24),
    ChannelSpec("pvdf_voltage", "V", "PVDF film, voltage of its readout", limit=30.0),
    ChannelSpec("vertical_load", "N", "load on the tire, + presses it on the road (bench: load cell)", limit=5e4),
    ChannelSpec("road_speed", "m/s", "surface speed of drum or belt", limit=100.0),
    ChannelSpec("vehicle_speed", "m/s", "speed of the car over ground", limit=100.0),
    ChannelSpec("longitudinal_force", "N", "force of the road on the tire, + drives the car forward", limit=5e4),
    ChannelSpec("longitudinal_acceleration", "m/s^2", "acceleration of the car, + forward", limit=50.0),
    ChannelSpec("lateral_acceleration", "m/s^2", "acceleration of the car, + to the left", limit=50.0),
    ChannelSpec("steering_angle", "rad", "steering angle, + to the left", limit=20.0),
    ChannelSpec("hub_height", "m", "height of the hub over the road: the loaded radius", limit=1.0),
    ChannelSpec("wheel_index", "1", "pulse of the rim once a revolution, 0 or 1", limit=10.0),
    ChannelSpec("battery_voltage", "V", "voltage of the transmitter's battery", limit=30.0),
    ChannelSpec("supply_current", "A", "current of the transmitter", limit=10.0),
)

# What is taken of the circuit where a run does not state it: never without a word (tire.md, sections 6 and 11).
DIVIDER = {"supply_voltage": 3.3, "divider_resistance": 1e4}
CONVERTER = {"adc_reference": 3.3, "adc_bits": 12.0}
_TAKEN = "taken, and said, where not stated"

_POSITIVE = Range(0.0, above=True)
_SHARE = Range(0.0, 0.5)
_LENGTH = Range(1e-3, 0.3)
CONDITIONS = (
    ConditionSpec("nominal_load", "N", "load as set; by default the mean of vertical_load", range=Range(0.0, 1e5)),
    ConditionSpec("nominal_speed", "m/s", "speed as set; by default the mean of the measured one", range=Range(0.0, 150.0), read_as="km/h"),
    ConditionSpec("inflation_pressure", "Pa", "inflation pressure over the atmosphere, p0", range=Range(1e4, 2e6)),
    ConditionSpec("tire_size", "", "as on the side wall, for example 245/40R18"),
    ConditionSpec("belt_width", "m", "width b of the belt, a first guess", range=Range(0.02, 1.0)),
    ConditionSpec("sensor_length_flex", "m", "length Ls of the flex sensor", range=_LENGTH),
    ConditionSpec("sensor_length_pvdf", "m", "length L_p of the PVDF film", range=_LENGTH),
    ConditionSpec("supply_voltage", "V", f"supply VIN of the divider; 3.3 V {_TAKEN}", range=Range(0.1, 60.0)),
    ConditionSpec("divider_resistance", "ohm", f"fixed resistor R1 of the divider; 10 kohm {_TAKEN}", range=Range(1.0, 1e9)),
    ConditionSpec("adc_reference", "V", f"voltage of the converter's full scale; 3.3 V {_TAKEN}", range=Range(0.1, 60.0)),
    ConditionSpec("adc_bits", "1", f"bits of the converter; 12 {_TAKEN}", range=Range(4, 24, whole=True)),
    ConditionSpec("sample_rate", "Hz", "samples per second of the microcontroller; by default as the log's times tell", range=_POSITIVE),
    ConditionSpec("frames_per_packet", "1", "samples in one radio packet; by default as packet_counter repeats, else 10", range=Range(1, whole=True)),
    ConditionSpec("counter_bits", "1", "bits of the packet counter; by default 16, or as it wraps", range=Range(1, 64, whole=True)),
    ConditionSpec("flex_polarity", "1", "+1 where flattening raises the voltage, -1 where it lowers it", range=Range(-1, 1)),
    ConditionSpec("sensor_resistance", "ohm", "R0 of the mounted sensor on the free tire", range=_POSITIVE),
    ConditionSpec("liner_temperature", "K", "temperature of the inner liner", range=_POSITIVE),
    ConditionSpec("moving_mass", "kg", "mass of beam and axle on the bench's guides", range=Range(0.0)),
    ConditionSpec("gated", "", "true where the transmitter sleeps while the signal is at its reference"),
    ConditionSpec("bench_or_road", "", "bench or road"),
    ConditionSpec("time_base", "s", "time for which a stated charge lasts", range=_POSITIVE),
    ConditionSpec("load_gain_u", "1", "relative standard uncertainty of the load cell's gain (type B)", range=_SHARE),
    ConditionSpec("pressure_u", "1", "relative standard uncertainty of the inflation pressure (type B)", range=_SHARE),
    ConditionSpec("sensor_length_u", "1", "relative standard uncertainty of sensor_length_flex (type B)", range=_SHARE),
    ConditionSpec("remark", "", "free text"),
)  # fmt: skip

# What parameters of these experiments are told at, besides conditions.
OPERATING = (
    ConditionSpec("load", "N", "load on the tire, as set"),
    ConditionSpec("speed", "m/s", "rolling speed, as set", read_as="km/h"),
    ConditionSpec("event", "1", "number of the event in its run, from 0"),
    ConditionSpec("kind", "", "vertical or longitudinal"),
)


def channels(*required: str) -> tuple[ChannelSpec, ...]:
    """Return the channels of the rig with those in `required` required, the others optional."""
    return tuple(replace(spec, required=spec.name in required) for spec in _CHANNELS)


def assumed(conditions: Mapping[str, object], codes: bool) -> dict[str, float]:
    """Return what is taken of divider and (for a log of codes) converter because the run does not state it, SI."""
    values = {**DIVIDER, **CONVERTER} if codes else DIVIDER
    return {name: value for name, value in values.items() if name not in conditions}
