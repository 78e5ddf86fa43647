"""Numbers with the same words around them in every row: ``force:1.25`` of serial plotters, ``12.5 N``."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pipeline.ingest.delimited.cells import is_missing, is_number
from pipeline.ingest.delimited.header import is_known_unit

_AROUND = re.compile(
    r"(?P<before>[^\W\d_][^:=;,]{0,40}?\s*[:=]\s*)?(?P<number>[+-]?[0-9.,]*[0-9][.,]?(?:[eE][+-]?[0-9]+)?)"
    r"(?P<behind>\s*[^\W\d_][^\d\s]{0,8}|\s*[%°][^\d\s]{0,2})?"
)
_FEWEST_ROWS = 4


def is_labelled_number(cell: str) -> bool:
    """Tell whether a cell is a number with a label before it or a word behind it."""
    match = _AROUND.fullmatch(cell)
    return match is not None and is_number(match["number"])


def around_numbers(rows: Sequence[Sequence[str]]) -> tuple[tuple[str, str], ...]:
    """Return what stands before and behind the numbers of each column, () where there is nothing.

    Only what is the same in every filled cell counts, and only units stand behind.
    """
    if len(rows) < _FEWEST_ROWS:
        return ()
    found = []
    for cells in zip(*rows, strict=True):
        filled = [cell for cell in cells if not is_missing(cell)]
        matches = [None if is_number(cell) else _AROUND.fullmatch(cell) for cell in filled]
        around = {(match["before"] or "", match["behind"] or "") if match else None for match in matches}
        pair = around.pop() if len(around) == 1 else None
        behind = pair[1].strip() if pair else ""
        found.append(pair if pair and (not behind or is_known_unit(behind)) else ("", ""))
    return tuple(found) if any(found_pair != ("", "") for found_pair in found) else ()


def names_and_units(around: Sequence[tuple[str, str]]) -> list[str]:
    """Return a header in the form ``name [unit]`` from labels and units."""
    heads = []
    for before, behind in around:
        unit = behind.strip()
        heads.append(before.strip().rstrip(":=").rstrip() + (f" [{unit}]" if unit else ""))
    return heads
