"""Which delimiter a file has, judged by the rows of numbers that each would yield."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from pipeline.errors import EmptyLogError, InputError
from pipeline.ingest.delimited.cells import is_missing, is_number
from pipeline.ingest.delimited.dialect import ARROW, BLANKS, ONE_COLUMN, Dialect
from pipeline.ingest.delimited.labelled import around_numbers, is_labelled_number
from pipeline.ingest.delimited.stamps import looks_like_stamp

MAX_COLUMNS = 10_000
_DELIMITERS = ("\t", ";", "|", ",", BLANKS)  # of equally good ones the first wins
_HIDDEN = "\t;|"  # within a cell of text these rather part cells; commas and blanks stand in sentences
_STAMPED_LINE = re.compile(r"\d\d:\d\d:\d\d(\.\d+)? -> ")
_SAMPLE_LINES, _FEW_LINES, _MOST_JUDGED = 200, 8, 2000
_CLEARLY, _HALF, _MOSTLY = 1.2, 0.5, 0.8


@lru_cache(maxsize=1 << 15)
def is_value(cell: str) -> bool:
    """Tell whether a trimmed cell is a number or a time stamp."""
    return is_number(cell) or looks_like_stamp(cell)


@dataclass(frozen=True)
class Fit:
    """How well a delimiter explains the sampled lines: the width of its rows, and their share of all lines."""

    dialect: Dialect
    width: int
    rows: int
    score: float


def detect(lines: Sequence[str], where: str) -> Fit:
    """Return the dialect that turns most of `lines` into rows of numbers of one width.

    Raises
    ------
    InputError
        If the rows have more than `MAX_COLUMNS` cells, or no delimiter yields any row with a number.
    """
    best, is_table, arrow = _best_of(tuple(lines))
    if not is_table:
        raise EmptyLogError(
            f"{where}: holds no rows of numbers. Expected is a table: names, perhaps units, then one row a sample."
        )
    if best.width > MAX_COLUMNS:
        raise InputError(
            f"{where}: its lines have {best.width} cells (parted by {best.dialect.name}); at most {MAX_COLUMNS} columns "
            "are read. Is this a table with one row a sample?"
        )
    if arrow:
        delimiter = best.dialect.delimiter if best.dialect.delimiter != ONE_COLUMN else "\t"
        around = (("", ""), *best.dialect.around) if best.dialect.around else ()
        return replace(best, dialect=Dialect(delimiter, has_arrow=True, around=around), width=best.width + 1)
    return best


@lru_cache(maxsize=4)  # a log is asked whether it is text with rows, and asked again when it is opened
def _best_of(lines: tuple[str, ...]) -> tuple[Fit, bool, bool]:
    """Return the best fit, whether it yields a table at all, and whether a serial monitor stamped the lines."""
    arrow = sum(bool(_STAMPED_LINE.match(line)) for line in lines) > len(lines) / 2
    parted = [line.split(ARROW, 1)[-1] for line in lines] if arrow else lines
    best = _best(parted, is_value)
    if best.score < _MOSTLY and (labelled := _labelled(parted)).score > best.score:
        best = labelled
    return best, _holds_rows(best) or _is_names_and_one_row(best, parted), arrow


def _holds_rows(fit: Fit) -> bool:
    return fit.rows > 1 or fit.score >= _HALF


def _is_names_and_one_row(fit: Fit, lines: Sequence[str]) -> bool:
    """Tell whether all that stands is a row of names and one below it, as in a list of one event."""
    filled = [line for line in lines if line.strip() and fit.dialect.comment(line) is None]
    cells = [fit.dialect.split(line) for line in filled]
    if fit.dialect.delimiter == BLANKS:
        return False  # as likely prose
    return len(filled) == 2 and fit.rows == 1 and fit.width > 1 and all(len(row) == fit.width for row in cells)


def _best(lines: Sequence[str], counts: Callable[[str], bool]) -> Fit:
    told = _told(lines)
    sample = list(_sample(lines))
    best = Fit(Dialect(ONE_COLUMN), 0, 0, 0.0)
    for delimiter in (told,) if told is not None else _DELIMITERS:
        fit = _fit(Dialect(delimiter), sample, counts)
        # Blanks also stand within cells and part preambles: they must explain clearly more than another delimiter.
        if fit.width > 1 and fit.score > best.score * (_CLEARLY if delimiter == BLANKS else 1.0):
            best = fit
    one = _fit(Dialect(ONE_COLUMN), sample, counts)
    return one if _is_one_column(one, best, lines) else best


def _labelled(lines: Sequence[str]) -> Fit:
    """Return the best fit where numbers may have labels and units around them."""
    fit = _best(lines, lambda cell: is_value(cell) or is_labelled_number(cell))
    rows = [row for line in _sample(lines) if len(row := fit.dialect.split(line)) == fit.width]
    return _fit(replace(fit.dialect, around=around_numbers(rows)), list(_sample(lines)), is_value)


def _told(lines: Sequence[str]) -> str | None:
    """Return the delimiter that the first line tells to spreadsheets: ``sep=;``."""
    match = re.fullmatch(r'"?sep=(.|\\t)"?\s*', lines[0], re.IGNORECASE) if lines else None
    if match is None:
        return None
    delimiter = "\t" if match[1] == "\\t" else match[1]
    return delimiter if delimiter in _DELIMITERS else None


def _sample(lines: Sequence[str]) -> Iterator[str]:
    """Yield up to `_SAMPLE_LINES` filled lines from the later half, where no preamble is left."""
    filled = [line for line in lines if line.strip()]
    filled = filled[min(len(filled) // 2, max(0, len(filled) - _FEW_LINES)) :]
    step = max(1, len(filled) // _SAMPLE_LINES)
    yield from filled[len(filled) % step :: step]


def _fit(dialect: Dialect, sample: Sequence[str], counts: Callable[[str], bool]) -> Fit:
    rows: Counter[int] = Counter()
    shares: dict[int, float] = {}
    lines = 0
    for line in sample:
        if dialect.comment(line) is not None:
            continue
        lines += 1
        cells = dialect.split(line)
        if share := _share_of_numbers(cells[:_MOST_JUDGED], counts):
            rows[len(cells)] += 1
            shares[len(cells)] = shares.get(len(cells), 0.0) + share
    if not rows:
        return Fit(dialect, 0, 0, 0.0)
    width = max(rows, key=lambda w: (shares[w], w))
    return Fit(dialect, width, rows[width], shares[width] / lines)


def _share_of_numbers(cells: Sequence[str], counts: Callable[[str], bool]) -> float:
    """Return which part of the filled cells are numbers or time stamps; text counts as what it may be parted into."""
    filled = [cell for cell in cells if not is_missing(cell)]
    texts = [cell for cell in filled if not counts(cell)]
    hidden = sum(text.count(delimiter) for text in texts for delimiter in _HIDDEN)
    return (len(filled) - len(texts)) / (len(filled) + hidden) if filled else 0.0


def _is_one_column(one: Fit, best: Fit, lines: Sequence[str]) -> bool:
    """Tell whether the lines hold one number each; ``1,25`` does where the header has one name only."""
    if best.dialect.delimiter == "," and best.width == 2 and best.score > _HALF * one.score:
        head = [line for line in lines[:_SAMPLE_LINES] if line.strip() and best.dialect.comment(line) is None]
        names = [cells for line in head if not _share_of_numbers(cells := best.dialect.split(line), is_value)]
        return one.score > best.score * 0.99 and bool(names) and len(names[-1]) == 1
    return one.score > best.score * _CLEARLY
