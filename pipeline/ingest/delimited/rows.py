"""Lines -> columns, the careful way: every line is looked at, and what is odd is noted with its number.

`quick` reads well-formed pieces of large files with the same result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.delimited.cells import is_missing
from pipeline.ingest.delimited.chunks import Chunk
from pipeline.ingest.delimited.columns import Column, stamp_text
from pipeline.ingest.delimited.delimiter import is_value
from pipeline.ingest.delimited.dialect import stray_quote
from pipeline.ingest.delimited.layout import LONGEST_QUOTE, Layout, decimals_of
from pipeline.ingest.delimited.oddities import Oddities
from pipeline.ingest.delimited.stamps import NOT_A_TIME


@dataclass(frozen=True)
class Parsed:
    """The rows of one chunk: float64 numbers, int64 instants (ns) and texts by place of the column.

    `lines` are rows and their lines in the file where these do not follow that of the row before by one.
    """

    rows: int
    numbers: dict[int, np.ndarray]
    instants: dict[int, np.ndarray]
    texts: dict[int, list[str]]
    oddities: Oddities
    lines: Sequence[tuple[int, int]] = ()


def broken_lines(lines: Sequence[int]) -> list[tuple[int, int]]:
    """Return (row, line) of the first row and of each that does not stand in the line after the row before."""
    if not lines:
        return []
    numbers = np.asarray(lines)
    breaks = np.concatenate(([0], np.flatnonzero(np.diff(numbers) != 1) + 1))
    return list(zip(breaks.tolist(), numbers[breaks].tolist(), strict=True))


def parse(chunk: Chunk, layout: Layout, wanted: Sequence[Column]) -> Parsed:
    """Read the `wanted` columns of a chunk.

    Raises
    ------
    InputError
        Where a second header with other names begins.
    """
    odd = Oddities()
    rows, lines = _rows(chunk, layout, odd)
    if chunk.has_zeros:
        odd.add("zeros", chunk.first_line)
    if chunk.is_cut and rows and _is_broken_off(rows[-1], chunk, layout):
        odd.add("cut", chunk.first_line, f"'{chunk.data.decode(errors='replace').strip()[:LONGEST_QUOTE]}'")
        rows, lines = [], []
    numbers, instants, texts, bad = _columns(rows, layout, wanted)
    for column in wanted:
        for index in bad.get(column.index, ()):
            _refuse_second_header(rows[index], lines[index], layout)
            odd.add("bad", lines[index], rows[index][column.index][:LONGEST_QUOTE], column.index)
    for column in layout.unread:
        for row, line in zip(rows, lines, strict=True):
            if row[column.index]:
                odd.add("occupied", line, row[column.index][:LONGEST_QUOTE], column.index)
    return Parsed(len(rows), numbers, instants, texts, odd, broken_lines(lines))


def _rows(chunk: Chunk, layout: Layout, odd: Oddities) -> tuple[list[list[str]], list[int]]:
    """Return the cells of the rows of right width and their line numbers."""
    rows, lines = [], []
    split, width = layout.dialect.split, layout.width
    first_letters = {mark[0] for mark in layout.dialect.comment_marks} | {'"'}
    for number, line in enumerate(chunk.data.decode(errors="replace").split("\n")[: chunk.lines], chunk.first_line):
        stripped = line.strip()
        if not stripped:
            continue
        if stripped[0] in first_letters and layout.dialect.comment(stripped) is not None:
            odd.add("comment", number, stripped[:LONGEST_QUOTE])
            continue
        if stripped in layout.headings:
            if stripped == layout.headings[0]:
                odd.add("heading", number, stripped)
            continue
        if '"' in line and stray_quote(line) is not None:
            odd.add("quote", number, stripped[:LONGEST_QUOTE])
        row = split(line)
        if len(row) != width:
            row = _evened(row, layout)
            if len(row) != width:
                instead = f"{len(row)} instead of {width} cells: '{stripped[:LONGEST_QUOTE]}'"
                odd.add("cut" if chunk.is_cut else "ragged", number, instead)
                continue
        if any(row):
            rows.append(row)
            lines.append(number)
        else:
            odd.add("blank", number)
    return rows, lines


def _evened(row: list[str], layout: Layout) -> list[str]:
    """Give a row the table's width where it differs only in empty cells at its end."""
    while len(row) > layout.width and not row[-1]:
        row = row[:-1]
    if layout.has_remarks and len(row) == layout.width + 1:
        row = row[:-1]
    missing = range(len(row), layout.width)
    if all(place in {column.index for column in layout.unread} for place in missing):
        row = row + [""] * len(missing)
    return row


Columns = tuple[dict[int, np.ndarray], dict[int, np.ndarray], dict[int, list[str]], dict[int, list[int]]]


def _columns(rows: Sequence[list[str]], layout: Layout, wanted: Sequence[Column]) -> Columns:
    """Return numbers, instants and texts by place of the column, and the rows whose cell could not be read."""
    numbers, instants, texts, bad = {}, {}, {}, {}
    for column in wanted:
        place = column.index
        if column.kind == "regular":
            continue
        if column.kind == "stamp" and layout.stamp:
            stamps = [stamp_text(row, layout.stamp) for row in rows]
            instants[place] = layout.stamp.format.instants(stamps)
            failed = np.flatnonzero(instants[place] == NOT_A_TIME).tolist()
            bad[place] = [index for index in failed if not is_missing(rows[index][place])]
            continue
        cells = [row[place] for row in rows]
        if column.kind == "text":
            texts[place] = cells
            continue
        values = layout.notation.numbers(cells)
        bad[place] = [index for index, value in enumerate(values) if value is None]
        numbers[place] = np.array(values, dtype=np.float64)  # None becomes NaN
    return numbers, instants, texts, bad


def _is_broken_off(row: list[str], chunk: Chunk, layout: Layout) -> bool:
    """Tell whether a last line without end lost part of its last cell: a quote, an exponent, some of its decimals.

    All columns are asked, so that a row counts or not whichever channels are wanted.
    """
    _, _, _, bad = _columns([row], layout, layout.columns)
    if any(bad.values()) or chunk.data.count(b'"') % 2:
        return True
    last = next((cell for cell in reversed(row) if cell), "")
    return layout.last_decimals is not None and decimals_of(last, layout.notation.decimal) < layout.last_decimals


def _refuse_second_header(row: Sequence[str], line: int, layout: Layout) -> None:
    cells = [row[place] for place in layout.measured]
    words = all(cell and not is_value(cell) and not is_missing(cell) for cell in cells)
    # Names differ from each other; a logger that fails writes one word into several cells.
    if len(cells) > 1 and words and len(set(cells)) == len(cells):
        raise InputError(
            f"{layout.path}: a second header begins in line {line} ('{', '.join(row)[:LONGEST_QUOTE]}'); the file "
            "holds several recordings one below the other. Cut it into one file a recording."
        )
