"""A clock given as start and step, not as a column: LabVIEW's X0 and Delta_X, a scope's Start and Increment.

Also LabVIEW's other rows named after what they hold: the units of the columns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pipeline.ingest.delimited.body import Row, is_counting
from pipeline.ingest.delimited.cells import Notation
from pipeline.ingest.delimited.columns import Column
from pipeline.ingest.delimited.dialect import Dialect

_UNITS = {"Second": "s", "Seconds": "s", "Time": "s", "Newton": "N", "Newtons": "N", "Millimeter": "mm", "Meter": "m"}


@dataclass(frozen=True)
class RegularClock:
    """The column of time, as ``start + step * row`` in seconds."""

    index: int
    start: float
    step: float


def labview_rows(lines: Sequence[str], dialect: Dialect) -> dict[str, Row]:
    """Return the rows of an .lvm file's headers by their first cell, {} for other files."""
    if not any(line.startswith("LabVIEW Measurement") for line in lines):
        return {}
    return {cells[0]: cells[1:] for line in lines if len(cells := dialect.split(line)) > 1}


def labview_units(rows: Mapping[str, Row]) -> list[str | None]:
    """Return the unit of each column; those of several time columns are not told apart."""
    if "Y_Unit_Label" not in rows or rows.get("X_Columns", [""])[0] == "Multi":
        return []
    quantity = rows.get("X_Dimension", [""])[0]
    return [_UNITS.get(quantity), *(_UNITS.get(unit, unit or None) for unit in rows["Y_Unit_Label"])]


def regular_clock(
    columns: Sequence[Column], rows: Sequence[Row], labview: Mapping[str, Row], notation: Notation
) -> RegularClock | None:
    """Return the clock that stands in for an empty first column, or one of row numbers; None where there is none."""
    first = columns[0]
    beside = {column.name: column.unit or "" for column in columns if column.kind == "empty"}
    if first.kind == "empty" and "Delta_X" in labview:
        start, step = (labview.get(name, [""])[0] for name in ("X0", "Delta_X"))
    elif {"Start", "Increment"} <= set(beside) and is_counting([row[0] for row in rows]):
        start, step = beside["Start"], beside["Increment"]
    else:
        return None
    zero, width = notation.number(start), notation.number(step)
    return RegularClock(first.index, zero, width) if zero is not None and width is not None and width > 0 else None
