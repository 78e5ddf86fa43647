"""One therapy run in memory: its signals by name and what its channels ask for. Nothing is judged here.

Each run of a campaign holds another part of the device: a long therapy all of it, a tank on the move its level only, a
test of alarms its pressures and events.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pipeline.recording import Channel, Condition, Recording, Stream
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.pressures.spans import Span
from pipeline.rigs.rap.pressures.tap_levels import TapLevel
from pipeline.rigs.rap.tables import Signal, signal

# What a run can tell, and which channels ask for it: any of them.
TEMPERATURE, VOLUME, MEMBRANE, BATTERY = "temperature", "volume", "membrane", "battery"
ALARMS, REDUNDANCY = "alarms", "redundancy"
PARTS: Mapping[str, tuple[str, ...]] = {
    TEMPERATURE: ("temperature_air_rap", "temperature_air_bench"),
    VOLUME: ("uf_level_distance", "uf_mass_scale", "uf_volume_rap"),
    MEMBRANE: (pressure("uf", "rap"), pressure("prefilter", "rap"), pressure("return", "rap")),
    BATTERY: ("battery_voltage", "battery_current", "battery_level"),
    ALARMS: ("alarm_code", *(pressure(tap, "rap") for tap in TAPS)),
    REDUNDANCY: tuple(pressure(tap, "prot") for tap in TAPS),
}
ACCELERATIONS = ("tank_accel_x", "tank_accel_y", "tank_accel_z")


@dataclass(eq=False)
class Record:
    """A run whose channels are in memory.

    Attributes
    ----------
    recording
        Without the channels in `removed` and without frozen samples of the pressures.
    removed
        Channels that cannot be used, with the reason.
    as_logged
        With frozen samples, which the comparison of the two units must see.
    rests, runs
        When the blood pump stands and turns by the device's clock, s, margins taken off.
    levels
        Level of each pressure with the pump on and off, of the channels that can be used.
    heads
        What each tap reads at rest for its height, Pa, where that is stated.
    """

    recording: Recording
    removed: Mapping[str, str] = field(default_factory=dict)
    as_logged: Recording | None = None
    rests: Sequence[Span] = ()
    runs: Sequence[Span] = ()
    levels: Sequence[TapLevel] = ()
    heads: Mapping[str, float] = field(default_factory=dict)
    _signals: dict[str, Signal | None] = field(default_factory=dict, repr=False)

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.recording.run

    @property
    def conditions(self) -> Mapping[str, Condition]:
        """What holds for the whole run, SI."""
        return self.recording.conditions

    def signal(self, name: str) -> Signal | None:
        """Return a numeric channel without missing samples; None where the run lacks it or it cannot be used."""
        if name not in self._signals:
            self._signals[name] = signal(self.recording, name)
        return self._signals[name]

    def number(self, condition: str) -> float | None:
        """Return a numeric condition in SI, None where the run lacks it."""
        value = self.conditions.get(condition)
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None

    @property
    def asked(self) -> tuple[str, ...]:
        """What this run has channels for, removed ones counted: see `PARTS`."""
        present = {channel.name for channel in self.recording} | set(self.removed)
        return tuple(part for part, channels in PARTS.items() if present & set(channels))


def in_memory(recording: Recording) -> Recording:
    """Return the run with every channel read once."""
    streams = {
        name: Stream(name, stream.time, {key: _loaded(stream, key) for key in stream.channels})
        for name, stream in recording.streams.items()
    }
    return Recording(recording.run, streams, recording.conditions, recording.quality, recording.provenance)


def without(recording: Recording, channels: Mapping[str, str]) -> Recording:
    """Return the run without these channels."""
    streams = {
        name: Stream(name, stream.time, {key: one for key, one in stream.channels.items() if key not in channels})
        for name, stream in recording.streams.items()
    }
    return Recording(recording.run, streams, recording.conditions, recording.quality, recording.provenance)


def _loaded(stream: Stream, name: str) -> Channel:
    return stream.channels[name]
