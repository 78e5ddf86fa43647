"""Where the table of numbers begins among the first lines, and what stands above it: names, units, neither.

Works on cells as text; what the names mean is in `header`, what the columns hold in `columns`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from pipeline.errors import EmptyLogError, InputError
from pipeline.ingest.delimited import header
from pipeline.ingest.delimited.cells import is_missing, is_number
from pipeline.ingest.delimited.delimiter import is_value
from pipeline.ingest.delimited.dialect import BLANKS, Dialect
from pipeline.ingest.delimited.head import Line
from pipeline.ingest.delimited.preamble import entries

Row = list[str]
_ROWS_ABOVE = 5
_NUMBERED = re.compile(r"(?i)(column |spalte |ch(annel)? ?)?\d+\s*[:=)]")
_NAMES_FOLLOW = re.compile(
    r"(?i)(columns?|column names|fields?|channels?|header|names|variables|spalten|kanäle)\s*[:=]\s*"
)
_SMALL_TABLE = 0.1
_OTHER_DELIMITERS = ("\t", ";", ",", "|", BLANKS)


@dataclass(frozen=True)
class Body:
    """The table: index of its first line, its rows in the head, and the cells and lines of names and units.

    `passed_over` are the indices of lines above it that hold numbers, or stand below the names, and are not read.
    """

    start: int
    width: int
    rows: tuple[Row, ...]
    names: tuple[str, ...] | None
    names_index: int | None
    units: tuple[str, ...] | None
    units_index: int | None
    passed_over: tuple[int, ...] = ()


def find_body(lines: Sequence[Line], dialect: Dialect, width: int, where: str) -> Body:
    """Find the table's first row and the rows of names and units above it.

    Raises
    ------
    InputError
        If there is no row of numbers, or the row above them has another number of names than they have columns.
    """
    rows = [None if not line.text.strip() or dialect.comment(line.text) is not None else dialect.split(line.text)
            for line in lines]  # fmt: skip
    measured = _measured_columns(rows, width)
    start = _start(rows, width, measured)
    if start == len(rows):
        raise EmptyLogError(
            f"{where}: holds no rows of numbers. Expected is a table: names, perhaps units, then one row a sample."
        )
    table = tuple(
        row for row in rows[start:] if row is not None and len(row) == width and not _is_heading(row, measured)
    )
    filled = {k for k in range(width) if any(not is_missing(row[k]) for row in table)}
    has_row_numbers = len(table) > 1 and is_counting([row[0] for row in table])
    above = _Above(lines[:start], rows[:start], dialect, width, filled, measured, has_row_numbers)
    names, units = above.names_and_units(where)
    heading = [found[0] for found in (names, units) if found]
    passed_over = tuple(
        index
        for index, row in enumerate(rows[:start])
        if row is not None and index not in heading and not header.is_underline(row)
        and ((heading and index > min(heading)) or (len(row) == width and _is_data(row, measured)))
    )  # fmt: skip
    return Body(
        start,
        width,
        table,
        tuple(names[1]) if names else None,
        names[0] if names else None,
        tuple(units[1]) if units else None,
        units[0] if units else None,
        passed_over,
    )


def _measured_columns(rows: Sequence[Row | None], width: int) -> list[int]:
    """Return the columns that hold numbers or stamps, judged from the later half of the rows."""
    typical = [row for row in rows if row is not None and len(row) == width and any(is_value(cell) for cell in row)]
    typical = typical[len(typical) // 2 :][-500:]
    measured = []
    for k in range(width):
        filled = [row[k] for row in typical if not is_missing(row[k])]
        if filled and sum(is_value(cell) for cell in filled) >= 0.5 * len(filled):
            measured.append(k)
    return measured


def _is_data(row: Row, measured: Sequence[int]) -> bool:
    values = [row[k] for k in measured if not is_missing(row[k])]
    return bool(values) and all(is_value(cell) for cell in values)


def _is_heading(row: Row, measured: Sequence[int]) -> bool:
    """Tell whether a row of the table's width has words in all columns of numbers."""
    values = [row[k] for k in measured if row[k]]
    return bool(values) and not any(is_value(cell) or is_missing(cell) for cell in values)


def _start(rows: Sequence[Row | None], width: int, measured: Sequence[int]) -> int:
    """Return the index of the table's first row; a short table before it, such as statistics, is passed over."""
    tables: list[list[int]] = [[]]
    for index, row in enumerate(rows):
        if row is None or len(row) != width:
            continue
        if _is_data(row, measured):
            tables[-1].append(index)
        elif _is_heading(row, measured) and tables[-1]:
            tables.append([])
    longest = max(len(table) for table in tables)
    if not longest:
        return len(rows)
    start = next(table[0] for table in tables if len(table) >= max(1, min(3, longest), _SMALL_TABLE * longest))
    while start and (row := rows[start - 1]) is not None and len(row) > 1 and _is_damaged_row(row, width, measured):
        start -= 1  # to be counted, not to be taken for a header
    return start


def _is_damaged_row(row: Row, width: int, measured: Sequence[int]) -> bool:
    """Tell whether a line is a row of numbers of another width, or with a word among its numbers."""
    if len(row) != width:
        return sum(map(is_value, row)) > 0.5 * len(row)
    values = [row[k] for k in measured if is_value(row[k])]
    is_numbered = all(cell.isdigit() for cell in values) and is_counting(values)
    return len(measured) > len(values) > 0.5 * len(measured) and not is_numbered


def is_counting(cells: Sequence[str]) -> bool:
    """Tell whether cells are whole numbers that go up by one."""
    if not all(cell.isdigit() and cell.isascii() for cell in cells):
        return False
    return all(int(after) == int(before) + 1 for before, after in pairwise(cells))


@dataclass(frozen=True)
class _Above:
    """The lines above the table, read upwards in search of its header."""

    lines: Sequence[Line]
    rows: Sequence[Row | None]
    dialect: Dialect
    width: int
    filled: set[int]
    measured: Sequence[int]
    has_row_numbers: bool

    def names_and_units(self, where: str) -> tuple[tuple[int, Row] | None, tuple[int, Row] | None]:
        """Return (line index, cells) of the names and of the units, None for what is not there."""
        fitting: list[tuple[int, Row]] = []
        seen = 0
        for index in range(len(self.lines) - 1, -1, -1):
            text = self.lines[index].text
            if not text.strip():
                continue
            seen += 1
            if seen > _ROWS_ABOVE:
                break
            if header.is_underline(self.dialect.split(text)):
                continue
            cells = self._fitted(text)
            if cells is not None:
                fitting.append((index, cells))
            elif fitting:
                break
            elif self.rows[index] is not None and len(self.dialect.split(text)) > 1:
                self._refuse_misfit(index, where)
                break
        for (place, cells), over in pairwise(fitting):
            if self._is_units_row(cells) and not self._is_units_row(over[1]):
                return over, (place, cells)
        for (place, cells), over in pairwise(fitting):
            if self._is_units_row(over[1]) and not self._is_units_row(cells) and header.names_time(cells):
                return (place, cells), over  # the units stand above the names
            if header.is_unknown_units_row([cells[k] for k in self.measured], [over[1][k] for k in self.measured]):
                return over, (place, cells)
            if header.names_time(over[1]) and not header.names_time(cells):
                return over, None  # a remark stands between the names and the rows
        if len(fitting) > 1 and self._is_comment(fitting[0][0]) and not self._is_comment(fitting[1][0]):
            return fitting[1], None
        if fitting and self._is_units_row(fitting[0][1]) and all(cell[:1] in "([" for cell in fitting[0][1] if cell):
            return None, fitting[0]
        return (fitting[0], None) if fitting else (None, None)

    def _fitted(self, text: str) -> Row | None:
        """Return the cells of a line that names every column, else None."""
        comment = self.dialect.comment(text)
        if comment is not None:
            comment = _NAMES_FOLLOW.sub("", comment)
            is_remark = self.width == 1 and len(comment.split()) > 1 and "[" not in comment
            if is_remark or _NUMBERED.match(comment) or entries([f"# {comment}"], self.dialect):
                return None
        for cells in self._splits(text if comment is None else comment):
            cells = self._without_surplus(cells)
            if self.dialect.has_arrow and is_value(cells[0]):
                cells = ["time", *cells[1:]]
            if len(cells) == self.width and self._is_header(cells):
                return cells
        return None

    def _splits(self, text: str) -> list[Row]:
        """Return the ways to part a header; one between blanks may hold names of several words."""
        splits = [self.dialect.split(text)]
        if self.dialect.delimiter == BLANKS:
            stripped = text.strip()
            splits.append([part.strip('"') for part in re.split(r"\s{2,}|\t", stripped)])
            splits.append(re.findall(r"[^\s\[(]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)))?", stripped))
            splits += [Dialect(other).split(text) for other in _OTHER_DELIMITERS if other in text]
        elif self.dialect.comment(text) is None and self.dialect.delimiter not in text:
            splits += [Dialect(other).split(text) for other in _OTHER_DELIMITERS if other in text.strip()]
        return splits

    def _without_surplus(self, cells: Row) -> Row:
        """Even out delimiters at the line's end, and LabVIEW's name for a comment that rows mostly lack."""
        if len(cells) > self.width and cells[-1] == "Comment":
            cells = cells[:-1]
        while len(cells) > self.width and not cells[-1]:
            cells = cells[:-1]
        missing = range(len(cells), self.width)
        if len(missing) == 1 and self.has_row_numbers:
            return ["", *cells]
        if missing and not self.filled & set(missing):
            cells = cells + [""] * len(missing)
        return cells

    def _is_header(self, cells: Row) -> bool:
        """Tell names from a damaged first row and from ``Test speed;10;mm/min``: of numbers, only counts 1, 2, 3."""
        measured = [cells[k] for k in self.measured if cells[k]]
        values = [cell for cell in measured if is_value(cell)]
        counted = len(values) > 1 and all(cell.isdigit() for cell in values) and is_counting(values)
        return len(values) < len(measured) and (not values or counted)

    def _is_units_row(self, cells: Row) -> bool:
        """Tell whether a row holds units; start and increment of a scope's clock may stand beside them."""
        beside = [cell for k, cell in enumerate(cells) if k not in self.measured]
        return header.is_units_row([cells[k] for k in self.measured]) or any(is_number(cell) for cell in beside)

    def _is_comment(self, index: int) -> bool:
        return self.dialect.comment(self.lines[index].text) is not None

    def _refuse_misfit(self, index: int, where: str) -> None:
        """Refuse a header whose names cannot be told to columns; entries such as ``Operator;Smith`` are none."""
        cells = [cell for cell in self.dialect.split(self.lines[index].text) if cell]
        if len(cells) < 2 or any(is_value(cell) for cell in cells):
            return
        has_decimal_commas = self.dialect.delimiter == "," and self.width == 2 * len(cells)
        if len(cells) <= 3 and self.width > len(cells) + 1 and not has_decimal_commas:
            return
        if has_decimal_commas:
            why = "The numbers seem to have decimal commas: write them with points, or part the columns by semicolons."
        else:
            why = "Which name belongs to which column is unclear: give every column one name, parted like the numbers."
        raise InputError(
            f"{where}: line {self.lines[index].number} names {len(cells)} columns, but the rows below it "
            f"have {self.width} cells (parted by {self.dialect.name}). {why}"
        )
