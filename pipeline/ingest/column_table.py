"""A table whose format stores columns: each block of rows is asked of the columns one by one.

Numbers become float64, truth values 0 and 1, dates seconds since the first one, bytes and other things text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.ingest.delimited.header import names_and_units
from pipeline.ingest.reader import BLOCK_ROWS, RawChannel, RawTable


@dataclass(frozen=True)
class ColumnSource:
    """A column of a file: name, unit, and ``read(file, start, stop) -> values`` of those rows of the opened file.

    `of` names the channel that it is taken from, '' for a column that the file does not hold.
    """

    name: str
    unit: str | None
    read: Callable[[Any, int, int], np.ndarray]
    is_text: bool = False
    is_date: bool = False
    of: str = ""


class ColumnTable(RawTable):
    """Columns of one length, read from a file that is opened for as long as they are read.

    Parameters
    ----------
    opened
        ``opened()`` is a context that gives what the columns are read from, and turns a broken file into InputError.
    first_date
        Of a table whose time channel holds dates, the first of them, datetime64.
    """

    def __init__(
        self,
        name: str,
        columns: Sequence[ColumnSource],
        rows: int,
        opened: Callable[[], AbstractContextManager[Any]],
        time_channel: str | None = None,
        absolute_start: str | None = None,
        first_date: np.datetime64 | None = None,
    ) -> None:
        self.name = name
        self.rows = rows
        self.channels = named([RawChannel(c.name, "s" if c.is_date else c.unit, c.is_text) for c in columns])
        self.time_channel = time_channel
        self.absolute_start = absolute_start if first_date is None else str(first_date)
        self._columns = dict(zip([channel.name for channel in self.channels], columns, strict=True))
        self._opened = opened
        self._first_date = first_date

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
        """Yield the rows; see `RawTable.blocks`."""
        wanted = {name: column for name, column in self._columns.items() if names is None or name in names}
        if not wanted:
            return
        with self._opened() as file:
            done = 0
            for held, start, stop in self.passing(file, wanted):
                yield self._block(wanted, held, start, stop)
                done = stop
            for begin in range(done, self.rows, BLOCK_ROWS):
                yield self._block(wanted, file, begin, min(begin + BLOCK_ROWS, self.rows))

    def passing(self, file: Any, wanted: Mapping[str, ColumnSource]) -> Iterator[tuple[Any, int, int]]:  # noqa: ARG002
        """Yield what columns may be read from instead of the file, in the order of the rows, and for which of them."""
        yield from ()

    def _block(self, wanted: Mapping[str, ColumnSource], file: Any, start: int, stop: int) -> dict[str, np.ndarray]:
        return {name: self._plain(c, np.asarray(c.read(file, start, stop))) for name, c in wanted.items()}

    def _plain(self, column: ColumnSource, values: np.ndarray) -> np.ndarray:
        if column.is_date:
            zero = self._first_date if self._first_date is not None else np.datetime64("1970-01-01", "ns")
            return seconds_since(values, zero)
        return as_text(values) if column.is_text else as_numbers(values)


def named(channels: Sequence[RawChannel]) -> list[RawChannel]:
    """Return channels with the units that stand in their names, ``Force [kN]``, where the format gives none."""
    split = names_and_units([channel.name for channel in channels])
    return [
        replace(channel, name=name, unit=unit) if channel.unit is None and unit is not None else channel
        for channel, (name, unit) in zip(channels, split, strict=True)
    ]


def as_numbers(values: np.ndarray) -> np.ndarray:
    """Return numbers (n,) as float64."""
    return values.astype(np.float64)


def as_text(values: np.ndarray) -> np.ndarray:
    """Return words (n,) as str; bytes are UTF-8, what is missing is empty."""
    words = [
        value.decode("utf-8", "replace").rstrip("\0")
        if isinstance(value, bytes)
        else ""
        if value is None
        else str(value)
        for value in values.tolist()
    ]
    return np.array(words, dtype=object)


def seconds_since(dates: np.ndarray, zero: np.datetime64) -> np.ndarray:
    """Return dates (n,), datetime64, as seconds since `zero`; NaN where there is none."""
    passed = (dates.astype("datetime64[ns]") - zero.astype("datetime64[ns]")).astype(np.int64) * 1e-9
    return np.where(np.isnat(dates), np.nan, passed)


def is_number(dtype: np.dtype[Any]) -> bool:
    """Tell whether samples of this type are numbers or truth values."""
    return dtype.kind in "fiub" and dtype.itemsize <= 16
