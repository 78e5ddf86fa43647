"""How the lines of a file part into cells: delimiter, quotes, comment lines, what stands around the numbers.

Which delimiter a file has is found in `delimiter`; what a cell means is in `cells`.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from functools import cached_property

BLANKS = " "  # as a delimiter: runs of spaces and tabs
ONE_COLUMN = ""
_NAMES = {"\t": "tab", ";": "semicolon", "|": "bar", ",": "comma", BLANKS: "runs of blanks", ONE_COLUMN: "none"}
_COMMENT_MARKS = ("#", "%", "//", ";", "*", "!")
ARROW = " -> "
_TOKEN = re.compile(r'(?:"[^"]*"|\S)+')


@dataclass(frozen=True)
class Dialect:
    """The delimiter (`BLANKS` for runs of blanks, `ONE_COLUMN` for none) and the marks that begin a comment line.

    `has_arrow` tells that a serial monitor put ``12:00:01.250 -> `` before each line; `around` is what stands before
    and behind the number in every cell of a column: ``force:1.25``, ``12.5 N``.
    """

    delimiter: str
    has_arrow: bool = False
    around: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        """The delimiter in words."""
        return _NAMES[self.delimiter]

    @cached_property
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
        """Return the cells of a line, trimmed, without quotes and what stands around the numbers."""
        cells = self._parted(line)
        for place, (before, behind) in enumerate(self.around[: len(cells)]):
            cells[place] = cells[place].removeprefix(before).removesuffix(behind).strip()
        return cells

    def _parted(self, line: str) -> list[str]:
        if '"' in line:
            line = without_stray_quote(line)
        if self.has_arrow:
            line = line.replace(ARROW, self.delimiter, 1)
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


def stray_quote(line: str) -> int | None:
    """Return where a quote begins a cell that is not closed in its line; inches (``5" pipe``) begin none.

    Examples
    --------
    >>> stray_quote('"0.002,1.5,3'), stray_quote('"a, b",1.5'), stray_quote('5" pipe,1.5')
    (0, None, None)
    """
    if line.count('"') % 2 == 0:
        return None
    opened, at_start = None, True
    for place, character in enumerate(line):
        if character == '"':
            opened = None if opened is not None else place if at_start else None
        at_start = character in ",;\t|" or (at_start and character == " ")
    return opened


def without_stray_quote(line: str) -> str:
    """Return a line without the quote that it does not close."""
    place = stray_quote(line)
    return line if place is None else line[:place] + line[place + 1 :]


def _unquoted(cell: str) -> str:
    return cell[1:-1].strip() if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell
