"""No row of a table is lost without being told: stray quotes, broken first rows, rows above the header."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.ingest.delimited import READER

N = 300
ROWS = [f"{k / 100:.2f},{np.sin(0.1 * k):.6f},{np.cos(0.1 * k):.6f}" for k in range(N)]


def read(tmp_path, lines):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    log = READER.open(path)
    table = log.tables[0]
    blocks = list(table.blocks())
    values = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return values, [*log.notes, *table.notes()]


@pytest.mark.parametrize("rows", [(0,), (0, 2), (1,), (150,), (N - 1,)])
@pytest.mark.parametrize("cell", [0, 1, 2])
def test_a_quote_that_is_not_closed_costs_no_row_and_is_told_with_its_line(tmp_path, rows, cell):
    lines = list(ROWS)
    for row in rows:
        cells = lines[row].split(",")
        cells[cell] = '"' + cells[cell]
        lines[row] = ",".join(cells)
    values, notes = read(tmp_path, ["time [s],x [m],F [N]", *lines])
    np.testing.assert_allclose(values["time"], np.arange(N) / 100)
    assert np.isfinite(values["F"]).all()
    (note,) = notes
    assert note.level == "warning"
    assert f"quotation mark that is not closed, the first in line {rows[0] + 2} " in note.message


@pytest.mark.parametrize(
    ("first", "words"),
    [
        (f'"{ROWS[0]}"', "1 line between the names and the first row not read as a row, the first is line 2"),
        (f"{ROWS[0]},{ROWS[0]}", "another number of cells left out, the first in line 2"),
        ("0.00,ERR,1.0", "holds text where a number should be: 'ERR' in line 2"),
        ('0.00,"0.1', "another number of cells left out, the first in line 2"),
    ],
)
def test_a_first_row_that_cannot_be_read_is_told(tmp_path, first, words):
    values, notes = read(tmp_path, ["time [s],x [m],F [N]", first, *ROWS[1:]])
    assert set(values) == {"time", "x", "F"}
    assert any(note.level == "warning" and words in note.message for note in notes), notes


def test_rows_above_the_header_are_told(tmp_path):
    _, notes = read(tmp_path, ["time [s],x [m],F [N]", ROWS[0], ROWS[1], "time [s],x [m],F [N]", *ROWS[2:]])
    assert any("2 lines of numbers above the table not read, the first is line 2" in note.message for note in notes)


def test_a_quoted_name_may_still_go_over_two_lines(tmp_path):
    values, notes = read(tmp_path, ['time [s],"displacement', 'x [m]",F [N]', *ROWS])
    assert values["time"].size == N
    assert "displacement x" in values
    assert notes == []


def test_lines_of_words_between_names_and_rows_are_a_note(tmp_path):
    _, notes = read(tmp_path, ["time [s],x [m],F [N]", "serial,A,B", *ROWS])
    assert [note.level for note in notes] == ["note"]
