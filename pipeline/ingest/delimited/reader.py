"""Reader of delimited text: CSV as labs write it, tab and blank separated tables, exports of test machines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from pipeline.errors import InputError
from pipeline.ingest.delimited.columns import Column, entries_in_columns, refuse_same_names
from pipeline.ingest.delimited.delimiter import detect
from pipeline.ingest.delimited.encoding import detect as detect_encoding
from pipeline.ingest.delimited.encoding import is_text_with_zeros
from pipeline.ingest.delimited.layout import FEWEST_ROWS, Layout, Survey, as_channel, survey
from pipeline.ingest.delimited.table import DelimitedTable, parsed_chunks
from pipeline.ingest.reader import Entry, RawLog, Reader
from pipeline.recording import QualityFinding

_LIKELY_SCORE, _SURE_SUFFIXES = 0.3, (".csv", ".tsv")


class DelimitedReader(Reader):
    """Reads any text file that holds one table of numbers."""

    name: ClassVar[str] = "delimited text"
    version: ClassVar[int] = 3
    suffixes: ClassVar[tuple[str, ...]] = (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm", ".log")

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell whether this is text with rows of numbers; what is called .csv and is text is meant to be."""
        encoding = detect_encoding(head)
        if suffix in self.suffixes and encoding is None:
            return is_text_with_zeros(head)  # `open` names the line
        if encoding is None:
            return False
        if suffix in _SURE_SUFFIXES:
            return True
        text = head[encoding.mark :].decode(encoding.codec, "replace")
        lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        try:
            fit = detect(lines[:-1] or lines, "")
        except InputError:
            return False
        return fit.rows >= FEWEST_ROWS - 1 and fit.score >= _LIKELY_SCORE

    def open(self, path: Path) -> RawLog:
        """Find out how a file is written; its rows are read by the table's `blocks`."""
        found = survey(path)
        layout, beside, notes = _settled(found)
        entries = (*found.entries, *(Entry(k, v, f"the column '{k}'") for k, v in beside.items()))
        refuse_same_names(layout.columns, str(path))
        return RawLog(
            path=path,
            format=self.name,
            tables=(DelimitedTable(layout),),
            metadata=_first_of_each(entries),
            details=found.details,
            notes=(*found.notes, *notes),
            entries=entries,
        )


def _first_of_each(entries: Sequence[Entry]) -> dict[str, str]:
    found: dict[str, str] = {}
    for entry in entries:
        found.setdefault(entry.key, entry.value)
    return found


def _settled(found: Survey) -> tuple[Layout, dict[str, str], list[QualityFinding]]:
    """Look through the whole file whether the columns that hold something in the first rows only stay empty.

    Those that do are entries beside the table, the others channels after all.
    """
    if not found.beside:
        return found.layout, {}, []
    spare = {column.index: sum(bool(row[column.index]) for row in found.first_rows) for column in found.beside}
    for parsed in parsed_chunks(found.layout, ()):
        for place, seen in parsed.oddities.by_column("occupied"):
            if place in spare:
                spare[place] -= seen.count
        if all(left < 0 for left in spare.values()):
            break
    channels = [column for column in found.beside if spare[column.index] < 0]
    beside = [column for column in found.beside if spare[column.index] >= 0]
    layout = replace(
        found.layout,
        columns=tuple(sorted((*found.layout.columns, *map(as_channel, channels)), key=lambda column: column.index)),
        unread=tuple(column for column in found.layout.unread if column not in channels),
    )
    entries = entries_in_columns(beside, found.first_rows)
    return layout, entries, [_note(column, entries) for column in beside]


def _note(column: Column, entries: dict[str, str]) -> QualityFinding:
    place = f"Column {column.index + 1}"
    if column.is_named:
        text = f"{place} holds one value only; it is taken as the entry {column.name} = {entries[column.name]}."
    else:
        text = f"{place} holds entries beside the first rows, not samples; it is no channel."
    return QualityFinding("note", text)


READER = DelimitedReader()
