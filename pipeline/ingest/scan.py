"""What `rigfit check` shows: what logs hold and what is wrong with them, without writing anything.

Nothing here raises for a fault inside a log that was opened: it becomes a finding of level error, and
whatever can still be shown is shown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.errors import InputError
from pipeline.ingest.clock import TimeSource, align
from pipeline.ingest.ingest import open_run, opened
from pipeline.ingest.mapping import ChannelMap, SelectedChannel, Selection, Source, refuse_time_alone, resolve
from pipeline.ingest.naming import ChannelLike
from pipeline.ingest.passage import Passage
from pipeline.ingest.quality import StreamSummary, summed
from pipeline.ingest.reader import RawChannel, RawLog
from pipeline.ingest.stream import StreamInSI
from pipeline.ingest.timebase import find_times
from pipeline.recording import QualityFinding
from pipeline.recording.units import conversion

# Time of a table that has none: the number of the row.
_COUNTED = TimeSource(None, rate=1.0)


@dataclass(frozen=True)
class TableScan:
    """One table: the file and its own name, where its time comes from, and its numbers.

    `time` is None where there is none of use; rows were then counted as seconds. `begins` is the date of the first row,
    seconds since 1970, None where the times have none. Channels of `summary` bear canonical
    names where they are mapped (`mapped`) and the log's own names otherwise.
    """

    file: str
    table: str
    time: TimeSource | None
    summary: StreamSummary
    mapped: frozenset[str]
    begins: float | None = None


@dataclass(frozen=True)
class RunScan:
    """What the logs of one run hold: the opened logs, their tables, and what is to be said of them."""

    logs: tuple[RawLog, ...]
    tables: tuple[TableScan, ...]
    quality: tuple[QualityFinding, ...]


def scan_log(path: Path, specs: Sequence[ChannelLike] = (), maps: Mapping[str, ChannelMap] | None = None) -> RunScan:
    """Scan one log, see `scan_run`."""
    return scan_run([("", path)], specs, maps)


def scan_run(
    files: Sequence[tuple[str, Path]],
    specs: Sequence[ChannelLike] = (),
    maps: Mapping[str, ChannelMap] | None = None,
    shown: Mapping[str, str] | None = None,
) -> RunScan:
    """Read the logs of one run once and say what they hold.

    Parameters
    ----------
    files
        (stream, path) of each log, as in `pipeline.ingest.ingest.ingest_run`.
    specs
        Channels of an experiment; without them all channels are shown under their own names.
    maps
        The recipe's entries.
    shown
        By stream, the path as messages give it; the file's name without.

    Raises
    ------
    InputError
        If a log cannot be opened at all.
    """
    opened_logs, quality = open_run(files, shown)
    sources = opened(opened_logs, shown)
    logs = {id(source.log): source.log for source in sources}
    for log in logs.values():
        quality += log.notes
    selections = _selections(sources, specs, maps or {}, quality)
    times = _times(sources, (maps or {}).get("time"), quality)
    streams = [
        StreamInSI(_whole(selection, time, quality), time or _COUNTED)
        for selection, time in zip(selections, times, strict=True)
    ]
    align([stream.clock for stream in streams])
    tables = []
    for selection, time, stream in zip(selections, times, streams, strict=True):
        mapped = frozenset(channel.name for channel in selection.channels)
        summary, sound = _pass(stream, quality)
        source = selection.source
        used = time if sound else None
        begins = stream.clock.begins if used is not None else None
        tables.append(TableScan(source.shown, source.table.name, used, summary, mapped, begins))
    return RunScan(tuple(logs.values()), tuple(tables), tuple(summed(quality)))


def _selections(
    sources: Sequence[Source],
    specs: Sequence[ChannelLike],
    maps: Mapping[str, ChannelMap],
    quality: list[QualityFinding],
) -> list[Selection]:
    """Map each declared channel by itself, so that all that is missing is said."""
    chosen = [Selection(source, ()) for source in sources]
    try:
        refuse_time_alone(sources)
    except InputError as error:
        quality.append(QualityFinding("error", str(error)))
        return chosen
    for spec in specs:
        try:
            found = resolve(sources, [spec], maps)
        except InputError as error:
            quality.append(QualityFinding("error", str(error), channel=spec.name))
            continue
        for selection in found:
            at = next(i for i, source in enumerate(sources) if source is selection.source)
            before = chosen[at]
            chosen[at] = replace(
                before, channels=before.channels + selection.channels, notes=before.notes + selection.notes
            )
    return chosen


def _times(
    sources: Sequence[Source], entry: ChannelMap | None, quality: list[QualityFinding]
) -> list[TimeSource | None]:
    """Find the time of each table; None where there is none, which is said."""
    try:
        return list(find_times(sources, entry))
    except InputError as error:
        if entry is not None:
            quality.append(QualityFinding("error", str(error)))
    times: list[TimeSource | None] = []
    for source in sources:
        try:
            times += find_times([source], None)
        except InputError as error:
            times.append(None)
            quality.append(QualityFinding("error", str(error)))
    return times


def _pass(stream: StreamInSI, quality: list[QualityFinding]) -> tuple[StreamSummary, bool]:
    """Let a stream pass its checks; where its time is beyond repair its rows are counted, and False returned."""
    passage, sound = Passage(stream.selection.channels), True
    try:
        stream.pass_to(passage)
    except InputError as error:
        quality.append(QualityFinding("error", str(error)))
        passage.restart()
        sound = False
        with suppress(InputError):  # no rows, or none that can be read: said above
            StreamInSI(stream.selection, _COUNTED).pass_to(passage)
    passage.quality.finish()
    quality += [*stream.notes(passage.quality.sampling), *passage.quality.findings()]
    return passage.quality.summary(), sound


def _whole(selection: Selection, time: TimeSource | None, quality: list[QualityFinding]) -> Selection:
    return replace(selection, channels=(*selection.channels, *_others(selection, time, quality)))


def _others(
    selection: Selection, time: TimeSource | None, quality: list[QualityFinding]
) -> tuple[SelectedChannel, ...]:
    """Return the channels that nobody asked for, under their own names, in SI where their unit is known."""
    used = {channel.raw.name for channel in selection.channels}
    names = {channel.name for channel in selection.channels}
    found = []
    for raw in selection.source.table.channels:
        if raw.name in used or (time is not None and raw.name == time.channel):
            continue
        name = f"{raw.name} (log)" if raw.name in names else raw.name
        found.append(_own(name, raw, selection.source, quality))
    return tuple(found)


def _own(name: str, raw: RawChannel, source: Source, quality: list[QualityFinding]) -> SelectedChannel:
    if raw.is_text:
        return SelectedChannel(name, raw, "")
    if not raw.unit:
        return SelectedChannel(name, raw, "1")
    try:
        to_si = conversion(raw.unit, None, f"{source.where}, channel '{raw.name}'")
    except InputError as error:
        if not any(finding.message.startswith(str(error)) for finding in quality):
            quality.append(QualityFinding("warning", str(error), channel=name))
        return SelectedChannel(name, raw, "1", raw.unit)
    return SelectedChannel(name, raw, to_si.unit, raw.unit, to_si.factor, to_si.offset)
