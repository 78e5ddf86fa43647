"""What a therapy run says of itself that cannot be so, before any number is taken from it (rap.md, section 8).

Channels that fail are taken out of the run; faults that the numbers themselves show are told where they are computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.pressures.exchanged import exchange_faults
from pipeline.rigs.rap.pressures.record import Record as PressureRecord
from pipeline.rigs.rap.pressures.record import record_of
from pipeline.rigs.rap.pressures.tap_levels import TapLevel, tap_levels
from pipeline.rigs.rap.pressures.units import unit_faults
from pipeline.rigs.rap.therapy.channel_faults import channel_faults
from pipeline.rigs.rap.therapy.record import Record, in_memory, without

# Tables whose lengths differ by one of these factors were logged in another unit of time.
_TIME_UNITS = {60.0: "minutes", 3600.0: "hours", 1e-3: "milliseconds", 1.0 / 60.0: "minutes taken for seconds twice"}
_LONG, _ALIKE = 300.0, 0.1
# A table that ends that much earlier than the device's is told, s and as a share of the run.
_EARLY, _EARLY_SHARE = 60.0, 0.02
_SLOW = {"device_temperature", "bench_temperature", "events"}
_RUNNING = ("THERAPY", "PAUSE", "ALARM")


def examined(recording: Recording) -> tuple[Record, list[QualityFinding]]:
    """Return a run in memory without the channels that cannot be what they are called, and what was found."""
    loaded = in_memory(recording)
    faults = channel_faults(loaded)
    removed = {fault.channel: fault.message for fault in faults if fault.unusable}
    found = [fault.finding(recording.run) for fault in faults]
    view = record_of(without(loaded, removed))
    levels = tap_levels(view)
    for finding in _of_pressures(view, levels):
        found.append(finding)
        if finding.level == "error" and finding.channel:
            reader = finding.channel.rpartition("_")[2]
            removed |= {name: finding.message for tap in TAPS if (name := pressure(tap, reader)) in loaded}
            removed.setdefault(finding.channel, finding.message)
    found += _tables(loaded)
    source = view.sources.get("rap")
    record = Record(
        without(loaded, removed),
        {name: reason for name, reason in removed.items() if name in loaded},
        rests=source.spans.off if source else (),
        runs=source.spans.on if source else (),
        levels=[level for level in levels if level.channel not in removed],
        heads={tap: head for tap in TAPS if (head := view.head(tap)) is not None},
    )
    return record, found


def _of_pressures(record: PressureRecord, levels: Sequence[TapLevel]) -> list[QualityFinding]:
    """Return units, signs and exchanges of the pressures, as `rap.pressures` tells them."""
    units = unit_faults(record, levels)
    wrong = {finding.channel for finding in units}
    kept = [level for level in levels if level.channel not in wrong]
    return [*units, *exchange_faults(record, kept)]


def _tables(recording: Recording) -> Iterator[QualityFinding]:
    """Hold the tables of a run against each other: units of time, ends, what the events say of the end."""
    spans = {name: stream.span for name, stream in recording.streams.items() if stream.size > 1}
    main = max((name for name in spans if name not in _SLOW), key=lambda name: recording.streams[name].size, default="")
    if not main:
        return
    begin, end = spans[main]
    length = end - begin
    for name, (first, last) in spans.items():
        if name in (main, "events") or length < _LONG or last <= first:
            continue
        ratio = length / (last - first)
        unit = next((word for factor, word in _TIME_UNITS.items() if abs(ratio / factor - 1.0) < _ALIKE), "")
        if unit:
            yield QualityFinding(
                "error",
                f"table '{name}' lasts {last - first:.4g} s and '{main}' {length:.4g} s, a factor of {ratio:.3g}: is its time in {unit}? "
                "Give the unit of time in the recipe.",
                recording.run,
            )
        elif name not in _SLOW and end - last > max(_EARLY, _EARLY_SHARE * length):
            yield QualityFinding(
                "warning",
                f"table '{name}' ends {(end - last) / 60:.1f} min before '{main}': truncated, or its logger stopped. What needs it is told "
                "up to there.",
                recording.run,
                span=(last, end),
            )


def cut_short(states: list[tuple[float, str]], end: float) -> str:
    """Say that a log ends while therapy runs, '' where it does not; `states` are the logged ones with their moments."""
    if not states or states[-1][1].upper() not in _RUNNING:
        return ""
    last = states[-1][1].upper()
    return (
        f"the log ends in the state {last}, without TERMINATION ({(end - states[-1][0]) / 60:.0f} min after it began): it was cut, or the device "
        "stopped without a word. The final volume is that of the last sample."
    )
