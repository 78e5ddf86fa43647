"""One run as `rap.pressures` looks at it: each reader's pressures by tap on its own clock, flows as set and as metered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pipeline.recording import Recording
from pipeline.recording.recording import Condition
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.pressures.spans import Spans, at_rest, spans_of
from pipeline.rigs.rap.tables import Signal, signal

READERS = ("rap", "bench", "prot")
WORDS = {"rap": "the device's", "bench": "the bench's", "prot": "the protective unit's"}
# kg/m^3 (0.9 % saline, rap.md section 1) and m/s^2.
SALINE_DENSITY, G0 = 1004.0, 9.80665


@dataclass(frozen=True)
class Source:
    """One reader's pressures (rap, bench or prot) by tap, and when the pump is on and off by its clock."""

    reader: str
    taps: Mapping[str, Signal]
    spans: Spans


@dataclass(frozen=True)
class Record:
    """A run: sources by reader (those that have a pressure), flows where logged, conditions."""

    run: str
    recording: Recording
    conditions: Mapping[str, Condition]
    sources: Mapping[str, Source]
    flow_set: Signal | None
    meter: Signal | None
    uf_set: Signal | None
    heparin: Signal | None

    def number(self, name: str) -> float | None:
        """Return a condition that is a number, SI; None where the run does not state it."""
        value = self.conditions.get(name)
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None

    @property
    def meter_location(self) -> str | None:
        """Where the flow meter is said to sit, in lower case; None where that is not stated."""
        value = self.conditions.get("flowmeter_location")
        return None if value is None else str(value).strip().lower()

    def head(self, tap: str) -> float | None:
        """Return what a sensor reads at rest because of its height over the reservoir, Pa; None where that is not stated."""
        height = self.number(f"sensor_height_{tap}")
        return None if height is None else -self.density * G0 * height

    @property
    def density(self) -> float:
        """Density of the fluid, kg/m^3; that of saline where not stated."""
        return self.number("fluid_density") or SALINE_DENSITY


def record_of(recording: Recording) -> Record:
    """Look at a recording."""
    sources = {}
    for reader in READERS:
        taps = {tap: found for tap in TAPS if (found := signal(recording, pressure(tap, reader))) is not None}
        if taps:
            sources[reader] = Source(reader, taps, spans_of(recording, reader, taps))
    uf_set = signal(recording, "uf_flow_set") or signal(recording, "uf_pump_command")
    for reader in ("bench", "prot", "rap"):
        if "rap" in sources and reader in sources:
            sources[reader] = replace(
                sources[reader], spans=at_rest(sources["rap"].spans, sources[reader].spans, uf_set)[1]
            )
    return Record(
        recording.run,
        recording,
        recording.conditions,
        sources,
        signal(recording, "blood_flow_set"),
        signal(recording, "blood_flow_bench"),
        uf_set,
        signal(recording, "heparin_flow_set"),
    )
