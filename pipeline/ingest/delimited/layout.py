"""How a whole file is to be read, found from its first lines: encoding, dialect, header, columns, time stamps.

The survey reads the head only; `table` reads the rows as the layout says and tells where they differ.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError, listing
from pipeline.ingest.delimited.body import Body, Row, find_body
from pipeline.ingest.delimited.cells import Notation, doubtful_points, is_number, notation
from pipeline.ingest.delimited.columns import FIRST_ROWS, Column, Stamp, entry_columns, find_stamp, named_columns
from pipeline.ingest.delimited.delimiter import detect
from pipeline.ingest.delimited.dialect import Dialect
from pipeline.ingest.delimited.encoding import Encoding
from pipeline.ingest.delimited.head import LONG_LOOK, Head, Line, read_head
from pipeline.ingest.delimited.header import unit_in_row
from pipeline.ingest.delimited.preamble import placed_entries
from pipeline.ingest.delimited.regular import RegularClock, labview_rows, labview_units, regular_clock
from pipeline.ingest.delimited.stamps import is_order_doubtful
from pipeline.ingest.reader import Entry
from pipeline.recording import QualityFinding
from pipeline.recording.units import is_unit

FEWEST_ROWS = 4
_NUMBERS = re.compile(r"(?:^|[\s,;|\"])[+-]?[0-9]*[.,]?[0-9]+(?:[eE][+-]?[0-9]+)?(?:$|[\s,;|\"])")
LONGEST_QUOTE = 60


@dataclass(frozen=True)
class Layout:
    """The way to read a file's rows.

    `columns` are the channels, `unread` columns without name or content or with entries; `first_line` is the number
    of the first row's line, `headings` are the texts of the lines of names and units, which may come again;
    `has_remarks` tells that rows may have a remark behind them; `last_decimals` is how many decimals the last cell of
    every row has, None where that differs.
    """

    path: Path
    encoding: Encoding
    line_end: str
    dialect: Dialect
    notation: Notation
    width: int
    first_line: int
    headings: tuple[str, ...]
    columns: tuple[Column, ...]
    unread: tuple[Column, ...]
    stamp: Stamp | None
    regular: RegularClock | None
    has_remarks: bool
    last_decimals: int | None

    @property
    def measured(self) -> tuple[int, ...]:
        """Places of the columns that hold numbers or stamps in every row."""
        return tuple(column.index for column in self.columns if column.kind in ("number", "stamp"))


@dataclass(frozen=True)
class Survey:
    """A layout with what else the head holds: entries, remarks, columns that seem to hold entries, the first rows."""

    layout: Layout
    entries: tuple[Entry, ...]
    details: Mapping[str, str]
    notes: tuple[QualityFinding, ...]
    beside: tuple[Column, ...]
    first_rows: tuple[Row, ...]


def survey(path: Path) -> Survey:
    """Find out how a file is written.

    Raises
    ------
    InputError
        If it is empty, no text, holds no table, too few rows, or a header that cannot be told to the columns.
    """
    where = str(path)
    head = read_head(path)
    try:
        fit = detect([line.text for line in head.lines], where)
    except InputError:
        if head.is_whole:
            raise
        head = read_head(path, LONG_LOOK)  # a preamble that is longer than the first look
        fit = detect([line.text for line in head.lines], where)
    body = find_body(head.lines, fit.dialect, fit.width, where)
    if head.is_whole and len(body.rows) < FEWEST_ROWS and body.names_index is None:
        raise InputError(
            f"{where}: holds only {len(body.rows)} row{'s' * (len(body.rows) > 1)} of numbers; at least {FEWEST_ROWS} "
            "are needed where no row of names stands above them. Was the recording stopped too early?"
        )
    texts = [line.text for line in head.lines]
    labview = labview_rows(texts[: body.start], fit.dialect)
    columns = named_columns(body, labview_units(labview), fit.dialect.around)
    numbers = (row[c.index] for c in columns if c.kind == "number" for row in body.rows if is_number(row[c.index]))
    written, doubt = notation(numbers, where)
    if written == Notation():
        doubt = doubtful_points([row[c.index] for row in body.rows] for c in columns if c.kind == "number")
    stamp = find_stamp(columns, body.rows)
    regular = regular_clock(columns, body.rows, labview, written)
    beside = entry_columns(columns, body.rows)
    empty = [c for c in columns if c.kind == "empty" and not c.is_named]
    channels = [as_channel(c, stamp, regular) for c in columns if c not in beside and c not in empty]
    header_indices = [index for index in (body.names_index, body.units_index) if index is not None]
    layout = Layout(
        path=path,
        encoding=head.encoding,
        line_end=head.line_end,
        dialect=fit.dialect,
        notation=written,
        width=fit.width,
        first_line=head.lines[body.start].number,
        headings=tuple(texts[index].strip() for index in header_indices),
        columns=tuple(channels),
        unread=tuple(beside + empty),
        stamp=stamp,
        regular=regular,
        has_remarks=bool(labview),
        last_decimals=_last_decimals(body.rows[:-1] if head.is_whole else body.rows, written.decimal),
    )
    above = [
        (line.number, line.text) for index, line in enumerate(head.lines[: body.start]) if index not in header_indices
    ]
    return Survey(
        layout,
        tuple(placed_entries(above, fit.dialect)),
        _details(head, layout, body),
        tuple(_notes(layout, head.lines, body, doubt)),
        tuple(beside),
        body.rows[:FIRST_ROWS],
    )


def as_channel(column: Column, stamp: Stamp | None = None, regular: RegularClock | None = None) -> Column:
    """Return the column as it is read: stamps become seconds, a column still empty is taken for numbers."""
    if stamp and column.index == stamp.index:
        return Column(column.index, column.name, "s", "stamp", column.header)
    if regular and column.index == regular.index:
        return Column(column.index, column.name, "s", "regular", column.header)
    if column.kind == "empty":
        return Column(column.index, column.name, column.unit, "number", column.header)
    if column.kind == "text":
        return Column(column.index, column.name, None, "text", column.header)
    return column


def _last_decimals(rows: Sequence[Sequence[str]], decimal: str) -> int | None:
    cells = [next((cell for cell in reversed(row) if cell), "") for row in rows]
    counts = {decimals_of(cell, decimal) for cell in cells}
    return counts.pop() if len(counts) == 1 and len(cells) >= 2 * FEWEST_ROWS else None


def decimals_of(cell: str, decimal: str) -> int:
    """Return how many digits follow the decimal sign of a number without exponent."""
    _, sign, digits = cell.partition(decimal)
    return len(digits) if sign and digits.isdigit() else 0


def _details(head: Head, layout: Layout, body: Body) -> dict[str, str]:
    lines = head.lines
    details = {
        "encoding": layout.encoding.codec + (" with byte-order mark" if layout.encoding.mark else ""),
        "line ends": layout.line_end,
        "delimiter": layout.dialect.name,
        "decimal sign": "comma" if layout.notation.decimal == "," else "point",
        "names": _line_name(lines, body.names_index),
        "units": _line_name(lines, body.units_index, "in the names or none"),
        "first row": f"line {layout.first_line}",
        "columns": str(layout.width),
    }
    if layout.notation.grouping:
        details["thousands"] = {" ": "blank"}.get(layout.notation.grouping, layout.notation.grouping)
    if layout.stamp:
        details["time stamps"] = layout.stamp.format.name
    return details


def _line_name(lines: Sequence[Line], index: int | None, without: str = "none") -> str:
    return without if index is None else f"line {lines[index].number}"


def _said_passed_over(lines: Sequence[Line], body: Body) -> list[QualityFinding]:
    """Say which lines above the table might have been rows of it."""
    if not body.passed_over:
        return []
    below = [index for index in body.passed_over if body.names_index is not None and index > body.names_index]
    first = lines[(below or body.passed_over)[0]]
    quote = f"'{first.text.strip()[:LONGEST_QUOTE]}'"
    count = len(below or body.passed_over)
    many = f"{count} line{'s' * (count > 1)}"
    if below:
        text = (
            f"{many} between the names and the first row not read as a row, the first is line {first.number} ({quote})."
        )
        has_numbers = any(_NUMBERS.search(lines[index].text) for index in below)
        return [QualityFinding("warning" if has_numbers else "note", text)]
    text = f"{many} of numbers above the table not read, the first is line {first.number} ({quote})."
    return [QualityFinding("note", text)]


def _said_unknown_units(lines: Sequence[Line], body: Body) -> list[QualityFinding]:
    """Say which words of the units row are no units; where a channel needs one of them, the recipe must give it."""
    if body.units is None or body.units_index is None:
        return []
    found = [unit for cell in body.units if (unit := unit_in_row(cell)) and not is_number(unit) and not is_unit(unit)]
    if not found:
        return []
    words = listing(f"'{unit}'" for unit in dict.fromkeys(found))
    return [
        QualityFinding(
            "note",
            f"Line {lines[body.units_index].number} is taken for the units of the columns; not understood are {words}. "
            "A channel that has one of these needs its unit in the recipe, under 'channels': "
            '`force: {channel: "<name in the log>", unit: N}`.',
        )
    ]


def _notes(layout: Layout, lines: Sequence[Line], body: Body, doubt: str | None) -> list[QualityFinding]:
    notes = _said_passed_over(lines, body)
    if body.names is None and not any(column.is_named for column in layout.columns):
        last = layout.columns[-1].name if layout.columns else ""
        notes.append(
            QualityFinding("note", f"The table has no names above it; its columns are called column_1 to {last}.")
        )
    else:
        for column in layout.columns:
            if not column.is_named:
                notes.append(
                    QualityFinding("note", f"Column {column.index + 1} has no name; it is called {column.name}.")
                )
    notes += _said_unknown_units(lines, body)
    for column in layout.unread:
        if column.kind == "empty" and not column.is_named:
            notes.append(QualityFinding("note", f"Column {column.index + 1} has neither name nor content; left out."))
    if layout.regular:
        clock = layout.regular
        notes.append(
            QualityFinding(
                "note", f"Time is counted from {clock.start:g} s in steps of {clock.step:g} s, as the file tells."
            )
        )
    if doubt is not None and layout.notation.decimal == ".":
        notes.append(
            QualityFinding(
                "warning",
                f"Numbers such as '{doubt}' are read with a decimal point, but beside them stand whole numbers without "
                "one, and every point has three digits behind it: it may part thousands. If it does, all these numbers "
                f"are wrong ('{doubt}' is then {doubt.replace('.', '')}): write the file without points between thousands.",
            )
        )
    elif doubt is not None:
        notes.append(
            QualityFinding(
                "warning",
                f"Numbers such as '{doubt}' are read with a decimal comma, as {doubt.replace(',', '.')}; "
                "if the comma parts thousands, write the file without it.",
            )
        )
    if layout.stamp and "/" in layout.stamp.format.name:
        texts = [row[layout.stamp.index] for row in body.rows]
        if is_order_doubtful([text for text in texts if text]):
            notes.append(
                QualityFinding(
                    "note",
                    f"Dates such as '{texts[0]}' are read as {layout.stamp.format.name.split(',')[0]}; day and month "
                    "could be the other way round.",
                )
            )
    return notes
