"""The device's side of a run as arrays: pressures of both units, flows, flags, list of events. Nothing is judged here."""

from __future__ import annotations

from pipeline.recording import Recording
from pipeline.rigs.rap.alarms.results import DeviceLog
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.tables import Entry, Signal, entries, signal

FLAGS = ("air_detected", "blood_leak_detected", "estop_pressed", "watchdog_ok", "clamp_closed", "drain_pressed")


def is_flag(signal: Signal) -> bool:
    """Tell whether a channel holds nothing but 0 and 1."""
    return bool(((signal.values == 0.0) | (signal.values == 1.0)).all())


def device_log(recording: Recording) -> DeviceLog:
    """Return what the device wrote of the run; what it did not log is None or missing."""
    return DeviceLog(
        recording.run,
        control=_by_name(recording, {tap: pressure(tap, "rap") for tap in TAPS}),
        protective=_by_name(recording, {tap: pressure(tap, "prot") for tap in TAPS}),
        flow_set=signal(recording, "blood_flow_set"),
        flow_device=signal(recording, "blood_flow_rap"),
        pump_speed=signal(recording, "blood_pump_speed"),
        uf_set=signal(recording, "uf_flow_set"),
        uf_command=signal(recording, "uf_pump_command"),
        flags=_by_name(recording, {name: name for name in FLAGS}),
        states=_changes(entries(recording, "therapy_state")),
        codes=tuple(entries(recording, "alarm_code")),
        warnings=tuple(entries(recording, "warning_code")),
        lists_codes="alarm_code" in recording,
    )


def _changes(rows: list[Entry]) -> tuple[Entry, ...]:
    """Return the rows at which the word becomes another one: a state may be logged every second."""
    return tuple(row for i, row in enumerate(rows) if i == 0 or row.text != rows[i - 1].text)


def _by_name(recording: Recording, channels: dict[str, str]) -> dict[str, Signal]:
    found = {name: signal(recording, channel) for name, channel in channels.items()}
    return {name: value for name, value in found.items() if value is not None}
