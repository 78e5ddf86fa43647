"""Channels and conditions of the ultrafiltration device's bench, which its experiments share (rap.md, sections 1 and 11)."""

from __future__ import annotations

from dataclasses import replace

from pipeline.rigs.experiment import ChannelSpec, ConditionSpec, Range

# The four pressure taps in flow order; every channel of pressure is named after one of them.
TAPS = ("access", "prefilter", "return", "uf")
TAP_NAMES = {"access": "access", "prefilter": "pre-filter", "return": "return", "uf": "ultrafiltrate"}

_READERS = {
    "rap": "as the device's control unit reads it",
    "prot": "as the device's protective unit reads it",
    "bench": "as the bench reads it",
}
_SIGNS = {
    "access": "negative in operation",
    "prefilter": "positive in operation",
    "return": "positive in operation",
    "uf": "either sign",
}


def pressure(tap: str, reader: str) -> str:
    """Return the name of a channel of pressure: `tap` of `TAPS`, `reader` one of rap, prot, bench."""
    return f"pressure_{tap}_{reader}"


_PRESSURES = tuple(
    ChannelSpec(
        pressure(tap, reader), "Pa", f"{TAP_NAMES[tap]} pressure over the atmosphere, {_SIGNS[tap]}, {words}", limit=2e5
    )
    for reader, words in _READERS.items()
    for tap in TAPS
)
_CHANNELS = (
    *_PRESSURES,
    ChannelSpec("tmp_rap", "Pa", "transmembrane pressure as the device logs it; always computed anew", limit=2e5),
    ChannelSpec("blood_flow_set", "m^3/s", "blood flow as set", limit=2e-5, may_rest=True),
    ChannelSpec("blood_flow_rap", "m^3/s", "blood flow as the device estimates it", limit=2e-5, may_rest=True),
    ChannelSpec("blood_flow_bench", "m^3/s", "blood flow of the bench's meter", limit=2e-5),
    ChannelSpec("blood_pump_speed", "Hz", "strokes (roller passages) of the blood pump a second", limit=50.0),
    ChannelSpec("uf_flow_set", "m^3/s", "ultrafiltration rate as set", limit=2e-6, may_rest=True),
    ChannelSpec("uf_pump_command", "m^3/s", "rate that the device asks of its ultrafiltrate pump", limit=2e-6, may_rest=True),
    ChannelSpec("uf_volume_rap", "m^3", "ultrafiltrate in the tank as the device estimates it", limit=1e-2, may_rest=True),
    ChannelSpec("uf_level_distance", "m", "distance of the ultrasonic sensor to the liquid; 0 where the echo is not valid", no_value=0.0, limit=2.0),
    ChannelSpec("uf_echo_valid", "1", "1 where the ultrasonic echo is valid", limit=10.0, may_rest=True),
    ChannelSpec("tank_accel_x", "m/s^2", "acceleration of the tank along its length Lx", limit=160.0),
    ChannelSpec("tank_accel_y", "m/s^2", "acceleration of the tank along its width Ly", limit=160.0),
    ChannelSpec("tank_accel_z", "m/s^2", "acceleration of the tank up along its wall, + 9.81 at rest upright", limit=160.0),
    ChannelSpec("uf_mass_scale", "kg", "mass of ultrafiltrate on the scale", limit=20.0),
    ChannelSpec("temperature_air_rap", "K", "air in the housing, device's sensor", limit=400.0),
    ChannelSpec("temperature_air_bench", "K", "air in the housing, bench's sensor", limit=400.0),
    ChannelSpec("heparin_flow_set", "m^3/s", "heparin as set", limit=1e-7, may_rest=True),
    ChannelSpec("battery_voltage", "V", "battery's voltage", limit=100.0),
    ChannelSpec("battery_current", "A", "battery's current, + while discharging", limit=100.0),
    ChannelSpec("battery_level", "1", "charge left, as a share", limit=2.0, may_rest=True),
    ChannelSpec("air_detected", "1", "1 while the air sensor sees air", limit=10.0, may_rest=True),
    ChannelSpec("blood_leak_detected", "1", "1 while blood is seen in the ultrafiltrate", limit=10.0, may_rest=True),
    ChannelSpec("heparin_empty", "1", "1 while the heparin syringe is empty", limit=10.0, may_rest=True),
    ChannelSpec("clamp_closed", "1", "1 while the safety clamp is closed", limit=10.0, may_rest=True),
    ChannelSpec("estop_pressed", "1", "1 while the emergency button is pressed", limit=10.0, may_rest=True),
    ChannelSpec("watchdog_ok", "1", "1 while the watchdog is served", limit=10.0, may_rest=True),
    ChannelSpec("drain_pressed", "1", "1 when the key is pressed that announces that the tank is emptied", limit=10.0, may_rest=True),
    ChannelSpec("therapy_state", "", "state of the device: OFF, SETUP, PRIMING, READY, THERAPY, PAUSE, ALARM, TERMINATION", lists_entries=True),
    ChannelSpec("alarm_code", "", "alarm as the device logs it", lists_entries=True),
    ChannelSpec("warning_code", "", "warning as the device logs it", lists_entries=True),
    ChannelSpec("clamp", "", "setting of the clamp on the access line, of runs in which it changes", lists_entries=True),
)  # fmt: skip

_POSITIVE = Range(0.0, above=True)
_SHARE = Range(0.0, 0.5)
_LENGTH = Range(0.0, 2.0, above=True)
_OFFSET = Range(-1.0, 1.0)
CONDITIONS = (
    ConditionSpec("fluid", "", "saline, medium or blood", default="saline"),
    ConditionSpec("fluid_density", "kg/m^3", "density of the ultrafiltrate; 1004 kg/m^3 (saline) taken, and said, where not stated", range=Range(900.0, 1200.0)),
    ConditionSpec("fluid_temperature", "K", "temperature of the fluid", range=Range(270.0, 330.0)),
    ConditionSpec("room_temperature", "K", "temperature of the room", range=Range(250.0, 330.0)),
    ConditionSpec("tube_set_id", "", "tube set"),
    ConditionSpec("filter_id", "", "haemofilter"),
    ConditionSpec("n_rollers", "1", "rollers of the blood pump", range=Range(1, 12, whole=True)),
    ConditionSpec("flowmeter_location", "", "access or return: where the bench's flow meter sits; on the return line it reads the blood flow less the ultrafiltration"),
    ConditionSpec("bench_sensor_time_constant", "s", "time constant of the bench's pressure sensors", range=Range(0.0, 1.0)),
    *(ConditionSpec(f"sensor_height_{tap}", "m", f"height of the {TAP_NAMES[tap]} sensor over the reservoir's level", range=Range(-3.0, 3.0)) for tap in TAPS),
    ConditionSpec("tank_lx", "m", "length of the ultrafiltrate tank", range=_LENGTH),
    ConditionSpec("tank_ly", "m", "width of the tank", range=_LENGTH),
    ConditionSpec("tank_height", "m", "height of the tank", range=_LENGTH),
    ConditionSpec("tank_blind_level", "m", "level below which the ultrasonic sensor sees nothing", range=Range(0.0, 1.0)),
    ConditionSpec("level_sensor_z", "m", "height of the ultrasonic sensor over the tank's floor", range=_LENGTH),
    ConditionSpec("level_sensor_dx", "m", "ultrasonic sensor from the tank's centroid along Lx", range=_OFFSET),
    ConditionSpec("level_sensor_dy", "m", "ultrasonic sensor from the tank's centroid along Ly", range=_OFFSET),
    ConditionSpec("echo_model", "", "axis or specular: what the ultrasonic sensor reports in a tilted tank"),
    ConditionSpec("echo_reference_temperature", "K", "air temperature that the ultrasonic sensor assumes", range=Range(250.0, 330.0)),
    ConditionSpec("mass_tare", "kg", "what the scale reads with nothing in the tank", range=Range(-20.0, 20.0)),
    ConditionSpec("battery_energy", "J", "energy of the full battery", range=_POSITIVE),
    ConditionSpec("battery_efficiency", "1", "share of the battery's energy that reaches the device", range=Range(0.0, 1.0, above=True)),
    ConditionSpec("set", "", "calibration or holdout, of flow runs"),
    ConditionSpec("clamp", "", "setting of the clamp on the access line, as a factor or in words"),
    ConditionSpec("flowmeter_gain_u", "1", "relative standard uncertainty of the flow meter's gain (type B)", range=_SHARE),
    ConditionSpec("scale_gain_u", "1", "relative standard uncertainty of the scale's gain (type B)", range=_SHARE),
    ConditionSpec("bench_gain_u", "1", "relative standard uncertainty of the bench pressure sensors' gain (type B)", range=_SHARE),
    ConditionSpec("remark", "", "free text"),
)  # fmt: skip


def channels(*required: str) -> tuple[ChannelSpec, ...]:
    """Return the channels of the rig with those in `required` required, the others optional."""
    return tuple(replace(spec, required=spec.name in required) for spec in _CHANNELS)
