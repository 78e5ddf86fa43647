"""The rows of a delimited file as blocks of channels."""

from __future__ import annotations

import os
import sys
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.ingest.delimited import rows
from pipeline.ingest.delimited.chunks import CHUNK_BYTES, Chunk, chunks
from pipeline.ingest.delimited.columns import Column
from pipeline.ingest.delimited.layout import Layout
from pipeline.ingest.delimited.oddities import Oddities, findings, refuse_ragged
from pipeline.ingest.delimited.regular import RegularClock
from pipeline.ingest.delimited.rows import Parsed
from pipeline.ingest.delimited.stamps import Clock, iso
from pipeline.ingest.reader import RawChannel, RawTable
from pipeline.recording import QualityFinding

# Of so many bytes plain Python is done before the compiled pass is loaded: those of one file, or of all so far.
QUICK_FROM_BYTES = 1 << 23
_COMPILED = "pipeline.ingest.delimited.quick"
_MOST_WORKERS = 8
# Where blank lines part all rows each has a place of its own; so many are kept.
_MOST_PLACES = 1 << 18
_bytes_so_far = 0


class DelimitedTable(RawTable):
    """The only table of a delimited file; blocks are as large as the chunks that the file is read in."""

    name = ""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._oddities, self._rows = Oddities(), 0
        self._lines: list[tuple[int, int]] = []
        self._unplaced: int | None = None  # the row from which on lines are no longer known
        self.channels = [RawChannel(c.name, c.unit, is_text=c.kind == "text") for c in layout.columns]
        clocks = [c.name for c in layout.columns if c.kind in ("stamp", "regular")]
        self.time_channel = clocks[0] if clocks else None
        if layout.stamp and layout.stamp.format.has_date:
            self.absolute_start = iso(layout.stamp.start, layout.stamp.has_zone)

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
        """Yield the rows of each chunk: channel name -> float64 numbers, or an object array of text.

        Raises
        ------
        InputError
            For a name that is no channel, many ragged rows, a second header, a line without end.
        """
        layout, odd = self._layout, Oddities()
        self._oddities, self._rows, self._lines, self._unplaced = odd, 0, [], None
        wanted = self._columns(names)
        clock = Clock(layout.stamp.start, layout.stamp.format.period) if layout.stamp else None
        done = 0
        for parsed in parsed_chunks(layout, wanted):
            odd.merge(parsed.oddities)
            if len(self._lines) < _MOST_PLACES:
                self._lines += [(done + row, line) for row, line in parsed.lines]
            elif self._unplaced is None:
                self._unplaced = done
            refuse_ragged(odd, done + parsed.rows, layout.path, so_far=True)
            if parsed.rows:
                yield {column.name: _values(parsed, column, clock, layout.regular, done) for column in wanted}
            done += parsed.rows
            self._rows = done
        refuse_ragged(odd, done, layout.path)

    def place_of(self, row: int) -> str:
        """Return the line of a row as an editor numbers it."""
        if self._unplaced is not None and row >= self._unplaced:
            return super().place_of(row)
        at = bisect_right(self._lines, row, key=lambda entry: entry[0]) - 1
        return f"line {self._lines[at][1] + row - self._lines[at][0]}" if at >= 0 else super().place_of(row)

    def notes(self) -> Sequence[QualityFinding]:
        """Return what was odd about the rows of the last reading."""
        return findings(self._oddities, self._layout, self._rows)

    def _columns(self, names: Sequence[str] | None) -> list[Column]:
        if names is None:
            return list(self._layout.columns)
        known = {column.name: column for column in self._layout.columns}
        for name in names:
            if name not in known:
                raise InputError(f"{self._layout.path}: has no channel '{name}'; it has {listing(known)}.")
        return [known[name] for name in dict.fromkeys(names)]


def _values(parsed: Parsed, column: Column, clock: Clock | None, regular: RegularClock | None, done: int) -> np.ndarray:
    """Return a channel's values in a chunk that `done` rows precede."""
    if column.kind == "stamp" and clock is not None:
        return clock.seconds(parsed.instants[column.index])
    if column.kind == "regular" and regular is not None:
        return regular.start + regular.step * np.arange(done, done + parsed.rows)
    if column.kind == "text":
        return np.array(parsed.texts[column.index], dtype=object)
    return parsed.numbers[column.index]


def parsed_chunks(
    layout: Layout, wanted: Sequence[Column], size: int = CHUNK_BYTES, quick_from: int = QUICK_FROM_BYTES
) -> Iterator[Parsed]:
    """Yield the rows of a file chunk by chunk; large files are read ahead on all cores."""
    pieces = chunks(layout.path, layout.encoding, layout.line_end, layout.first_line, size)
    length = layout.path.stat().st_size
    quick = _compiled_pass() if is_plain(layout) and _is_worth_loading(length, quick_from) else None

    def parse(chunk: Chunk) -> Parsed:
        parsed = quick(chunk, layout, wanted) if quick else None
        return rows.parse(chunk, layout, wanted) if parsed is None else parsed

    yield from map(parse, pieces) if length <= size else _in_order(parse, pieces)


def _is_worth_loading(length: int, quick_from: int) -> bool:
    """Tell whether the compiled pass is loaded, or so much is to be read by this process that it should be."""
    global _bytes_so_far
    _bytes_so_far += length
    return length >= quick_from or _bytes_so_far >= QUICK_FROM_BYTES or _COMPILED in sys.modules


def is_plain(layout: Layout) -> bool:
    """Tell whether the compiled pass knows how this file parts and writes numbers."""
    return not (layout.notation.grouping or layout.dialect.has_arrow or layout.dialect.around)


def _compiled_pass() -> Callable[[Chunk, Layout, Sequence[Column]], Parsed | None] | None:
    """Load the compiled pass, None where there is no place to keep compiled code: the careful one reads all then."""
    try:
        from pipeline.ingest.delimited.quick import parse
    except RuntimeError:  # numba finds neither the package's folder nor a cache of the user's to be writable
        return None
    return parse


def _in_order(parse: Callable[[Chunk], Parsed], pieces: Iterator[Chunk]) -> Iterator[Parsed]:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    workers = min(_MOST_WORKERS, cores)
    pool = ThreadPoolExecutor(workers)
    ahead: deque[Future[Parsed]] = deque()
    try:
        for chunk in pieces:
            ahead.append(pool.submit(parse, chunk))
            if len(ahead) > workers:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)
