"""Which channel of a table is time and in which unit, or at which rate its samples are counted.

What its numbers mean is in `clock`; what is wrong with the stamps is mended in `stamps`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.errors import InputError, listing, nearest
from pipeline.ingest.clock import TimeSource
from pipeline.ingest.mapping import ChannelMap, Source, columns_listing, is_table
from pipeline.ingest.naming import matching, plain, shown
from pipeline.recording import QualityFinding
from pipeline.recording.units import quantity

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
_RATE_NAMES = ("fs", "f_s", "sample_rate", "sampling_rate", "samplerate", "samplingrate", "sample_frequency",
               "sampling_frequency", "abtastrate", "samples_per_second")  # fmt: skip
_STEP_NAMES = ("ts", "dt", "delta_t", "sample_time", "sampling_time", "sample_interval", "sampling_interval",
               "sample_period", "sampling_period", "abtastzeit", "time_step", "timestep")  # fmt: skip
_COUNTER_NAMES = ("sample_index", "sample_number", "sample_no", "sample_count", "sample_counter", "sample_id")
_LINE = '`time: {channel: "<name in the log>", unit: s}`'


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
    if entry.channel is not None:
        found = matching(entry.channel, channels)
        if len(found) == 1 and entry.rate is not None:
            return TimeSource(channels[found[0]].name, "1", stated=True, rate=entry.rate)
        if len(found) == 1:
            return _channel(source, channels[found[0]].name, entry.unit)
        if found:
            raise InputError(
                f"{source.where}: {shown([channels[at] for at in found])} could all be the time '{entry.channel}'; "
                "write the name in the recipe as the log has it."
            )
    if entry.rate is not None:
        return _counted(source, entry.rate, "the recipe")
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
        return _counted(source, *rate)
    named = [channel.name for channel in channels if plain(channel.name) == "ts"]
    if named:  # the last resort: where it holds one number only, it was the step
        return _channel(source, named[0], entry.unit)
    named = [channel.name for channel in channels if _bare(channel.name.rpartition(".")[2]) in _NAMES]
    if len(named) == 1:  # a.time
        return _channel(source, named[0], entry.unit)
    wanted = f"the recipe's time channel '{entry.channel}' is not there" if entry.channel else "no channel is time"
    raise InputError(
        f"{source.where}: {wanted}. The log has: {shown(channels)}. Call a column 'time', or say in the recipe, under "
        "'channels', which one it is: `time: {channel: \"<name in the log>\", unit: s}`, or how fast was sampled: "
        "`time: {rate: 5 kHz}`. Where a column numbers the samples, give both: "
        '`time: {channel: "<that column>", rate: 5 kHz}`.'
    )


def _counted(source: Source, rate: float, place: str) -> TimeSource:
    """Count samples at a rate (Hz) that `place` gives: by the column that numbers them, else row by row."""
    counter = _counter(source)
    if counter is not None:
        note = f"{source.where}: time is '{counter}', which numbers the samples, over the {rate:.6g} Hz that {place} gives."
        return TimeSource(counter, "1", stated=True, rate=rate, notes=(QualityFinding("note", note),))
    if place == "the recipe":
        return TimeSource(None, rate=rate)
    note = f"{source.where}: no channel is time, so samples are counted at {rate:.6g} Hz, which {place} gives."
    return TimeSource(None, rate=rate, notes=(QualityFinding("warning", note),))


def _counter(source: Source) -> str | None:
    """Return the column that numbers the samples, by its name and its first rows; rows lost on the way are missing in it."""
    names = {plain(channel.name): channel.name for channel in source.table.channels if not channel.is_text}
    name = next((names[known] for known in _COUNTER_NAMES if known in names), None)
    if name is None:
        return None
    block: Mapping[str, np.ndarray] = next(iter(source.table.blocks([name])), {})
    steps = np.diff(np.asarray(block.get(name, ()), dtype=np.float64))
    return name if steps.size and float(np.median(steps)) == 1.0 else None


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
