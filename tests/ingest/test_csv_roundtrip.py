"""What a writer of any dialect writes, the reader reads back to the bit, whichever of its two passes reads it."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.ingest.delimited import READER
from pipeline.ingest.delimited.layout import survey
from pipeline.ingest.delimited.table import parsed_chunks

NAMES = ("time", "Kraft", "Weg", "Extension", "Temperatur", "state", "Druck", "x", "F", "Load cell", "ch[1]")
UNITS = ("s", "kN", "mm", "°C", "V", "mm/min", "%")
WORDS = ("run", "idle", "Halt", "bigger than", "A", "on")
FOREIGN = {"gb18030": "位移", "cp1252": "Führung"}


@dataclass
class Dialect:
    delimiter: str
    decimal: str
    encoding: str
    line_end: str
    quoted: str
    units: str
    trailing: bool
    preamble: bool
    ends: bool


@dataclass
class Table:
    names: list[str]
    units: list[str]
    columns: list[list[str]]
    is_text: list[bool]


def number_texts() -> st.SearchStrategy[str]:
    doubles = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e30, max_value=1e30)
    return st.one_of(
        st.floats(-1e4, 1e4).map(lambda v: f"{v:.5f}"),
        st.integers(-10000, 10000).map(str),
        doubles.map(repr),
        doubles.map(lambda v: f"{v:.7E}"),
        st.floats(-1e4, 1e4).map(lambda v: f"{v:+.12g}"),
        st.floats(-1e4, 1e4).map(lambda v: f"{v:10.3f}"),
    )


@st.composite
def tables(draw: st.DrawFn) -> Table:
    width = draw(st.integers(2, 6))
    rows = draw(st.integers(8, 12))
    names = draw(st.permutations(NAMES))[:width]
    units = [draw(st.sampled_from(UNITS)) for _ in range(width)]
    is_text = [False] + [draw(st.integers(0, 5)) == 0 for _ in range(width - 1)]
    columns = []
    for k in range(width):
        if is_text[k]:
            columns.append([draw(st.sampled_from(WORDS)) for _ in range(rows)])
        else:
            cells = [draw(number_texts()) for _ in range(rows)]
            for row in draw(st.sets(st.integers(3, rows - 1), max_size=3)) if k else ():
                cells[row] = draw(st.sampled_from(("", "NaN", "-", "#N/A", "inf", "-inf")))
            columns.append(cells)
    return Table(list(names), units, columns, is_text)


@st.composite
def dialects(draw: st.DrawFn) -> Dialect:
    delimiter = draw(st.sampled_from((",", ";", "\t", "|", " ")))
    quoted = draw(st.sampled_from(("none", "all", "header")))
    comma_is_free = delimiter != "," or quoted == "all"
    return Dialect(
        delimiter,
        draw(st.sampled_from((".", ",") if comma_is_free else (".",))),
        draw(st.sampled_from(("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252", "gb18030"))),
        draw(st.sampled_from(("\n", "\r\n", "\r"))),
        quoted,
        draw(st.sampled_from(("brackets", "parentheses", "row", "bare row", "none"))),
        draw(st.booleans()) and delimiter != " ",
        draw(st.booleans()),
        draw(st.booleans()),
    )


def write(path: Path, table: Table, d: Dialect) -> None:
    def line(cells: list[str], quote: bool) -> str:
        if d.delimiter == " ":
            cells = [cell.strip() or "NaN" for cell in cells]
        text = d.delimiter.join(f'"{cell}"' if quote or " " in cell.strip() else cell for cell in cells)
        return text + (d.delimiter if d.trailing else "")

    lines = ["# static_load: 52 [kN]", "# operator = Meier"] if d.preamble else []
    heads = list(table.names)
    if d.units in ("brackets", "parentheses"):
        left, right = "[]" if d.units == "brackets" else "()"
        heads = [n if t else f"{n} {left}{u}{right}" for n, u, t in zip(heads, table.units, table.is_text, strict=True)]
    quote_names = d.quoted != "none" or d.delimiter == " "
    lines.append(line(heads, quote_names))
    if "row" in d.units:
        form = "{}" if d.units == "bare row" else "({})"
        units = ["-" if t else form.format(u) for u, t in zip(table.units, table.is_text, strict=True)]
        lines.append(line(units, quote_names))
    for row in zip(*table.columns, strict=True):
        cells = [cell if text else cell.replace(".", d.decimal) for cell, text in zip(row, table.is_text, strict=True)]
        lines.append(line(cells, d.quoted == "all"))
    text = d.line_end.join(lines) + (d.line_end if d.ends else "")
    path.write_bytes(text.encode(d.encoding))


def value_of(text: str) -> float:
    return math.nan if text in ("", "NaN", "-", "#N/A") else float(text)


@settings(max_examples=120, deadline=None, report_multiple_bugs=False)
@given(tables(), dialects(), st.sampled_from((1 << 22, 400)))
def test_any_table_in_any_dialect_is_read_back_exactly(table: Table, dialect: Dialect, chunk: int) -> None:
    table.names[-1] = FOREIGN.get(dialect.encoding, table.names[-1])
    if not dialect.ends:  # with fewer decimals than all others it would be taken for cut off
        table.columns[-1][-1] = table.columns[-1][0]
    if dialect.delimiter == " ":  # a line that begins with % is a comment there
        table.units[0] = "s"
        dialect.decimal = "."  # with few columns and text among them it would be taken for a delimiter
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write(path, table, dialect)
        log = READER.open(path)
        channels = log.tables[0].channels
        assert [c.name for c in channels] == table.names
        assert [c.is_text for c in channels] == table.is_text
        if dialect.units != "none":
            assert [c.unit for c in channels if not c.is_text] == [
                u for u, t in zip(table.units, table.is_text, strict=True) if not t
            ]
        if dialect.preamble:
            assert log.metadata == {"static_load": "52 kN", "operator": "Meier"}
        for quick_from in (0, 1 << 40):
            layout = survey(path).layout
            parsed = list(parsed_chunks(layout, layout.columns, size=chunk, quick_from=quick_from))
            for column, cells, is_text in zip(layout.columns, table.columns, table.is_text, strict=True):
                if is_text:
                    assert [text for part in parsed for text in part.texts[column.index]] == cells
                else:
                    read = np.concatenate([part.numbers[column.index] for part in parsed])
                    np.testing.assert_array_equal(read, [value_of(cell.strip()) for cell in cells])


@pytest.mark.parametrize("names", [["time"], ["Kraft", "time"]])
def test_only_the_named_channels_are_given(tmp_path: Path, names: list[str]) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,state,Kraft\n" + "".join(f"{k},on,{k / 4}\n" for k in range(9)))
    (block,) = READER.open(path).tables[0].blocks(names)
    assert list(block) == names
    np.testing.assert_array_equal(block["time"], np.arange(9.0))
