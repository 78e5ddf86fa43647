"""How the lines of a file part into cells: delimiter, quotes, comment lines.

`detect` judges by the rows of numbers that each delimiter would yield. What a cell means is in `cells`,
where the table begins in `layout`.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from pipeline.errors import InputError
from pipeline.ingest.delimited.cells import is_missing, is_number
from pipeline.ingest.delimited.stamps import looks_like_stamp

MAX_COLUMNS = 10_000
BLANKS = " "  # as a delimiter: runs of spaces and tabs
ONE_COLUMN = ""
_DELIMITERS = ("\t", ";", "|", ",", BLANKS)  # of equally good ones the first wins
_HIDDEN = "\t;|"  # within a cell of text these rather part cells; commas and blanks stand in sentences
_NAMES = {"\t": "tab", ";": "semicolon", "|": "bar", ",": "comma", BLANKS: "runs of blanks", ONE_COLUMN: "none"}
_COMMENT_MARKS = ("#", "%", "//", ";", "*", "!")
_ARROW = " -> "
_STAMPED_LINE = re.compile(r"\d\d:\d\d:\d\d(\.\d+)? -> ")
_TOKEN = re.compile(r'(?:"[^"]*"|\S)+')
_SAMPLE_LINES = 200
_FEW_LINES = 8
_CLEARLY, _HALF = 1.2, 0.5


@dataclass(frozen=True)
class Dialect:
    """The delimiter (`BLANKS` for runs of blanks, `ONE_COLUMN` for none) and the marks that begin a comment line.

    `has_arrow` tells that a serial monitor put ``12:00:01.250 -> `` before each line.
    """

    delimiter: str
    has_arrow: bool = False

    @property
    def name(self) -> str:
        """The delimiter in words."""
        return _NAMES[self.delimiter]

    @property
    def comment_marks(self) -> tuple[str, ...]:
        """What begins a line that holds no data."""
        return tuple(mark for mark in _COMMENT_MARKS if mark != self.delimiter)

    def comment(self, line: str) -> str | None:
        """Return what a comment line says, None where the line is none; a cell ``%`` or ``#`` does not make it one."""
        text = line.strip()
        if text[:1] == '"':
            text = text.strip('"').lstrip()
        if not text.startswith(self.comment_marks):
            return None
        said = text.lstrip("".join(self.comment_marks))
        if self.delimiter not in (BLANKS, ONE_COLUMN) and said.startswith((self.delimiter, '"')):
            return None
        return said.strip()

    def split(self, line: str) -> list[str]:
        """Return the cells of a line, trimmed and without quotes."""
        if self.has_arrow:
            line = line.replace(_ARROW, self.delimiter, 1)
        if self.delimiter == ONE_COLUMN:
            return [_unquoted(line.strip())]
        if self.delimiter == BLANKS:
            return [_unquoted(token) for token in (_TOKEN.findall(line) if '"' in line else line.split())]
        if '"' not in line:
            return [cell.strip() for cell in line.split(self.delimiter)]
        try:
            cells = next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True))
        except (csv.Error, StopIteration):  # a cell beyond all sense
            return [line]
        return [cell.strip() for cell in cells]


def _unquoted(cell: str) -> str:
    return cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell


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
        If a line has more than `MAX_COLUMNS` cells, or no delimiter yields any row with a number.
    """
    told = _told(lines)
    arrow = sum(bool(_STAMPED_LINE.match(line)) for line in lines) > len(lines) / 2
    sample = list(_sample([line.split(_ARROW, 1)[-1] for line in lines] if arrow else lines))
    best = Fit(Dialect(ONE_COLUMN), 0, 0, 0.0)
    for delimiter in (told,) if told is not None else _DELIMITERS:
        fit = _fit(Dialect(delimiter), sample, where)
        # Blanks also stand within cells and part preambles: they must explain clearly more than another delimiter.
        if fit.width > 1 and fit.score > best.score * (_CLEARLY if delimiter == BLANKS else 1.0):
            best = fit
    one = _fit(Dialect(ONE_COLUMN), sample, where)
    if _is_one_column(one, best, lines):
        best = one
    if best.rows < 2 and best.score < _HALF:
        raise InputError(
            f"{where}: holds no rows of numbers. Expected is a table: names, perhaps units, then one row a sample."
        )
    if arrow:
        delimiter = best.dialect.delimiter if best.dialect.delimiter != ONE_COLUMN else "\t"
        return replace(best, dialect=Dialect(delimiter, has_arrow=True), width=best.width + 1)
    return best


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


def _fit(dialect: Dialect, sample: Sequence[str], where: str) -> Fit:
    rows: Counter[int] = Counter()
    shares: dict[int, float] = {}
    lines = 0
    for line in sample:
        if dialect.comment(line) is not None:
            continue
        lines += 1
        cells = dialect.split(line)
        if len(cells) > MAX_COLUMNS:
            raise InputError(
                f"{where}: a line has {len(cells)} cells (parted by {dialect.name}); at most {MAX_COLUMNS} "
                "columns are read."
            )
        if share := _share_of_numbers(cells):
            rows[len(cells)] += 1
            shares[len(cells)] = shares.get(len(cells), 0.0) + share
    if not rows:
        return Fit(dialect, 0, 0, 0.0)
    width = max(rows, key=lambda w: (shares[w], w))
    return Fit(dialect, width, rows[width], shares[width] / lines)


def _share_of_numbers(cells: Sequence[str]) -> float:
    """Return which part of the filled cells are numbers or time stamps; text counts as what it may be parted into."""
    filled = [cell for cell in cells if not is_missing(cell)]
    texts = [cell for cell in filled if not (is_number(cell) or looks_like_stamp(cell))]
    hidden = sum(text.count(delimiter) for text in texts for delimiter in _HIDDEN)
    return (len(filled) - len(texts)) / (len(filled) + hidden) if filled else 0.0


def _is_one_column(one: Fit, best: Fit, lines: Sequence[str]) -> bool:
    """Tell whether the lines hold one number each; ``1,25`` does where the header has one name only."""
    if best.dialect.delimiter == "," and best.width == 2 and best.score > _HALF * one.score:
        head = [line for line in lines[:_SAMPLE_LINES] if line.strip() and best.dialect.comment(line) is None]
        names = [cells for line in head if not _share_of_numbers(cells := best.dialect.split(line))]
        return one.score > best.score * 0.99 and bool(names) and len(names[-1]) == 1
    return one.score > best.score * _CLEARLY
