"""The reader of HDF5 logs: `READER` reads them with h5py; MATLAB's version 7.3 is read by `pipeline.ingest.matlab`.

Data sets of one length in one group share a table; columns of a matrix are numbered from 1, members of records dotted.
Units are their attributes; other attributes and single values are what the log says of itself. A time that stands alone in
a group of its own is that of the groups as long that have none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError, counted, listing
from pipeline.ingest.ahead import refuse_fatal
from pipeline.ingest.column_table import ColumnSource, ColumnTable
from pipeline.ingest.delimited.header import names_time
from pipeline.ingest.extras import library
from pipeline.ingest.hdf5_columns import (
    MOST_COLUMNS,
    OF_THE_NUMBERS,
    UNITS,
    columns_of,
    date_of,
    is_column,
    members_of,
    unit_of,
    word,
)
from pipeline.ingest.misnamed import misnamed
from pipeline.ingest.reader import RawLog, Reader
from pipeline.ingest.unpacking import HARMLESS, is_beyond_belief
from pipeline.recording import QualityFinding

MARK = b"\x89HDF\r\n\x1a\n"
# Shorter data sets beside longer ones are parameters, not signals.
_SHORTEST_SIGNAL = 4
_MOST_SHOWN = 16
_MOST_SETS = 10_000
_LAST_MARK = 4096
# A chunk is unpacked as a whole.
LARGEST_PART = HARMLESS


@dataclass
class _Contents:
    """What a file holds: columns by group and length, what it says of itself, what is left out.

    `since` gives, by group and length, the column that counts from a date, and that date.
    """

    columns: dict[tuple[str, int], list[ColumnSource]] = field(default_factory=dict)
    since: dict[tuple[str, int], tuple[str, str]] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    sets: int = 0
    unpacked: int = 0


class Hdf5Reader(Reader):
    """Reads HDF5 files, also those behind a block of another program's."""

    name = "hdf5"
    version = 4
    suffixes = (".h5", ".hdf5", ".hdf", ".nc")

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by the mark; a file named so is taken too, to say what is wrong with it."""
        return _has_mark(head) or suffix in self.suffixes

    def open(self, path: Path) -> RawLog:
        """Walk through the groups and list what is in them.

        Raises
        ------
        InputError
            If h5py is not installed, or the file is broken or holds no vector of numbers.
        """
        with path.open("rb") as file:
            head = file.read(_LAST_MARK + len(MARK))
        if head.startswith(b"CDF"):
            raise InputError(
                f"{path}: is a netCDF file of the classic format, which is not read; write it as netCDF 4 (HDF5): "
                f"nccopy -k nc4 {path.name} new.nc"
            )
        if not _has_mark(head):
            raise misnamed(path, "HDF5 file")
        library("h5py", "hdf5", path, "an HDF5 file")
        refuse_fatal(path, "HDF5", lambda: _contents_of(path))
        contents = _contents_of(path)
        shared = _share_times(contents)
        tables = [_table(path, contents, at) for at in contents.columns]
        tables = [table for table in tables if any(not channel.is_text for channel in table.channels)]
        if not tables:
            words = [name for columns in contents.columns.values() for name in (c.name for c in columns)]
            names = [*contents.metadata, *words, *contents.left_out]
            found = listing(names, 8) if names else "nothing"
            raise InputError(f"{path}: this HDF5 file holds no vector of numbers to read as a channel; it has {found}.")
        _name(tables)
        notes = shared + [
            QualityFinding("note", f"a data set was left out: {text}.") for text in contents.left_out[:_MOST_SHOWN]
        ]
        if len(contents.left_out) > _MOST_SHOWN:
            notes.append(
                QualityFinding("note", f"{counted(len(contents.left_out) - _MOST_SHOWN, 'more data set')} left out.")
            )
        return RawLog(path, "HDF5", tables, contents.metadata, {"data sets": str(contents.sets)}, tuple(notes))


def _contents_of(path: Path) -> _Contents:
    contents = _Contents()
    with opened(path) as file:
        _attributes(contents, file, "")
        _walk(contents, file, "", {_identity(file)})
    return contents


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open a file for reading; whatever h5py stumbles over in a broken one is an InputError."""
    h5py = library("h5py", "hdf5", path, "an HDF5 file")
    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except InputError:
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        said = str(error).splitlines()[0][:160] if str(error) else type(error).__name__
        raise InputError(
            f"{path}: this HDF5 file is broken or was cut off ({said}). Copy it or write it again."
        ) from error


def _identity(of: Any) -> tuple[int, int]:
    """Return what tells an object of a file whatever the name that it was reached by."""
    import h5py

    info = h5py.h5o.get_info(of.id)
    return info.fileno, info.addr


def _walk(contents: _Contents, group: Any, place: str, seen: set[tuple[int, int]]) -> None:
    """List the data sets of a group and of those in it; links to other files are not followed.

    A group of several names (one may stand within itself) is read once. A data set is read under each of its names:
    groups share their times so.
    """
    import h5py

    for name in group:
        link = group.get(name, getlink=True)
        path = f"{place}/{name}" if place else str(name)
        if not isinstance(link, h5py.HardLink):
            contents.left_out.append(f"{path} (a link)")
            continue
        found = group[name]
        if isinstance(found, h5py.Group):
            if (identity := _identity(found)) in seen:
                contents.left_out.append(f"{path} (another name of a group that is read)")
                continue
            seen.add(identity)
            _attributes(contents, found, path.replace("/", ".") + ".")
            _walk(contents, found, path, seen)
        elif isinstance(found, h5py.Dataset):
            contents.sets += 1
            if contents.sets > _MOST_SETS:
                raise InputError(
                    f"{group.file.filename}: holds more than {_MOST_SETS} data sets; a log of signals has fewer."
                )
            _refuse_bomb(contents, found)
            _sort(contents, found, place, str(name))


def _refuse_bomb(contents: _Contents, data: Any) -> None:
    """Refuse a file whose data sets come to far more than its bytes, or of which one part does not fit into memory."""
    path = Path(data.file.filename)
    contents.unpacked += (data.size or 0) * data.dtype.itemsize
    part = math.prod(data.chunks or ()) * data.dtype.itemsize
    if is_beyond_belief(path.stat().st_size, contents.unpacked) or part > LARGEST_PART:
        raise InputError(
            f"{path}: says that its {path.stat().st_size} bytes hold {max(part, contents.unpacked)} (data set '{data.name}'), which is "
            "refused: no log unpacks to so much. Write the log again, without what was never measured."
        )


def _sort(contents: _Contents, data: Any, place: str, name: str) -> None:
    """Put one data set where it belongs."""
    full = (f"{place}/{name}" if place else name).replace("/", ".")
    if data.shape is None or data.size == 0:
        contents.left_out.append(f"{full} (empty)")
    elif data.size == 1:
        value = np.asarray(data[()]).reshape(-1)[0]
        if data.dtype.names is None:
            contents.metadata[full] = _with_unit(word(value), unit_of(data))
        _attributes(contents, data, f"{full}.")
    elif data.ndim == 1 and data.shape[0] < _SHORTEST_SIGNAL and data.dtype.names is None:
        contents.metadata[full] = " ".join(word(value) for value in data[()])
    elif data.dtype.names is not None and data.ndim == 1:
        found, left_out = members_of(data)
        contents.columns.setdefault((f"{place}/{name}".strip("/"), data.shape[0]), []).extend(found)
        contents.left_out += [f"{full}.{member}" for member in left_out]
    elif is_column(data.dtype) and (data.ndim == 1 or (data.ndim == 2 and min(data.shape) <= MOST_COLUMNS)):
        contents.columns.setdefault((place, max(data.shape)), []).extend(columns_of(data, name))
        if (date := date_of(data)) is not None:
            contents.since[place, max(data.shape)] = (name, date)
        _attributes(contents, data, f"{full}.")
    else:
        shape = " x ".join(map(str, data.shape))
        contents.left_out.append(f"{full} (an array of {shape} of type {data.dtype})")


def _share_times(contents: _Contents) -> list[QualityFinding]:
    """Give groups without a time the one time of their length that stands alone in a group, and say so."""
    alone = {
        at: columns[0]
        for at, columns in contents.columns.items()
        if len(columns) == 1 and not columns[0].is_text and names_time([columns[0].name])
    }
    said: list[QualityFinding] = []
    shared: set[tuple[str, int]] = set()
    for at, columns in contents.columns.items():
        fitting = [axis for axis in alone if axis[1] == at[1]]
        if at in alone or len(fitting) != 1 or names_time([column.name for column in columns]):
            continue
        axis, time = fitting[0], alone[fitting[0]]
        columns.insert(0, time)
        if axis in contents.since:
            contents.since[at] = contents.since[axis]
        shared.add(axis)
        group = at[0] or "/"
        text = f"the group '{group}' has no time; '{axis[0]}/{time.name}', which is as long, is taken for it."
        said.append(QualityFinding("note", text))
    for axis in shared:
        del contents.columns[axis]
    return said


def _table(path: Path, contents: _Contents, at: tuple[str, int]) -> ColumnTable:
    group, rows = at
    time, begins = contents.since.get(at, (None, None))
    if begins is not None:
        try:
            begins = datetime.fromisoformat(begins.removesuffix("UTC").strip()).isoformat()
        except ValueError:
            time = begins = None
    return ColumnTable(group, contents.columns[at], rows, lambda: opened(path), time, begins)


def _has_mark(head: bytes) -> bool:
    """Tell by the mark, which may stand behind a block of 512 bytes or a power of two more; MATLAB's files are not meant."""
    if head.startswith(b"MATLAB"):
        return False
    return any(head[at : at + len(MARK)] == MARK for at in (0, 512, 1024, 2048, _LAST_MARK))


def _name(tables: list[ColumnTable]) -> None:
    """Give tables of one group the numbers of their rows; none to the only table."""
    if len(tables) == 1:
        tables[0].name = ""
        return
    names = [table.name for table in tables]
    for table in tables:
        if names.count(table.name) > 1 or not table.name:
            table.name = f"{table.name} {table.rows} rows".strip()


def _attributes(contents: _Contents, of: Any, prefix: str) -> None:
    for key, value in of.attrs.items():
        if key in (*UNITS, *OF_THE_NUMBERS) or key.isupper() or key.startswith(("MATLAB_", "_", "DIMENSION")):
            continue
        if isinstance(value, str | bytes | int | float | np.generic) or (
            isinstance(value, np.ndarray) and value.size == 1
        ):
            text = word(np.asarray(value).reshape(-1)[0])
            if text and len(text) <= 200:
                contents.metadata[f"{prefix}{key}"] = text


def _with_unit(text: str, unit: str | None) -> str:
    return f"{text} {unit}" if unit else text


READER = Hdf5Reader()
