"""The reader of TDMS logs (LabVIEW, FlexLogger, DIAdem): `READER` reads them with npTDMS.

Each group is a table; where its channels differ in length or in their waveform's clock, it is as many tables as there are
clocks. A waveform's start and increment are its time; a group without any needs a channel that is time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.column_table import ColumnSource, ColumnTable, is_number
from pipeline.ingest.extras import library
from pipeline.ingest.reader import RawLog, Reader
from pipeline.recording import QualityFinding

_MARKS = (b"TDSm", b"TDSh")
_VERSIONS = {4712: "1.0", 4713: "2.0"}
_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit", "units")
# A channel of this name is added where the waveform's properties are the only clock.
_TIME = "time"
# Properties that tell how samples were taken or stored; no conditions of a run.
_OF_THE_CARRIER = ("wf_", "NI_", "DAQmx", "unit_string", "unit", "Unit", "units", "name")

_Clock = tuple[int, float | None, float, str]


class TdmsReader(Reader):
    """Reads TDMS files of version 1 and 2."""

    name = "tdms"
    version = 1
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
        notes: list[QualityFinding] = []
        metadata: dict[str, str] = {}
        tables: list[ColumnTable] = []
        with _opened(path) as file:
            metadata |= _conditions(file.properties, "")
            for group in file.groups():
                metadata |= _conditions(group.properties, "")
                for channel in group.channels():
                    metadata |= _conditions(channel.properties, f"{channel.name}.")
                tables += _tables(path, group, notes)
            incomplete = getattr(file.file_status, "incomplete_final_segment", False)
            version = _VERSIONS.get(file.tdms_version, str(file.tdms_version))
        if not tables:
            raise InputError(f"{path}: this TDMS file holds no channel with samples. Was the recording started?")
        if incomplete:
            text = f"{path.name}: the last segment of this TDMS file is cut off; what was written of it is read."
            notes.append(QualityFinding("warning", text))
        _name_tables(tables)
        return RawLog(path, "TDMS", tables, metadata, {"version": version}, tuple(notes))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file; whatever npTDMS stumbles over in a broken one is an InputError."""
    tdms = library("nptdms", "tdms", path, "a TDMS log (LabVIEW)")
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


def _tables(path: Path, group: Any, notes: list[QualityFinding]) -> list[ColumnTable]:
    """Return the tables of a group: one for each clock."""
    by_clock: dict[_Clock, list[Any]] = {}
    for channel in group.channels():
        if len(channel) == 0:
            notes.append(QualityFinding("note", f"the channel '{group.name}/{channel.name}' is empty, left out."))
            continue
        by_clock.setdefault(_clock(channel), []).append(channel)
    return [_table(path, group.name, clock, channels) for clock, channels in by_clock.items()]


def _clock(channel: Any) -> _Clock:
    """Return number of samples, increment (s; None without), offset (s) and start (text) of a channel's waveform."""
    properties = channel.properties
    increment = properties.get("wf_increment")
    usable = isinstance(increment, int | float) and np.isfinite(increment) and increment > 0
    start = properties.get("wf_start_time")
    begins = "" if start is None or not usable else str(np.datetime64(start, "ns"))
    # LabVIEW writes 1904 where it knows no date.
    begins = "" if begins.startswith("1904-01-01T00:00:00.000") or begins == "NaT" else begins
    offset = float(properties.get("wf_start_offset") or 0.0)
    return len(channel), float(increment) if usable else None, offset if usable else 0.0, begins


def _table(path: Path, group: str, clock: _Clock, channels: list[Any]) -> ColumnTable:
    rows, increment, offset, begins = clock
    columns = [_column(group, channel) for channel in channels]
    time = None
    if increment is not None:
        time = _TIME if all(column.name != _TIME for column in columns) else f"{_TIME} of the waveform"
        step = increment
        columns.insert(0, ColumnSource(time, "s", lambda _file, start, stop: offset + step * np.arange(start, stop)))
    dates = [column for column in columns if column.is_date]
    first = None
    if time is None and len(dates) == 1:
        time = dates[0].name
        with _opened(path) as file:
            first = np.datetime64(dates[0].read(file, 0, 1)[0])
    return ColumnTable(group, columns, rows, lambda: _opened(path), time, begins or None, first)


def _column(group: str, channel: Any) -> ColumnSource:
    name, dtype = channel.name, np.dtype(channel.dtype) if channel.dtype is not None else np.dtype(object)
    unit = next((str(channel.properties[key]) for key in _UNITS if channel.properties.get(key)), None)

    def read(file: Any, start: int, stop: int) -> np.ndarray:
        return np.asarray(file[group][name].read_data(start, stop - start))

    return ColumnSource(name, unit, read, is_text=not is_number(dtype) and dtype.kind != "M", is_date=dtype.kind == "M")


def _conditions(properties: Mapping[str, Any], prefix: str) -> dict[str, str]:
    return {
        f"{prefix}{key}": str(value)
        for key, value in properties.items()
        if not key.startswith(_OF_THE_CARRIER) and value is not None and str(value).strip()
    }


def _name_tables(tables: list[ColumnTable]) -> None:
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
