"""What a file says of itself before its table: ``# key: value [unit]``, ``key = value``, ``Test speed;10;mm/min``.

The entries stay text, with the unit behind the number where one is given; the campaign turns them into conditions.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import islice

from pipeline.ingest.delimited.cells import is_number
from pipeline.ingest.delimited.dialect import BLANKS, Dialect
from pipeline.ingest.delimited.header import is_known_unit, name_and_unit
from pipeline.ingest.reader import Entry

MOST_ENTRIES = 1000
_LONGEST_KEY, _LONGEST_VALUE, _LONGEST_LINE = 80, 500, 2000
_PAIR = re.compile(r"\s*(?P<key>[^\W\d_][^:=|{}\t]*?)\s*(?::=|[:=])\s*(?P<value>\S.*?)\s*")
_KEY_ALONE = re.compile(r"\s*[^\W\d_][^:=|{}]*[:=]?\s*")
_NUMBER_IN_BRACKETS = re.compile(r"(?P<number>\S+)\s*[\[(](?P<unit>[^\])]*)[\])]")


def entries(lines: Iterable[str], dialect: Dialect) -> dict[str, str]:
    """Return key -> value of every line that reads as such; where a key comes again, the first counts."""
    found: dict[str, str] = {}
    for line in lines:
        for key, value in _pairs(line[:_LONGEST_LINE], dialect):
            if len(found) < MOST_ENTRIES:
                found.setdefault(key, value)
    return found


def placed_entries(lines: Iterable[tuple[int, str]], dialect: Dialect) -> list[Entry]:
    """Return every entry of numbered lines with its place, also where a key comes again."""
    pairs = ((n, pair) for n, line in lines for pair in _pairs(line[:_LONGEST_LINE], dialect))
    return [Entry(key, value, f"line {n}") for n, (key, value) in islice(pairs, MOST_ENTRIES)]


def _pairs(line: str, dialect: Dialect) -> list[tuple[str, str]]:
    text = dialect.comment(line)
    if text is not None:
        cells = dialect.split(text)
        return (
            _several(text) or _from_text(text) or (_from_cells(cells) if len(cells) > 1 and is_number(cells[1]) else [])
        )
    cells = dialect.split(line)
    if not cells or not cells[0]:
        return []
    cells = [cell for cell in cells if cell]
    if dialect.delimiter == BLANKS and not (len(cells) in (2, 3) and is_number(cells[1])):
        return _from_text(line)
    if cells and _PAIR.fullmatch(cells[0]) and not cells[0].endswith((":", "=")):
        return _from_text(dialect.delimiter.join(cells))
    return _from_cells(cells)


def _several(text: str) -> list[tuple[str, str]]:
    """``fs=1000, gain=2``: every part must be a pair of its own."""
    parts = [_PAIR.fullmatch(part) for part in re.split(r"[,;]\s", text)]
    if len(parts) < 2 or not all(parts):
        return []
    return [pair for part in parts if part for pair in _entry(part["key"], part["value"])]


def _from_text(text: str) -> list[tuple[str, str]]:
    match = _PAIR.fullmatch(text.strip().strip('"'))
    if match is None or match["value"].startswith("//"):
        return []
    return _entry(match["key"], match["value"])


def _from_cells(cells: Sequence[str]) -> list[tuple[str, str]]:
    if len(cells) not in (2, 3) or not _KEY_ALONE.fullmatch(cells[0]):
        return []
    value = cells[1]
    if len(cells) == 3:
        unit = cells[2].strip("[]()")
        if not (is_number(value) and is_known_unit(unit)):
            return []
        value = f"{value} {unit}"
    return _entry(cells[0].rstrip(":= "), value)


def _entry(key: str, value: str) -> list[tuple[str, str]]:
    """Move a unit that stands with the key, or in brackets, behind the number."""
    key, value = key.strip().strip('"').strip(), value.strip().strip('"').strip()
    if not value or len(key) > _LONGEST_KEY or len(value) > _LONGEST_VALUE:
        return []
    if (match := _NUMBER_IN_BRACKETS.fullmatch(value)) and is_number(match["number"]):
        value = f"{match['number']} {match['unit']}".strip()
    elif is_number(value):
        name, unit = name_and_unit(key)
        if unit:
            key, value = name, f"{value} {unit}"
    return [(key, value)]
