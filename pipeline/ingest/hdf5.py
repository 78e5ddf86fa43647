"""The reader of HDF5 logs: `READER` reads them with h5py; MATLAB's version 7.3 is read by `pipeline.ingest.matlab`.

Data sets of one length in one group share a table; columns of a matrix are numbered from 1, members of records dotted.
Units are their attributes; other attributes and single values are what the log says of itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError, counted
from pipeline.ingest.column_table import ColumnSource, ColumnTable, is_number
from pipeline.ingest.extras import library
from pipeline.ingest.reader import RawLog, Reader
from pipeline.recording import QualityFinding

MARK = b"\x89HDF\r\n\x1a\n"
_UNITS = ("units", "unit", "Units", "Unit", "UNITS")
_MOST_COLUMNS = 64
# Shorter data sets beside longer ones are parameters, not signals.
_SHORTEST_SIGNAL = 4
_MOST_SHOWN = 16
_MOST_SETS = 10_000


@dataclass
class _Contents:
    """What a file holds: columns by group and length, what it says of itself, what is left out."""

    columns: dict[tuple[str, int], list[ColumnSource]] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    sets: int = 0


class Hdf5Reader(Reader):
    """Reads HDF5 files whose mark stands at the front."""

    name = "hdf5"
    version = 1
    suffixes = (".h5", ".hdf5", ".hdf", ".nc")

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by the mark; a file named so is taken too, to say what is wrong with it."""
        return head.startswith(MARK) or suffix in self.suffixes

    def open(self, path: Path) -> RawLog:
        """Walk through the groups and list what is in them.

        Raises
        ------
        InputError
            If h5py is not installed, or the file is broken or holds no vector of numbers.
        """
        contents = _Contents()
        with opened(path) as file:
            _attributes(contents, file, "")
            _walk(contents, file, "")
        tables = [_table(path, group, rows, columns) for (group, rows), columns in contents.columns.items()]
        tables = [table for table in tables if any(not channel.is_text for channel in table.channels)]
        if not tables:
            raise InputError(f"{path}: this HDF5 file holds no vector of numbers to read as a channel.")
        _name(tables)
        notes = [
            QualityFinding("note", f"a data set was left out: {text}.") for text in contents.left_out[:_MOST_SHOWN]
        ]
        if len(contents.left_out) > _MOST_SHOWN:
            notes.append(
                QualityFinding("note", f"{counted(len(contents.left_out) - _MOST_SHOWN, 'more data set')} left out.")
            )
        return RawLog(path, "HDF5", tables, contents.metadata, {"data sets": str(contents.sets)}, tuple(notes))


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


def _walk(contents: _Contents, group: Any, place: str) -> None:
    """List the data sets of a group and of those in it; links to other files are not followed."""
    import h5py

    for name in group:
        link = group.get(name, getlink=True)
        path = f"{place}/{name}" if place else str(name)
        if not isinstance(link, h5py.HardLink):
            contents.left_out.append(f"{path} (a link)")
            continue
        found = group[name]
        if isinstance(found, h5py.Group):
            _attributes(contents, found, path.replace("/", ".") + ".")
            _walk(contents, found, path)
        elif isinstance(found, h5py.Dataset):
            contents.sets += 1
            if contents.sets > _MOST_SETS:
                raise InputError(
                    f"{group.file.filename}: holds more than {_MOST_SETS} data sets; a log of signals has fewer."
                )
            _sort(contents, found, place, str(name))


def _sort(contents: _Contents, data: Any, place: str, name: str) -> None:
    """Put one data set where it belongs."""
    full = (f"{place}/{name}" if place else name).replace("/", ".")
    if data.shape is None or data.size == 0:
        contents.left_out.append(f"{full} (empty)")
    elif data.size == 1:
        value = np.asarray(data[()]).reshape(-1)[0]
        if data.dtype.names is None:
            contents.metadata[full] = _with_unit(_word(value), _unit(data))
        _attributes(contents, data, f"{full}.")
    elif data.ndim == 1 and data.shape[0] < _SHORTEST_SIGNAL and data.dtype.names is None:
        contents.metadata[full] = " ".join(_word(value) for value in data[()])
    elif data.dtype.names is not None and data.ndim == 1:
        contents.columns.setdefault((f"{place}/{name}".strip("/"), data.shape[0]), []).extend(
            _members(contents, data, full)
        )
    elif _is_column(data.dtype) and (data.ndim == 1 or (data.ndim == 2 and min(data.shape) <= _MOST_COLUMNS)):
        contents.columns.setdefault((place, max(data.shape)), []).extend(_columns(data, name))
        _attributes(contents, data, f"{full}.")
    else:
        shape = " x ".join(map(str, data.shape))
        contents.left_out.append(f"{full} (an array of {shape} of type {data.dtype})")


def _columns(data: Any, name: str) -> list[ColumnSource]:
    """Return a vector, or the columns of a matrix: by rows where it has few rows and many columns."""
    where, unit, text = data.name, _unit(data), not is_number(data.dtype)
    if data.ndim == 1:
        return [ColumnSource(name, unit, lambda file, start, stop: file[where][start:stop], is_text=text)]
    lies = data.shape[0] < data.shape[1]

    def of(index: int) -> Callable[[Any, int, int], np.ndarray]:
        return lambda file, start, stop: file[where][index, start:stop] if lies else file[where][start:stop, index]

    count = min(data.shape)
    names = [name] if count == 1 else [f"{name}_{at + 1}" for at in range(count)]
    return [ColumnSource(called, unit, of(at), is_text=text) for at, called in enumerate(names)]


def _members(contents: _Contents, data: Any, full: str) -> list[ColumnSource]:
    """Return the columns of a table of records; a member that is a vector has numbered columns."""
    where, columns = data.name, []

    def of(member: str, index: int | None) -> Callable[[Any, int, int], np.ndarray]:
        def read(file: Any, start: int, stop: int) -> np.ndarray:
            values = file[where][member, start:stop]
            return np.asarray(values if index is None else values[:, index])

        return read

    for member in data.dtype.names:
        kind = data.dtype[member]
        base = kind.base
        if not _is_column(base) or (kind.shape and (len(kind.shape) > 1 or kind.shape[0] > _MOST_COLUMNS)):
            contents.left_out.append(f"{full}.{member} (of type {kind})")
            continue
        text = not is_number(base)
        if not kind.shape:
            columns.append(ColumnSource(member, None, of(member, None), is_text=text))
        else:
            columns += [
                ColumnSource(f"{member}_{k + 1}", None, of(member, k), is_text=text) for k in range(kind.shape[0])
            ]
    return columns


def _is_column(dtype: Any) -> bool:
    import h5py

    return is_number(dtype) or dtype.kind in "SU" or h5py.check_string_dtype(dtype) is not None


def _table(path: Path, group: str, rows: int, columns: list[ColumnSource]) -> ColumnTable:
    return ColumnTable(group, columns, rows, lambda: opened(path))


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
        if key in _UNITS or key.isupper() or key.startswith(("MATLAB_", "_", "DIMENSION")):
            continue
        if isinstance(value, str | bytes | int | float | np.generic) or (
            isinstance(value, np.ndarray) and value.size == 1
        ):
            text = _word(np.asarray(value).reshape(-1)[0])
            if text and len(text) <= 200:
                contents.metadata[f"{prefix}{key}"] = text


def _unit(data: Any) -> str | None:
    for key in _UNITS:
        if key in data.attrs:
            value = np.asarray(data.attrs[key]).reshape(-1)
            return (_word(value[0]).strip() or None) if value.size else None
    return None


def _word(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return str(value.item() if isinstance(value, np.generic) else value)


def _with_unit(text: str, unit: str | None) -> str:
    return f"{text} {unit}" if unit else text


READER = Hdf5Reader()
