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
    """A run: sources by reader (those that have a pressure), flows where logged, conditions.

    `astray` are settings of the device whose stamps share no moment with its pressures: they are on another clock, and not used.
    """

    run: str
    recording: Recording
    conditions: Mapping[str, Condition]
    sources: Mapping[str, Source]
    flow_set: Signal | None
    meter: Signal | None
    uf_set: Signal | None
    heparin: Signal | None
    astray: tuple[Signal, ...] = ()

    def number(self, name: str) -> float | None:
        """Return a condition that is a number, SI; None where the run does not state it."""
        value = self.conditions.get(name)
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None

    @property
    def meter_location(self) -> str | None:
        """Where the flow meter is said to sit, in lower case; None where that is not stated."""
        value = self.conditions.get("flowmeter_location")
        return None if value is None else str(value).strip().lower()

    @property
    def fluid(self) -> str:
        """What flows, in lower case; saline where not stated."""
        return str(self.conditions.get("fluid") or "saline").strip().lower()

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
    settings = {
        "flow": signal(recording, "blood_flow_set"),
        "uf": signal(recording, "uf_flow_set") or signal(recording, "uf_pump_command"),
        "heparin": signal(recording, "heparin_flow_set"),
    }
    astray = {name: one for name, one in settings.items() if one is not None and _apart(one, sources.get("rap"))}
    settings |= dict.fromkeys(astray)
    uf_set = settings["uf"]
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
        settings["flow"],
        signal(recording, "blood_flow_bench"),
        uf_set,
        settings["heparin"],
        tuple(one for one in astray.values() if one is not None),
    )


def _apart(one: Signal, source: Source | None) -> bool:
    """Tell whether a setting shares no moment with the pressures of the same device."""
    if source is None:
        return False
    first = min(float(tap.time[0]) for tap in source.taps.values())
    last = max(float(tap.time[-1]) for tap in source.taps.values())
    return bool(one.time[-1] < first or one.time[0] > last)
