"""What a therapy run says of itself that cannot be so, before any number is taken from it (rap.md, section 8).

Channels that fail are taken out of the run; faults that the numbers themselves show are told where they are computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.pressures.data_faults import data_faults
from pipeline.rigs.rap.pressures.record import record_of
from pipeline.rigs.rap.pressures.spans import Span
from pipeline.rigs.rap.pressures.tap_levels import tap_levels
from pipeline.rigs.rap.therapy.channel_fault import ChannelFault
from pipeline.rigs.rap.therapy.channel_faults import channel_faults
from pipeline.rigs.rap.therapy.record import Record, in_memory, without

# Tables whose lengths differ by one of these factors were logged in another unit of time.
_TIME_UNITS = {60.0: "minutes", 3600.0: "hours", 1e-3: "milliseconds"}
_LONG, _ALIKE, _PAIR = 300.0, 0.1, 2
# A table that ends that much earlier than the device's is told, s and as a share of the run.
_EARLY, _EARLY_SHARE = 60.0, 0.02
_SLOW = {"device_temperature", "bench_temperature", "events"}
# Events that far from the pumps' starts and stops, both alike to so much, are on another clock, s.
_APART, _APART_ALIKE = 30.0, 15.0
_RUNNING = ("THERAPY", "PAUSE", "ALARM")


def examined(recording: Recording) -> tuple[Record, list[QualityFinding]]:
    """Return a run in memory without the channels that cannot be what they are called, and what was found."""
    loaded = in_memory(recording)
    lengths = table_lengths(loaded)
    removed = {name: one.message for one in lengths if one.unusable for name in loaded.streams[one.table].channels}
    faults = channel_faults(without(loaded, removed))
    removed |= {fault.channel: fault.message for fault in faults if fault.unusable}
    found = [*(one.finding(recording.run) for one in lengths), *_once(faults, recording.run)]
    view = record_of(without(loaded, removed))
    pressures = data_faults(view)
    for finding in pressures.findings:
        found.append(finding)
        if finding.level == "error" and finding.channel and finding.channel not in pressures.useless:
            reader = finding.channel.rpartition("_")[2]
            removed |= {name: finding.message for tap in TAPS if (name := pressure(tap, reader)) in loaded}
            removed.setdefault(finding.channel, finding.message)
    source = view.sources.get("rap")
    gone = {**pressures.useless, **removed}
    sound = without(pressures.sound, gone)
    record = Record(
        sound,
        {name: reason for name, reason in gone.items() if name in loaded},
        as_logged=without(loaded, removed),
        rests=source.spans.off if source else (),
        runs=source.spans.on if source else (),
        levels=[level for level in tap_levels(view) if level.channel not in gone],
        heads={tap: head for tap in TAPS if (head := view.head(tap)) is not None},
    )
    return record, found


def _once(faults: Sequence[ChannelFault], run: str) -> list[QualityFinding]:
    """Return faults as findings, one of those that several channels share."""
    first = {fault.message: fault for fault in reversed(faults)}
    return [fault.finding(run) for fault in faults if first[fault.message] is fault]


@dataclass(frozen=True)
class TableFault:
    """A table whose time cannot be seconds, or that ends early (`span`, s)."""

    table: str
    message: str
    unusable: bool
    span: tuple[float, float] | None = None

    def finding(self, run: str) -> QualityFinding:
        """Return the fault as a finding on the data."""
        return QualityFinding("error" if self.unusable else "warning", self.message, run, span=self.span)


def table_lengths(recording: Recording) -> list[TableFault]:
    """Hold the tables of a run against each other: units of time, tables that end early."""
    spans = {name: stream.span for name, stream in recording.streams.items() if stream.size > 1}
    main = max((name for name in spans if name not in _SLOW), key=lambda name: recording.streams[name].size, default="")
    if not main:
        return []
    lengths = [last - first for name, (first, last) in spans.items() if name != "events"]
    end = spans[main][1]
    # Of three and more the usual length counts: the fastest table may be the one in another unit.
    length = float(np.median(lengths)) if len(lengths) > _PAIR else spans[main][1] - spans[main][0]
    found = []
    for name, (first, last) in spans.items():
        if name == "events" or length < _LONG or last <= first:
            continue
        ratio = length / (last - first)
        unit = next((word for factor, word in _TIME_UNITS.items() if abs(ratio / factor - 1.0) < _ALIKE), "")
        if unit:
            text = (
                f"table '{name}' lasts {last - first:.4g} s and the others {length:.4g} s, a factor of {ratio:.3g}: is its time in {unit}? It is "
                "not used; give the unit of its time in the recipe."
            )
            found.append(TableFault(name, text, True))
        elif name not in _SLOW and end - last > max(_EARLY, _EARLY_SHARE * length):
            text = (
                f"table '{name}' ends {(end - last) / 60:.1f} min before '{main}': truncated, or its logger stopped. What needs it is told up to "
                "there."
            )
            found.append(TableFault(name, text, False, (last, end)))
    return found


def events_apart(states: Sequence[tuple[float, str]], runs: Sequence[Span]) -> str:
    """Say that the list of events stands on another clock than the pressures, '' where it does not.

    `states` are the logged ones with their moments, `runs` when the pumps ran by the pressures, s: both first starts and both
    last stops have to be apart by the same.
    """
    therapy = [i for i, (_, word) in enumerate(states) if word.upper() == "THERAPY"]
    if not therapy or not runs or therapy[-1] + 1 >= len(states):
        return ""
    start, stop = states[therapy[0]][0] - runs[0][0], states[therapy[-1] + 1][0] - runs[-1][1]
    if abs(start) < _APART or abs(start - stop) > _APART_ALIKE:
        return ""
    return (
        f"the events stand {abs(start):.0f} s {'behind' if start > 0.0 else 'before'} the pressures: THERAPY begins {start:+.0f} s from the start of the pumps and "
        f"ends {stop:+.0f} s from their stop. The list of events is on another clock; alarms and states are matched by it as logged. Bring both to "
        "one clock."
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
