"""Which channel of a table is time and in which unit, and how its numbers become seconds of the run.

Relative times stay as they were logged; times that count from 1970 or have a date count from the
earliest stamp of the run. What is wrong with the stamps is mended in `pipeline.ingest.stamps`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from pipeline.errors import InputError, listing, nearest
from pipeline.ingest.mapping import ChannelMap, Source, columns_listing, is_table
from pipeline.ingest.naming import matching, plain, shown
from pipeline.recording import QualityFinding
from pipeline.recording.units import conversion, quantity

# What loggers call their time, the likeliest first.
_NAMES = (
    "t", "time", "timestamp", "time_stamp", "tout", "zeit", "zeitstempel", "时间", "時間", "時刻", "время", "temps",
    "tempo", "tiempo", "tijd", "tid", "czas", "aika", "시간", "elapsed_time", "elapsed", "test_time", "run_time",
    "running_time", "total_time", "rel_time", "relative_time", "time_rel", "abs_time", "sample_time", "log_time",
    "testzeit", "prüfzeit", "messzeit", "laufzeit", "seconds", "secs", "sec", "sekunden", "millis", "micros",
    "milliseconds", "microseconds", "nanoseconds", "uptime", "clock", "datetime", "date_time", "x_value",
)  # fmt: skip
_UNIT_SUFFIX = re.compile(r"(?:[_.]\(?|\()(s|sec|secs|seconds|ms|msec|us|usec|µs|μs|ns|nsec|min|h)\)?$")
_UNIT_OF_NAME = {"millis": "ms", "milliseconds": "ms", "micros": "us", "microseconds": "us", "nanoseconds": "ns"}
_SECONDS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "second": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6,
    "usec": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9, "nsec": 1e-9, "min": 60.0, "h": 3600.0,
}  # fmt: skip
_RATE_NAMES = ("fs", "f_s", "sample_rate", "sampling_rate", "samplerate", "samplingrate", "sample_frequency",
               "sampling_frequency", "abtastrate", "samples_per_second")  # fmt: skip
_STEP_NAMES = ("ts", "dt", "delta_t", "sample_time", "sampling_time", "sample_interval", "sampling_interval",
               "sample_period", "sampling_period", "abtastzeit", "time_step", "timestep")  # fmt: skip
_LINE = '`time: {channel: "<name in the log>", unit: s}`'
# Seconds since 1970 that a log may bear: 1998 to 2103.
_EPOCH = (0.9e9, 4.2e9)
_EPOCH_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True)
class TimeSource:
    """Where a table's time comes from: a channel in a unit, or counted samples at a rate (Hz).

    `stated` tells whether someone stated the unit; numbers since 1970 are recognised either way.
    """

    channel: str | None
    unit: str = "s"
    stated: bool = False
    rate: float | None = None
    notes: tuple[QualityFinding, ...] = ()


class Clock:
    """Turns a table's stamps into seconds of the run; `start` must have seen the first stamp.

    Attributes
    ----------
    begins
        Seconds since 1970 of the first stamp; None for relative times.
    shift
        Seconds added to all, set by `align`.
    """

    def __init__(self, source: Source, time: TimeSource) -> None:
        self.where = source.where
        self.time = time
        self.begins: float | None = None
        self.shift = 0.0
        self.notes: list[QualityFinding] = list(time.notes)
        self._zero = 0.0
        self._factor = 1.0
        self._absolute_start = source.table.absolute_start
        self._started = False

    def start(self, first: float) -> None:
        """Learn from the first stamp, as logged, whether times count from 1970 and in which unit."""
        if self._started:
            return
        self._started = True
        if self.time.channel is None:
            return
        self._factor = _seconds_per(self.time.unit, self.where, self.time.channel)
        if self._absolute_start is not None:
            self.begins = _seconds_since_1970(self._absolute_start) + first * self._factor
            self._zero = first
            return
        unit = _epoch_unit(first, self._factor)
        if unit is None:
            return
        if self.time.stated and _EPOCH_UNITS[unit] != self._factor:
            said = f"'{self.time.channel}' has the unit {self.time.unit}, but its numbers are {unit} since 1970"
            self.notes.append(QualityFinding("warning", f"{self.where}: {said}; they are taken so."))
        self._factor = _EPOCH_UNITS[unit]
        self._zero = first
        self.begins = first * self._factor

    def seconds(self, stamps: np.ndarray) -> np.ndarray:
        """Return stamps (n,) as seconds of the run."""
        if self._zero == 0.0 and self._factor == 1.0 and self.shift == 0.0:
            return stamps
        return (stamps - self._zero) * self._factor + self.shift


def align(clocks: Sequence[Clock]) -> list[str]:
    """Let absolute clocks count from the earliest stamp of the run; say so for the provenance."""
    absolute = [clock.begins for clock in clocks if clock.begins is not None]
    if not absolute:
        return []
    earliest = min(absolute)
    for clock in clocks:
        if clock.begins is not None:
            clock.shift = clock.begins - earliest
    relative = [clock for clock in clocks if clock.begins is None]
    for clock in relative:
        clock.notes.append(
            QualityFinding(
                "warning",
                f"{clock.where}: its times have no date but those of the run's other streams have; they cannot be "
                f"aligned and are kept as logged.",
            )
        )
    moment = datetime.fromtimestamp(earliest, UTC)
    return [f"Absolute times were made relative: second 0 is {moment:%Y-%m-%dT%H:%M:%S}.{moment.microsecond:06d}Z."]


def find_times(sources: Sequence[Source], entry: ChannelMap | None) -> list[TimeSource]:
    """Find the time of each table of a run.

    Parameters
    ----------
    entry
        The recipe's entry for ``time``, if there is one. A channel that it names must stand in one
        table at least; the others then tell their time themselves.

    Raises
    ------
    InputError
        If nothing tells the time; the text says all ways to give it.
    """
    entry = entry or ChannelMap()
    if entry.channel is not None and entry.rate is not None:
        raise InputError("recipe, 'channels', 'time': gives both a channel and a rate; keep one of them.")
    if entry.channel is not None and not any(matching(entry.channel, source.table.channels) for source in sources):
        files = listing(dict.fromkeys(source.shown for source in sources))
        names = [channel.name for source in sources for channel in source.table.channels]
        raise InputError(
            f"{files}: the recipe says that time is the channel '{entry.channel}', which the log lacks."
            f"{nearest(entry.channel, names)} The log has: {columns_listing(sources)}. Mend the recipe's line, under "
            f"'channels': {_LINE}."
        )
    return [
        _find_time(source, entry if entry.table is None or is_table(entry.table, source) else ChannelMap())
        for source in sources
    ]


def _find_time(source: Source, entry: ChannelMap) -> TimeSource:
    channels = source.table.channels
    if entry.stamp is not None and source.table.block_stamp is not None:
        source.table.block_stamp = entry.stamp
    if entry.rate is not None:
        return TimeSource(None, rate=entry.rate)
    if entry.channel is not None:
        found = matching(entry.channel, channels)
        if len(found) == 1:
            return _channel(source, channels[found[0]].name, entry.unit)
        if found:
            raise InputError(
                f"{source.where}: {shown([channels[at] for at in found])} could all be the time '{entry.channel}'; "
                "write the name in the recipe as the log has it."
            )
    named = [channel.name for channel in channels if channel.name.strip().casefold() == "time"]
    if named:
        return _channel(source, named[0], entry.unit)
    if source.table.time_channel is not None:
        return _channel(source, source.table.time_channel, entry.unit)
    named = [channel.name for name in _NAMES for channel in channels if _bare(channel.name) == name]
    if named:
        return _channel(source, named[0], entry.unit)
    rate = stated_rate(source)
    if rate is not None:
        hertz, place = rate
        note = f"{source.where}: no channel is time, so samples are counted at {hertz:.6g} Hz, which {place} gives."
        return TimeSource(None, rate=hertz, notes=(QualityFinding("warning", note),))
    named = [channel.name for channel in channels if plain(channel.name) == "ts"]
    if named:  # the last resort: where it holds one number only, it was the step
        return _channel(source, named[0], entry.unit)
    wanted = f"the recipe's time channel '{entry.channel}' is not there" if entry.channel else "no channel is time"
    raise InputError(
        f"{source.where}: {wanted}. The log has: {shown(channels)}. Call a column 'time', or say in the recipe, under "
        "'channels', which one it is: `time: {channel: \"<name in the log>\", unit: s}`, or how fast was sampled: "
        "`time: {rate: 5 kHz}`."
    )


def _channel(source: Source, name: str, unit: str | None) -> TimeSource:
    raw = next((channel for channel in source.table.channels if channel.name == name), None)
    if raw is not None and raw.is_text:
        words = (str(v) for block in source.table.blocks([name]) for v in block[name] if v is not None)
        first = next((word for word in words if word.strip()), "")
        raise InputError(
            f"{source.where}, channel '{name}': holds text where time is expected, first '{first[:40]}'. Write times "
            "as numbers or as dates like 2024-05-31T12:00:00.123, or give the rate in the recipe: "
            "`time: {rate: 5 kHz}`."
        )
    declared = unit or (raw.unit if raw else None)
    if declared:
        return TimeSource(name, declared, stated=True)
    suffix = _UNIT_SUFFIX.search(plain(name))
    in_name = _UNIT_OF_NAME.get(plain(name)) or (suffix[1] if suffix and plain(name) != suffix[1] else None)
    if in_name:
        return TimeSource(name, in_name, stated=True)
    return TimeSource(name)


def _bare(name: str) -> str:
    """Return a channel's plain name without a unit at its end (``Time_ms`` -> ``time``)."""
    text = plain(name)
    if text in _NAMES:
        return text
    stripped = _UNIT_SUFFIX.sub("", text)
    return stripped.rstrip("_. ") or text


def _seconds_per(unit: str, where: str, channel: str) -> float:
    known = _SECONDS.get(unit.strip().strip("[]()").strip())
    if known is not None:
        return known
    try:
        return conversion(unit, "s", f"{where}, channel '{channel}'").factor
    except InputError as error:
        raise InputError(
            f"{error} Give the unit of time in the recipe, under 'channels': "
            f'`time: {{channel: "{channel}", unit: s}}`.'
        ) from error


def _epoch_unit(first: float, factor: float) -> str | None:
    """Return the unit in which `first` is a moment of our days, None where it is a relative time.

    Another unit than the stated one is thought of only where the stated one leads beyond our days: a
    counter of microseconds since power-on passes 1e9 too.
    """
    if first * factor > _EPOCH[1]:
        return next((unit for unit, s in _EPOCH_UNITS.items() if _EPOCH[0] <= first * s <= _EPOCH[1]), None)
    if first * factor < _EPOCH[0]:
        return None
    return next((unit for unit, s in _EPOCH_UNITS.items() if s == factor), None)


def _seconds_since_1970(text: str) -> float:
    moment = datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def stated_rate(source: Source, but: str | None = None) -> tuple[float, str] | None:
    """Return a sample rate (Hz) that the log states beside its channels, and where; the channel `but` is not asked."""
    metadata = {plain(key.rsplit(".", 1)[-1]): (key, text) for key, text in source.log.metadata.items()}
    columns = {plain(channel.name): channel.name for channel in source.table.channels if not channel.is_text}
    columns = {name: column for name, column in columns.items() if column != but}
    for names, unit in ((_RATE_NAMES, "Hz"), (_STEP_NAMES, "s")):
        for name in names:
            if name in metadata:
                key, text = metadata[name]
                value = _number(text, unit)
                place = f"'{key}' in the log"
            elif name in columns:
                value = _only_value(source, columns[name])
                place = f"the column '{columns[name]}'"
            else:
                continue
            if value is not None and math.isfinite(value) and value > 0:
                return (value if unit == "Hz" else 1.0 / value), place
    return None


def _number(text: str, unit: str) -> float | None:
    try:
        return quantity(text, unit)
    except InputError:
        return None


def _only_value(source: Source, name: str) -> float | None:
    """Return the one number that the first rows of a column hold."""
    block: Mapping[str, np.ndarray] = next(iter(source.table.blocks([name])), {})
    values = np.unique(block[name][np.isfinite(block[name])]) if name in block else np.empty(0)
    return float(values[0]) if values.size == 1 else None
