"""What was met beside well-formed rows while a table was read, and the sentences that tell it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.errors import InputError
from pipeline.ingest.delimited.layout import Layout
from pipeline.recording import Level, QualityFinding

MOST_RAGGED = 0.05
MOST_BAD = 0.05
_JUDGED_FROM_ROWS = 10_000


@dataclass
class Oddity:
    """How often something odd was met, and where and how first."""

    count: int
    line: int
    text: str


@dataclass
class Oddities:
    """What was met beside well-formed rows, by kind and, where it concerns one, by place of the column.

    Kinds: ``ragged``, ``cut`` (the last line), ``comment``, ``heading`` (the header again), ``blank``, ``bad`` (text
    where numbers should be), ``quote`` (a quote that is not closed), ``occupied`` (content of a column that is not read), ``zeros`` (at the file's end).
    """

    found: dict[tuple[str, int | None], Oddity] = field(default_factory=dict)

    def add(self, kind: str, line: int, text: str = "", column: int | None = None, count: int = 1) -> None:
        """Note something odd; lines must come in order."""
        if known := self.found.get((kind, column)):
            known.count += count
        else:
            self.found[kind, column] = Oddity(count, line, text)

    def merge(self, later: Oddities) -> None:
        """Add what was met further down in the file."""
        for (kind, column), oddity in later.found.items():
            self.add(kind, oddity.line, oddity.text, column, oddity.count)

    def of(self, kind: str) -> Oddity | None:
        """Return what was met of a kind that concerns whole rows."""
        return self.found.get((kind, None))

    def by_column(self, kind: str) -> Iterator[tuple[int, Oddity]]:
        """Yield place of the column and oddity of a kind that concerns single columns, from left to right."""
        places = sorted(place for found, place in self.found if found == kind and place is not None)
        yield from ((place, self.found[kind, place]) for place in places)


def refuse_ragged(odd: Oddities, rows: int, path: Path, so_far: bool = False) -> None:
    """Raise InputError where more rows than `MOST_RAGGED` have another number of cells than the table."""
    ragged = odd.of("ragged")
    total = rows + (ragged.count if ragged else 0)
    if ragged is None or ragged.count <= MOST_RAGGED * total or (so_far and total < _JUDGED_FROM_ROWS):
        return
    raise InputError(
        f"{path}: {ragged.count} of {total} rows have another number of cells than the table, the first in line "
        f"{ragged.line} ({ragged.text}). Expected is the same number in every row; repair the file or export it again."
    )


_OF_ROWS: tuple[tuple[str, Level, str], ...] = (
    ("ragged", "warning", "{n} row{s} with another number of cells left out, the first in line {line} ({text})."),
    ("cut", "warning", "The file breaks off in line {line} ({text}); that row is left out."),
    ("zeros", "warning", "From line {line} on the file holds zero bytes only, as a power cut leaves them."),
    (
        "heading",
        "warning",
        "The header comes again, {n} time{s}, first in line {line}; all rows are read as one table.",
    ),
    (
        "quote",
        "warning",
        "{n} row{s} with a quotation mark that is not closed, the first in line {line} ({text}); read without it.",
    ),
    ("comment", "note", "{n} comment line{s} among the rows passed over, the first is line {line}: '{text}'."),
    ("blank", "note", "{n} row{s} of empty cells left out, the first in line {line}."),
)


def findings(odd: Oddities, layout: Layout, rows: int) -> list[QualityFinding]:
    """Return the sentences on what was met in `rows` rows, with the file's own words and line numbers."""
    found = [
        QualityFinding(level, text.format(n=seen.count, s="s" * (seen.count > 1), line=seen.line, text=seen.text))
        for kind, level, text in _OF_ROWS
        if (seen := odd.of(kind))
    ]
    names = {column.index: column.name for column in layout.columns}
    for place, seen in odd.by_column("bad"):
        more = f", the first of {seen.count} such cells" if seen.count > 1 else ""
        text = (
            f"Column '{names[place]}' holds text where a number should be: '{seen.text}' in line {seen.line}{more}; "
            "taken as missing."
        )
        level: Level = "error" if seen.count > MOST_BAD * rows else "warning"
        found.append(QualityFinding(level, text, channel=names[place]))
    empty = {column.index for column in layout.unread if column.kind == "empty"}
    for place, seen in odd.by_column("occupied"):
        if place in empty:
            text = (
                f"Column {place + 1} has no name and was empty at first; its {seen.count} cell{'s' * (seen.count > 1)} "
                f"from line {seen.line} on ('{seen.text}') are not read."
            )
            found.append(QualityFinding("warning", text))
    return found
