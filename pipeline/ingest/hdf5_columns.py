"""Columns of an HDF5 file's data sets: vectors, matrices, tables of records; packed, complex and named as they were meant."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np

from pipeline.ingest.column_table import ColumnSource, is_number

UNITS = ("units", "unit", "Units", "Unit", "UNITS")
# Attributes that say how numbers are to be read.
OF_THE_NUMBERS = ("scale_factor", "add_offset", "_FillValue", "missing_value")
MOST_COLUMNS = 64
# Times that count from a date, as netCDF has them.
_SINCE = re.compile(r"^\s*(\w+) since (.+)$", re.IGNORECASE)
_TIMES = {
    "days": "d", "hours": "h", "minutes": "min", "seconds": "s", "milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns",
}  # fmt: skip

_Read = Callable[[Any, int, int], Any]


class _Rows:
    """The rows of a data set that were read last: its columns ask for the same ones, one after another."""

    def __init__(self, data: Any, lies: bool = False) -> None:
        self.where, self.lies = data.name, lies
        self.key: tuple[int, int, int] | None = None
        self.values: Any = None

    def __call__(self, file: Any, start: int, stop: int) -> Any:
        key = (id(file), start, stop)
        if key != self.key:
            stored = file[self.where]
            self.key, self.values = key, stored[:, start:stop].T if self.lies else stored[start:stop]
        return self.values


def columns_of(data: Any, name: str) -> list[ColumnSource]:
    """Return a vector, or the columns of a matrix: by rows where it has few rows and many columns."""
    unit = unit_of(data)
    if since := _SINCE.match(unit or ""):
        unit = _TIMES.get(since[1].lower(), since[1])
    where = data.name
    if data.ndim == 1:
        return _column(data, name, unit, lambda file, start, stop: file[where][start:stop])
    lies = data.shape[0] < data.shape[1]
    rows = _Rows(data, lies)
    apart = data.chunks is not None and data.chunks[0 if lies else 1] == 1

    def of(index: int) -> _Read:
        def read(file: Any, start: int, stop: int) -> Any:
            if not apart:
                return rows(file, start, stop)[:, index]
            return file[where][index, start:stop] if lies else file[where][start:stop, index]

        return read

    count = min(data.shape)
    names = _names(data, name, count)
    return [column for at, called in enumerate(names) for column in _column(data, called, unit, of(at))]


def date_of(data: Any) -> str | None:
    """Return the date that a data set counts from, if its unit says so."""
    since = _SINCE.match(unit_of(data) or "")
    return since[2].strip() if since else None


def _names(data: Any, name: str, count: int) -> list[str]:
    """Return the names of a matrix's columns: pandas writes them beside it, else they are numbered."""
    items = data.parent.get(name.replace("_values", "_items")) if name.endswith("_values") else None
    if items is not None and getattr(items, "shape", None) == (count,) and items.dtype.kind in "SO":
        return [word(item) for item in items[()]]
    return [name] if count == 1 else [f"{name}_{at + 1}" for at in range(count)]


def _column(data: Any, name: str, unit: str | None, stored: _Read) -> list[ColumnSource]:
    """Return a column as it was meant, a complex one as its two parts.

    Packed numbers count in steps from an offset, and one of them stands for no value (CF conventions, sections 2.5 and 8.1).
    """
    scale, offset = _attribute(data, "scale_factor"), _attribute(data, "add_offset")
    none = [value for key in ("_FillValue", "missing_value") if (value := _attribute(data, key)) is not None]

    def read(file: Any, start: int, stop: int) -> np.ndarray:
        values = np.asarray(stored(file, start, stop))
        if scale is None and offset is None and not none:
            return values
        missing = np.isin(values, none)
        numbers = values * (1.0 if scale is None else scale) + (0.0 if offset is None else offset)
        return np.where(missing, np.nan, numbers)

    if data.dtype.kind == "c":
        return [
            ColumnSource(f"{name}.real", unit, lambda file, start, stop: read(file, start, stop).real),
            ColumnSource(f"{name}.imag", unit, lambda file, start, stop: read(file, start, stop).imag),
        ]
    if not is_number(data.dtype):
        return [ColumnSource(name, unit, stored, is_text=True)]
    return [ColumnSource(name, unit, read)]


def _attribute(data: Any, key: str) -> float | None:
    """Return an attribute that is one number."""
    value = np.asarray(data.attrs[key]).reshape(-1) if key in data.attrs else np.empty(0)
    return float(value[0]) if value.size == 1 and is_number(value.dtype) else None


def members_of(data: Any) -> tuple[list[ColumnSource], list[str]]:
    """Return the columns of a table of records, and what is none; a member that is a vector has numbered columns."""
    rows = _Rows(data)
    columns: list[ColumnSource] = []
    left_out: list[str] = []
    units = _units_of_members(data)

    def of(member: str, index: int | None) -> Callable[[Any, int, int], np.ndarray]:
        def read(file: Any, start: int, stop: int) -> np.ndarray:
            values = rows(file, start, stop)[member]
            return np.asarray(values if index is None else values[:, index])

        return read

    for member in data.dtype.names:
        kind = data.dtype[member]
        base = kind.base
        if (
            not is_column(base)
            or base.kind == "c"
            or (kind.shape and (len(kind.shape) > 1 or kind.shape[0] > MOST_COLUMNS))
        ):
            left_out.append(f"{member} (of type {kind})")
            continue
        text, unit = not is_number(base), units.get(member)
        if not kind.shape:
            columns.append(ColumnSource(member, unit, of(member, None), is_text=text))
        else:
            columns += [
                ColumnSource(f"{member}_{k + 1}", unit, of(member, k), is_text=text) for k in range(kind.shape[0])
            ]
    return columns, left_out


def _units_of_members(data: Any) -> dict[str, str]:
    """Return the units of a table of records, which an attribute lists in the order of its members."""
    for key in UNITS:
        listed = np.asarray(data.attrs[key]).reshape(-1) if key in data.attrs else np.empty(0)
        if listed.size == len(data.dtype.names):
            words = [word(unit).strip() for unit in listed]
            return {member: unit for member, unit in zip(data.dtype.names, words, strict=True) if unit}
    return {}


def is_column(dtype: Any) -> bool:
    """Tell whether values of this type make a column."""
    import h5py

    return is_number(dtype) or dtype.kind in "cSU" or h5py.check_string_dtype(dtype) is not None


def unit_of(data: Any) -> str | None:
    """Return the unit that an attribute gives."""
    for key in UNITS:
        if key in data.attrs:
            value = np.asarray(data.attrs[key]).reshape(-1)
            return (word(value[0]).strip() or None) if value.size else None
    return None


def word(value: Any) -> str:
    """Return a single value as text."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return str(value.item() if isinstance(value, np.generic) else value)
