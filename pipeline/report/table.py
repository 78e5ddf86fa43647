"""A table as the page shows it: one unit a column, digits that the error warrants, points under points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from markupsafe import Markup

from pipeline.findings.figures import Cell, Column, Status, Table, Value
from pipeline.report.numbers import THIN, Reading, aligned_readings, alike, reading
from pipeline.report.reading_units import ReadingUnit, reading_unit, size_of, typical
from pipeline.report.words import clean, text_width, typeset
from pipeline.report.written import written_numbers

MOST_ROWS = 200
NOTHING = "–"
_HEIGHTS = {"long": 26, "tall": 9, "short": 0}  # rows
PROSE_FROM = 30  # signs; such a text has a column of a readable width
# Width of an A4 sheet and of a cell's padding in ems of the print type of "widest", "wider", "wide" and none (style.css).
_SHEET = {"widest": (87.5, 0.65), "wider": (79.5, 0.6), "wide": (73.0, 1.05), "": (58.0, 1.7)}
_PROSE = 16.0  # ems that a column of sentences needs
_SMALLER = 0.9  # type of a second line


@dataclass(frozen=True)
class Head:
    """Heading of a column: words, unit, whether its cells are numbers."""

    text: str
    unit: str = ""
    number: bool = False


@dataclass(frozen=True)
class Shown:
    """A cell as text: `below` is a second, smaller line, `kind` a CSS class."""

    text: str
    below: str = ""
    kind: str = ""


@dataclass(frozen=True)
class Note:
    """A line below a table: what it is on, and what is said of it."""

    head: Markup
    text: str


@dataclass(frozen=True)
class TableView:
    """What the template needs of a table; `left_out` rows are only in findings.json."""

    kind: ClassVar[str] = "table"
    name: str
    title: str
    caption: str
    heads: Sequence[Head]
    rows: Sequence[Sequence[Shown]]
    left_out: int = 0
    notes: Sequence[Note] = ()
    number: int = 0

    @property
    def size(self) -> str:
        """CSS classes: wide tables get smaller type on paper, long ones scroll in a box, short ones stay whole."""
        width = self._width
        height = next((name for name, rows in _HEIGHTS.items() if len(self.rows) >= rows), "")
        return f"{width} {height}".strip()

    @property
    def _width(self) -> str:
        """Return the class of the largest type in which the columns fit a sheet."""
        rooms = [_room(head, [row[place] for row in self.rows]) for place, head in enumerate(self.heads)]
        fits = [name for name, (most, padding) in _SHEET.items() if sum(rooms) + padding * len(rooms) <= most]
        return (fits or ["widest"])[-1]

    def numbered(self, number: int) -> TableView:
        """Return the table with its number in the page."""
        return replace(self, number=number)


def table_view(table: Table, most_rows: int = MOST_ROWS) -> TableView:
    """Lay out a table of SI numbers.

    Parameters
    ----------
    table
        Headings, rows and caption; text that is not `Markup` is escaped later by the template.
    most_rows
        Rows beyond are left out and counted.
    """
    rows = table.rows[:most_rows]
    columns = [[row[place] if place < len(row) else None for row in rows] for place in range(len(table.columns))]
    laid = [_column(column, cells) for column, cells in zip(table.columns, columns, strict=True)]
    return TableView(
        name=table.name,
        title=_text(table.title),
        caption=_text(table.caption),
        heads=[head for head, _ in laid],
        rows=[list(row) for row in zip(*(cells for _, cells in laid), strict=True)] if laid else [],
        left_out=len(table.rows) - len(rows),
    )


def _room(head: Head, cells: Sequence[Shown]) -> float:
    """Return how wide a column is at least, in ems: numbers stay on a line, words may break."""
    widths = [text_width(word, 1.0) for word in _bare_text(head.text).split()]
    widths.append(_SMALLER * text_width(head.unit, 1.0))
    for cell in cells:
        widths.append(_PROSE if cell.kind == "prose" else 0.0)
        lines = [(_bare_text(cell.text), 1.0), (_bare_text(cell.below), _SMALLER)]
        for line, size in lines:
            parts = [line] if "number" in cell.kind else line.split()
            widths += [size * text_width(part, 1.0) for part in parts]
    return max(widths)


def _bare_text(text: str) -> str:
    return text.striptags() if isinstance(text, Markup) else text


def column_unit(column: Column, cells: Sequence[Cell]) -> ReadingUnit:
    """Return the unit in which the numbers of a column read best."""
    magnitudes = []
    for cell in cells:
        if isinstance(cell, Value):
            magnitudes.append(size_of(cell.value, cell.std_error, cell.ci95))
        elif isinstance(cell, int | float) and not isinstance(cell, bool):
            magnitudes.append(float(cell))
    errors = typical(cell.std_error for cell in cells if isinstance(cell, Value))
    return reading_unit(column.unit or "1", typical(magnitudes), errors)


def _column(column: Column, cells: Sequence[Cell]) -> tuple[Head, list[Shown]]:
    numbers = [cell for cell in cells if isinstance(cell, int | float | Value) and not isinstance(cell, bool)]
    if not numbers:
        words = [_words(cell) for cell in cells]
        written = written_numbers([one.text for one in words], NOTHING) if _bare(words) else None
        if written:
            texts, unit_name = written
            kinds = ["number missing" if text == NOTHING else "number" for text in texts]
            shown = [replace(one, text=text, kind=kind) for one, text, kind in zip(words, texts, kinds, strict=True)]
            return Head(_text(column.heading), unit_name, True), shown
        prose = any(len(one.text) > PROSE_FROM and not isinstance(one.text, Markup) for one in words)
        return Head(_text(column.heading)), [replace(one, kind="prose") for one in words] if prose else words
    if all(isinstance(cell, int) for cell in numbers) and column.unit in ("", "1"):
        texts = [
            f"{cell:,}".replace(",", THIN).replace("-", "−") if _counts(cell) else _words(cell).text for cell in cells
        ]
        return Head(_text(column.heading), "", True), [Shown(text, kind="number") for text in texts]
    unit = column_unit(column, cells)
    readings = _of_same_decimals([_reading(cell, unit) for cell in cells], cells, unit)
    texts = aligned_readings(readings)
    shown = []
    for cell, found, text in zip(cells, readings, texts, strict=True):
        if found is None:
            without = _words(cell)
            shown.append(replace(without, kind="number missing" if without.text == NOTHING else "number"))
        else:
            note = typeset(clean(cell.note)) if isinstance(cell, Value) else ""
            shown.append(Shown(text, "; ".join(filter(None, (found.interval, note))), "number"))
    return Head(_text(column.heading), unit.name, True), shown


def _bare(words: Sequence[Shown]) -> bool:
    return not any(isinstance(one.text, Markup) for one in words)


def _of_same_decimals(
    readings: Sequence[Reading | None], cells: Sequence[Cell], unit: ReadingUnit
) -> list[Reading | None]:
    """Return the readings of a column; where none has an error, with the same decimals if they are of like size."""
    values = [cell.value if isinstance(cell, Value) else cell for cell in cells]
    known = [
        unit.read(float(v)) for v, found in zip(values, readings, strict=True) if found and isinstance(v, int | float)
    ]
    texts = None if any(found and (found.error or found.low) for found in readings) else alike(known)
    if texts is None:
        return list(readings)
    in_turn = iter(texts)
    return [Reading(next(in_turn)) if found else None for found in readings]


def _counts(cell: Cell) -> bool:
    return isinstance(cell, int) and not isinstance(cell, bool)


def _reading(cell: Cell, unit: ReadingUnit) -> Reading | None:
    if isinstance(cell, Value):
        return None if cell.value is None else reading(cell.value, cell.std_error, cell.ci95, unit.size, unit.zero)
    if isinstance(cell, int | float) and not isinstance(cell, bool) and math.isfinite(cell):
        return reading(float(cell), size=unit.size, zero=unit.zero)
    return None


def badge(status: Status) -> Markup:
    """Return a coloured word; the word says it, the colour repeats it."""
    return Markup('<span class="badge {}">{}</span>').format(status.mood, clean(status.word))


def _words(cell: Cell) -> Shown:
    if isinstance(cell, Status):
        return Shown(badge(cell))
    if isinstance(cell, Value):
        return Shown(NOTHING, clean(cell.note))
    if isinstance(cell, bool):
        return Shown("yes" if cell else "no")
    if cell is None or isinstance(cell, int | float):
        return Shown(NOTHING)
    return Shown(_text(cell) or NOTHING)


def _text(text: str) -> str:
    return text if isinstance(text, Markup) else typeset(clean(text))
