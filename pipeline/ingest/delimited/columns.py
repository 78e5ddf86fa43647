"""What the columns of a table hold, judged from its first rows: numbers, text, the time stamp, nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from pipeline.errors import InputError
from pipeline.ingest.delimited.body import Body, Row
from pipeline.ingest.delimited.cells import is_missing, is_number
from pipeline.ingest.delimited.header import names_and_units, unit_in_row
from pipeline.ingest.delimited.labelled import names_and_units as named_by
from pipeline.ingest.delimited.stamps import (
    NOT_A_TIME,
    StampFormat,
    count_format,
    is_date_alone,
    stamp_format,
)

Kind = Literal["number", "text", "stamp", "regular", "empty"]
_FORMAT_SAMPLE = 200
FIRST_ROWS = 60  # as far as entries beside the table go
_FEW_ROWS = 4
_ELAPSED = re.compile(r"(?i)(.*\s)?(t|time|elapsed|zeit|prüfzeit|messzeit|laufzeit|temps|tempo|时间|時間)(\s.*)?")


@dataclass(frozen=True)
class Column:
    """A column: its place in the rows, name and unit, what its header says in full, and what its cells hold."""

    index: int
    name: str
    unit: str | None
    kind: Kind
    header: str = ""

    @property
    def is_named(self) -> bool:
        """Tell whether the file names the column."""
        return bool(self.header)


@dataclass(frozen=True)
class Stamp:
    """The column of time stamps, its format, the column with the date of a time of day, and the first instant."""

    index: int
    format: StampFormat
    date_index: int | None
    start: int
    has_zone: bool


def named_columns(body: Body, labview_units: Sequence[str | None], around: Sequence[tuple[str, str]]) -> list[Column]:
    """Return every column with its name, unit and kind; a nameless one is called after its place."""
    texts = list(body.names or named_by(around) or [""] * body.width)
    split = names_and_units(texts)
    columns = []
    for k in range(body.width):
        name, unit = split[k]
        row_unit = unit_in_row(body.units[k]) if body.units else None
        if row_unit is None and k < len(labview_units):
            row_unit = labview_units[k]
        if row_unit is None and unit is None and k < len(around):
            row_unit = around[k][1].strip() or None
        columns.append(
            Column(k, name or f"column_{k + 1}", row_unit or unit, _kind([row[k] for row in body.rows]), texts[k])
        )
    return columns


def refuse_same_names(columns: Sequence[Column], where: str) -> None:
    """Raise InputError where two columns bear the same name."""
    first: dict[str, Column] = {}
    for column in columns:
        other = first.setdefault(column.name, column)
        if other is not column:
            raise InputError(
                f"{where}: columns {other.index + 1} and {column.index + 1} are both called '{column.name}'; "
                "which one is meant is unclear. Rename or delete one of them."
            )


def _kind(cells: Sequence[str]) -> Kind:
    filled = [cell for cell in cells if not is_missing(cell)]
    if not filled:
        return "empty"
    return "number" if sum(map(is_number, filled)) >= 0.5 * len(filled) else "text"


def find_stamp(columns: Sequence[Column], rows: Sequence[Row]) -> Stamp | None:
    """Return the column that gives absolute time, None where there is none or a better clock stands beside it."""
    candidates = [stamp for column in columns if (stamp := _stamp_of(column, columns, rows))]
    if not candidates:
        return None
    best = next((stamp for stamp in candidates if stamp.format.has_date), candidates[0])
    instants = [instant for row in rows if (instant := best.format.instant(stamp_text(row, best))) != NOT_A_TIME]
    if len(set(instants)) < len(instants) and _has_elapsed_time(columns, rows):
        return None
    return best


def stamp_text(row: Row, stamp: Stamp) -> str:
    """Return the text of a row's stamp, with its date where that stands in a column of its own."""
    return row[stamp.index] if stamp.date_index is None else f"{row[stamp.date_index]} {row[stamp.index]}"


def _stamp_of(column: Column, columns: Sequence[Column], rows: Sequence[Row]) -> Stamp | None:
    texts = [row[column.index] for row in rows if not is_missing(row[column.index])]
    sample = texts[:: max(1, len(texts) // _FORMAT_SAMPLE)]
    if column.kind == "number":
        count = count_format(column.name, column.unit, texts[:_FORMAT_SAMPLE])
        return Stamp(column.index, count, None, count.instant(texts[0]), True) if count else None
    if column.kind != "text" or (form := stamp_format(sample)) is None:
        return None
    found = _stamp(column, form, texts, None)
    if form.has_date:
        return found
    for neighbour in columns[max(0, column.index - 1) : column.index + 2]:
        if all(is_date_alone(row[neighbour.index]) for row in rows):
            joined = [
                f"{row[neighbour.index]} {row[column.index]}" for row in rows if not is_missing(row[column.index])
            ]
            if form := stamp_format(joined[:: max(1, len(joined) // _FORMAT_SAMPLE)]):
                return _stamp(column, form, joined, neighbour.index)
    return found


def _stamp(column: Column, form: StampFormat, texts: Sequence[str], date_index: int | None) -> Stamp:
    first = next(text for text in texts if form.instant(text) != NOT_A_TIME)
    return Stamp(column.index, form, date_index, form.instant(first), form.has_zone(first))


def _has_elapsed_time(columns: Sequence[Column], rows: Sequence[Row]) -> bool:
    """Tell whether a column of numbers called time goes up in every row."""
    for column in columns:
        if column.kind == "number" and _ELAPSED.fullmatch(column.name):
            try:
                values = [float(row[column.index].replace(",", ".")) for row in rows]
            except ValueError:
                continue
            if all(after > before for before, after in pairwise(values)):
                return True
    return False


def entry_columns(columns: Sequence[Column], rows: Sequence[Row]) -> list[Column]:
    """Return the columns that, as far as `rows` go, are no channels but entries beside the table.

    These are a number in the first row alone under a name (``fs``), or in the units row alone (``Increment``), and
    the lines ``Sample interval, 1e-5`` that oscilloscopes put into the first columns.
    """
    if len(rows) < _FEW_ROWS:
        return []
    named, block = [], []
    for column in columns:
        filled = [k for k, row in enumerate(rows) if row[column.index]]
        if column.is_named and (filled == [0] or (not filled and is_number(column.unit or ""))):
            named.append(column)
        elif not column.is_named and filled and filled[-1] < min(FIRST_ROWS, len(rows) / 2 - 1):
            block.append(column)
    return named + (block if any(column.kind == "text" for column in block) else [])


def entries_in_columns(columns: Sequence[Column], rows: Sequence[Row]) -> dict[str, str]:
    """Return what `entry_columns` say: by column name, or pairs of neighbouring cells."""
    found: dict[str, str] = {}
    for column in columns:
        if column.is_named:
            value = rows[0][column.index]
            found[column.name] = f"{value} {column.unit or ''}".strip()
    nameless = [column.index for column in columns if not column.is_named]
    for row in rows:
        cells = [row[k] for k in nameless if row[k]]
        if len(cells) == 2 and not is_number(cells[0]):
            found.setdefault(cells[0], cells[1])
    return found
