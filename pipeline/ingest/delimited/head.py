"""The first lines of a file, decoded and numbered; refuses what is no text at once.

Only the head is held in memory. A quoted header cell may span lines: these are joined.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import EmptyLogError, InputError, counted
from pipeline.ingest.delimited.cells import is_number
from pipeline.ingest.delimited.dialect import stray_quote, without_stray_quote
from pipeline.ingest.delimited.encoding import Encoding, detect, is_text_with_zeros

FIRST_LOOK, LONG_LOOK = 1 << 16, 1 << 20
LONGEST_LINE = 1 << 22
_FEW_LINES = 16
_MOST_JOINED = 5
_CELLS = re.compile(r"\s*[,;\t|]\s*")


@dataclass(frozen=True)
class Line:
    """One line of text as the file numbers it; `last` differs where a quoted cell goes over several."""

    number: int
    text: str
    last: int


@dataclass(frozen=True)
class Head:
    """What is known of a file before its dialect: encoding, kind of line ends, first lines, whether these are all."""

    encoding: Encoding
    line_end: str
    lines: tuple[Line, ...]
    is_whole: bool


def read_head(path: Path, look: int = FIRST_LOOK) -> Head:
    """Read the first lines of a text file, about `look` bytes.

    Raises
    ------
    InputError
        If there is no such file, it is empty or no text, or a line is longer than `LONGEST_LINE` bytes.
    """
    data, is_whole = _bytes(path, look)
    if not data.strip(b" \t\r\n\0\xef\xbb\xbf\xff\xfe"):
        what = "is empty" if not data else "holds nothing but blanks, line ends or zero bytes"
        raise EmptyLogError(f"{path}: {what}. Expected is a table of numbers; was the recording written to its end?")
    encoding = detect(data) or detect(data.rstrip(b"\0"))  # zeros at the end are what a power cut leaves
    zero = data.find(b"\0")
    if encoding is None and is_text_with_zeros(data):
        line = data.count(b"\n", 0, zero) + 1
        raise InputError(
            f"{path}: line {line} holds a zero byte (NUL, byte {zero} of the file) among "
            f"its text, {counted(data.count(0), 'such byte')} in the first {len(data)}: the file is damaged there. Copy "
            "it again from the logger, or delete that line."
        )
    if encoding is None:
        what = f"byte {zero} is zero" if zero >= 0 else "it holds control characters"
        raise InputError(
            f"{path}: is no text file ({what}). Expected is a table of numbers as text, or a known log format."
        )
    text = codecs.getincrementaldecoder(encoding.codec)("replace").decode(data[encoding.mark :], is_whole)
    line_end = "CRLF" if "\r\n" in text else "LF" if "\n" in text else "CR" if "\r" in text else "LF"
    if line_end == "CR":
        text = text.replace("\r", "\n")
    parts = text.rstrip("\0").split("\n")
    if not is_whole:
        if len(parts) == 1:
            raise InputError(
                f"{path}: line 1 has no end within {LONGEST_LINE >> 20} MiB. Expected is one row of the table a line."
            )
        parts.pop()
    return Head(encoding, line_end, _joined([part.rstrip("\r\x1a") for part in parts]), is_whole)


def _bytes(path: Path, look: int) -> tuple[bytes, bool]:
    """Return the first bytes and whether they are the whole file; more of them where lines are long."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder; expected is a file.")
    try:
        with path.open("rb") as file:
            data = file.read(look)
            while len(data) >= look and max(data.count(b"\n"), data.count(b"\r")) < _FEW_LINES and look < LONGEST_LINE:
                data += file.read(look)
                look *= 2
            return data, len(data) < look
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error


def _joined(parts: list[str]) -> tuple[Line, ...]:
    """Number the lines; one that ends within quotes goes on in the next, unless the quote never ends."""
    lines: list[Line] = []
    index = 0
    while index < len(parts):
        last = index
        if _may_go_on(parts[index]) and (end := _closing(parts, index)):
            last = end
        lines.append(Line(index + 1, " ".join(parts[index : last + 1]), last + 1))
        index = last + 1
    return tuple(lines)


def _may_go_on(text: str) -> bool:
    """Tell whether a quoted cell is still open at the end of a line; in a row of numbers the quote is a stray one."""
    if stray_quote(text) is None:
        return False
    cells = [cell for cell in _CELLS.split(without_stray_quote(text)) if cell]
    return 2 * sum(map(is_number, cells)) <= len(cells)


def _closing(parts: list[str], start: int) -> int | None:
    """Return the line, one of the next few, in which the quote that `start` opens is closed."""
    for index in range(start + 1, min(start + _MOST_JOINED, len(parts))):
        if parts[index].count('"') % 2:
            return index
    return None
