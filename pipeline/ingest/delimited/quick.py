"""Lines -> columns at the speed of the disk, for well-formed pieces of large files.

One compiled pass over the bytes (`scan`) that knows plain rows only. A number written unusually is read by Python;
at anything odd in the rows it gives up, and `rows` reads that piece instead. Where both read, they agree to the bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.ingest.delimited.cells import is_missing
from pipeline.ingest.delimited.chunks import Chunk
from pipeline.ingest.delimited.columns import Column
from pipeline.ingest.delimited.layout import Layout
from pipeline.ingest.delimited.oddities import Oddities
from pipeline.ingest.delimited.rows import Parsed, broken_lines
from pipeline.ingest.delimited.scan import EMPTY, GAVE_UP, NUMBER, PASSED_OVER, TEXT, scan
from pipeline.ingest.delimited.stamps import NOT_A_TIME

_MOST_UNUSUAL = 1 << 15


def parse(chunk: Chunk, layout: Layout, wanted: Sequence[Column]) -> Parsed | None:
    """Read the `wanted` columns of a chunk as `rows.parse` does; None where anything in it is odd."""
    if chunk.is_cut or chunk.has_zeros or _holds_heading(chunk.data, layout, wanted):
        return None
    number_places = [column.index for column in wanted if column.kind == "number"]
    text_places = [column.index for column in wanted if column.kind == "text"]
    stamp = layout.stamp if any(column.kind == "stamp" for column in wanted) else None
    stamp_places = [] if stamp is None else [stamp.index]
    if stamp is not None and stamp.date_index is not None:
        stamp_places.append(stamp.date_index)
    span_places = list(dict.fromkeys(text_places + stamp_places))
    kinds, slots = np.full(layout.width, PASSED_OVER, np.int8), np.zeros(layout.width, np.int64)
    unread = [column.index for column in layout.unread]
    for kind, places in ((NUMBER, number_places), (TEXT, span_places), (EMPTY, unread)):
        kinds[places], slots[places] = kind, np.arange(len(places))
    marks = np.zeros(256, np.bool_)
    marks[[ord(mark[0]) for mark in layout.dialect.comment_marks]] = True
    numbers = np.empty((len(number_places), chunk.lines))
    spans = np.empty((len(span_places), 2, chunk.lines), np.int64)
    unusual = np.empty((_MOST_UNUSUAL, 4), np.int64)
    delimiter = ord(layout.dialect.delimiter) if layout.dialect.delimiter else 0
    rows, n_unusual = scan(np.frombuffer(chunk.data, np.uint8), delimiter, ord(layout.notation.decimal), kinds, slots,
                           marks, numbers, spans, unusual)  # fmt: skip
    if rows == GAVE_UP:
        return None
    for slot, row, start, end in unusual[:n_unusual].tolist():
        value = layout.notation.number(chunk.data[start:end].decode(errors="replace").strip())
        if value is None:
            return None
        numbers[slot, row] = value
    texts = {place: _texts(chunk.data, spans[slot, :, :rows]) for slot, place in enumerate(span_places)}
    instants = {}
    if stamp is not None:
        clock = texts[stamp.index]
        full = (
            clock if stamp.date_index is None else list(map(" ".join, zip(texts[stamp.date_index], clock, strict=True)))
        )
        found = instants[stamp.index] = stamp.format.instants(full)
        if not all(is_missing(clock[row]) for row in np.flatnonzero(found == NOT_A_TIME)):
            return None
    columns = {place: numbers[slot, :rows] for slot, place in enumerate(number_places)}
    read = {place: texts[place] for place in text_places}
    return Parsed(rows, columns, instants, read, Oddities(), _lines(chunk, rows))


def _lines(chunk: Chunk, rows: int) -> list[tuple[int, int]]:
    """Return where the rows stand, see `Parsed`: blank lines are all that may stand between them."""
    if rows == chunk.lines:
        return [(0, chunk.first_line)]
    filled = [n for n, line in enumerate(bytes(chunk.data).split(b"\n"), chunk.first_line) if line.strip()]
    return broken_lines(filled)


def _holds_heading(data: bytes | bytearray, layout: Layout, wanted: Sequence[Column]) -> bool:
    """Tell whether the header comes again; where it would show as text among numbers it need not be looked for."""
    numbers = [column.index for column in wanted if column.kind == "number"]
    for heading in layout.headings:
        cells = layout.dialect.split(heading)
        shows = any(layout.notation.number(cells[place]) is None for place in numbers if place < len(cells))
        if not shows and (data.startswith(heading.encode()) or b"\n" + heading.encode() in data):
            return True
    return False


def _texts(data: bytes | bytearray, spans: np.ndarray) -> list[str]:
    """Return the trimmed texts between first and last bytes, shape (2, rows)."""
    pairs: Iterator[tuple[int, int]] = zip(*spans.tolist(), strict=True)
    if data.isascii():
        text = data.decode()
        return [text[start:end].strip() for start, end in pairs]
    return [data[start:end].decode(errors="replace").strip() for start, end in pairs]
