"""The reader of TDMS logs (LabVIEW, FlexLogger, DIAdem): `READER` reads them with npTDMS.

Each group is a table; where its channels differ in length or in their waveform's clock, it is as many tables as there are
clocks. A waveform's start and increment are its time; a group without any needs a channel that is time. What a cut-off
last segment lacks of some channels makes no other clock: rows are read as far as every channel of their table has them.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError, counted, listing
from pipeline.ingest.column_table import ColumnSource, ColumnTable, is_number
from pipeline.ingest.extras import library
from pipeline.ingest.misnamed import misnamed
from pipeline.ingest.reader import BLOCK_ROWS, RawLog, Reader
from pipeline.ingest.tdms_samples import Held, Whole
from pipeline.recording import QualityFinding

_MARKS = (b"TDSm", b"TDSh")
_VERSIONS = {4712: "1.0", 4713: "2.0"}
_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit", "units")
# A channel of this name is added where the waveform's properties are the only clock.
_TIME = "time"
# Properties that tell how samples were taken or stored; no conditions of a run.
_OF_THE_CARRIER = ("wf_", "NI_", "DAQmx", "unit_string", "unit", "Unit", "units", "name")

# Shorter channels beside longer ones are parameters, not signals.
_SHORTEST_SIGNAL = 4

_Clock = tuple[int, float | None, float, str]


class TdmsReader(Reader):
    """Reads TDMS files of version 1 and 2."""

    name = "tdms"
    version = 3
    suffixes = (".tdms",)

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by the mark of the first segment; a file named .tdms is taken too, to say what is wrong with it."""
        return head.startswith(_MARKS) or suffix in self.suffixes

    def open(self, path: Path) -> RawLog:
        """Read the metadata and sort the channels into tables.

        Raises
        ------
        InputError
            If npTDMS is not installed, or the file is broken or holds no channel with samples.
        """
        with path.open("rb") as file:
            if not file.read(len(_MARKS[0])).startswith(_MARKS):
                raise misnamed(path, "TDMS file")
        notes: list[QualityFinding] = []
        metadata = _Said()
        tables: list[TdmsTable] = []
        with _opened(path) as file:
            metadata.take(file.properties)
            for group in file.groups():
                metadata.take(group.properties, group=group.name)
                for channel in group.channels():
                    metadata.take(channel.properties, channel.name, group.name)
            signals = any(len(channel) >= _SHORTEST_SIGNAL for group in file.groups() for channel in group.channels())
            lacking = _lacking(file)
            for group in file.groups():
                for clock, channels in _by_clock(group, lacking, notes).items():
                    if signals and _are_parameters(clock, channels):
                        metadata.values(group.name, channels)
                    elif clock[1] is None and all(_is_text(channel) for channel in channels):
                        notes.append(_said_words(group.name, channels))
                    else:
                        tables.append(_table(path, group.name, clock, channels))
            incomplete = getattr(file.file_status, "incomplete_final_segment", False)
            version = _VERSIONS.get(file.tdms_version, str(file.tdms_version))
        if not tables:
            raise InputError(f"{path}: this TDMS file holds no channel with samples. Was the recording started?")
        if incomplete:
            notes.append(_said_cut(path, tables))
        _name_tables(tables)
        return RawLog(path, "TDMS", tables, metadata.found, {"version": version}, tuple(notes))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file; whatever npTDMS stumbles over in a broken one is an InputError."""
    tdms = library("nptdms", "tdms", path, "a TDMS log (LabVIEW)")
    tdms.log.log_manager.set_level(logging.CRITICAL)  # what it would print, the reader tells
    try:
        with tdms.TdmsFile.open(path) as file:
            yield file
    except InputError:
        raise
    except Exception as error:  # npTDMS has no error of its own for broken files: struct, key, value, memory errors
        raise InputError(
            f"{path}: this TDMS file is broken or was cut off ({type(error).__name__}: {error}). Copy it again, without its "
            ".tdms_index beside it."
        ) from error


@contextmanager
def _group(path: Path, group: str) -> Iterator[Whole]:
    with _opened(path) as file:
        yield Whole(path, file, group)


class TdmsTable(ColumnTable):
    """Channels of a group with one clock; `lost` are the rows that a cut-off last segment lacks, at least of one channel."""

    lost = 0

    def passing(self, file: Any, wanted: Mapping[str, ColumnSource]) -> Iterator[tuple[Any, int, int]]:
        """Yield the samples as the file's segments have them, where these are many and small."""
        channels = {column.of for column in wanted.values() if column.of}
        for held in file.passes(channels, BLOCK_ROWS):
            if held.start < self.rows:  # these channels may have samples that others of the table have lost
                yield held, held.start, min(held.start + held.rows, self.rows)


class _Said:
    """What properties say of the run; names that several groups or channels give with different values bear theirs."""

    def __init__(self) -> None:
        self.found: dict[str, str] = {}

    def take(self, properties: Mapping[str, Any], channel: str = "", group: str = "") -> None:
        for key, value in properties.items():
            if not key.startswith(_OF_THE_CARRIER) and value is not None:
                self._put(f"{channel}.{key}" if channel else key, group, str(value).strip())

    def values(self, group: str, channels: list[Any]) -> None:
        """Take in channels that are too short to be signals."""
        for channel in channels:
            words = " ".join(str(value) for value in np.asarray(channel[:]).tolist())
            self._put(channel.name, group, f"{words} {_unit(channel) or ''}".strip())

    def _put(self, key: str, group: str, text: str) -> None:
        full = f"{group}.{key}" if group and self.found.get(key, text) != text else key
        if text:
            self.found.setdefault(full, text)


def _lacking(file: Any) -> dict[str, int]:
    """Return how many samples a cut-off last segment lacks of its channels, by their paths."""
    found = file.file_status.channel_statuses or {}
    return {path: int(status.expected_length - status.read_length) for path, status in found.items()}


def _by_clock(group: Any, lacking: Mapping[str, int], notes: list[QualityFinding]) -> dict[_Clock, list[Any]]:
    """Return the channels of a group by what they share: number of samples that were to be, increment, start."""
    by_clock: dict[_Clock, list[Any]] = {}
    for channel in group.channels():
        if len(channel) == 0:
            notes.append(QualityFinding("note", f"the channel '{group.name}/{channel.name}' is empty, left out."))
            continue
        by_clock.setdefault(_clock(channel, lacking.get(channel.path, 0)), []).append(channel)
    return by_clock


def _are_parameters(clock: _Clock, channels: list[Any]) -> bool:
    """Tell whether channels beside longer ones are too short to be signals, and have no time of their own."""
    rows, increment, _, _ = clock
    return (
        rows < _SHORTEST_SIGNAL and increment is None and not any(_dtype(channel).kind == "M" for channel in channels)
    )


def _said_words(group: str, channels: list[Any]) -> QualityFinding:
    names = listing((f"'{group}/{channel.name}'" for channel in channels), 5)
    return QualityFinding("note", f"without a time of their own, words are left out: {names}.")


def _said_cut(path: Path, tables: list[TdmsTable]) -> QualityFinding:
    """Tell that the last segment is cut off, and what is lost with it."""
    text = f"{path.name}: the last segment of this TDMS file is cut off; what was written of it is read."
    lost = [
        f" Group '{table.name}': {counted(table.rows, 'row')}, as far as each of its channels goes, at least "
        f"{counted(table.lost, 'row')} lost."
        for table in tables
        if table.lost
    ]
    return QualityFinding("warning", text + "".join(lost))


def _clock(channel: Any, lacking: int) -> _Clock:
    """Return number of samples, increment (s; None without), offset (s) and start (text) of a channel's waveform.

    `lacking` are samples that a cut-off segment lacks; they count.
    """
    properties = channel.properties
    increment = properties.get("wf_increment")
    usable = isinstance(increment, int | float) and np.isfinite(increment) and increment > 0
    start = properties.get("wf_start_time")
    begins = "" if start is None or not usable else str(np.datetime64(start, "ns"))
    # LabVIEW writes 1904 where it knows no date.
    begins = "" if begins.startswith("1904-01-01T00:00:00.000") or begins == "NaT" else begins
    offset = float(properties.get("wf_start_offset") or 0.0)
    return len(channel) + lacking, float(increment) if usable else None, offset if usable else 0.0, begins


def _table(path: Path, group: str, clock: _Clock, channels: list[Any]) -> TdmsTable:
    expected, increment, offset, begins = clock
    rows = min(len(channel) for channel in channels)
    columns = [column for channel in channels for column in _columns(channel)]
    time = None
    if increment is not None:
        time = _TIME if all(column.name != _TIME for column in columns) else f"{_TIME} of the waveform"
        step = increment
        columns.insert(0, ColumnSource(time, "s", lambda _file, start, stop: offset + step * np.arange(start, stop)))
    dates = [column for column in columns if column.is_date]
    first = None
    if time is None and len(dates) == 1:
        time = dates[0].name
        with _group(path, group) as whole:
            first = np.datetime64(dates[0].read(whole, 0, 1)[0])
    table = TdmsTable(group, columns, rows, lambda: _group(path, group), time, begins or None, first)
    table.lost = expected - rows
    return table


def _columns(channel: Any) -> list[ColumnSource]:
    """Return a channel as a column, a complex one as its two parts."""
    name, dtype = channel.name, _dtype(channel)

    def read(source: Whole | Held, start: int, stop: int) -> np.ndarray:
        return source.samples(name, start, stop)

    if dtype.kind == "c":
        return [
            ColumnSource(
                f"{name}.real", _unit(channel), lambda source, start, stop: read(source, start, stop).real, of=name
            ),
            ColumnSource(
                f"{name}.imag", _unit(channel), lambda source, start, stop: read(source, start, stop).imag, of=name
            ),
        ]
    return [ColumnSource(name, _unit(channel), read, is_text=_is_text(channel), is_date=dtype.kind == "M", of=name)]


def _dtype(channel: Any) -> np.dtype[Any]:
    return np.dtype(channel.dtype) if channel.dtype is not None else np.dtype(object)


def _is_text(channel: Any) -> bool:
    dtype = _dtype(channel)
    return not is_number(dtype) and dtype.kind not in "Mc"


def _unit(channel: Any) -> str | None:
    return next((str(channel.properties[key]) for key in _UNITS if channel.properties.get(key)), None)


def _name_tables(tables: list[TdmsTable]) -> None:
    """Give each table its group's name, with a number where a group became several; none to the only one."""
    if len(tables) == 1:
        tables[0].name = ""
        return
    taken: dict[str, int] = {}
    for table in tables:
        taken[table.name] = count = taken.get(table.name, 0) + 1
        if count > 1:
            table.name = f"{table.name} {count}"


READER = TdmsReader()
