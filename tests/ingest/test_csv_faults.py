"""Damaged and doubtful files: what is refused says where and what to do, what is mended is told with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.ingest.delimited import READER
from pipeline.ingest.delimited.layout import survey
from pipeline.ingest.delimited.table import DelimitedTable, parsed_chunks
from pipeline.recording import QualityFinding

ROWS = "".join(f"{k},{k}.5\n" for k in range(100))
GOOD = "t,F\n" + ROWS


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def read(path: Path) -> tuple[dict[str, np.ndarray], list[QualityFinding]]:
    log = READER.open(path)
    (table,) = log.tables
    blocks = list(table.blocks())
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}, [*log.notes, *table.notes()]


REFUSED = {
    "empty": ("", "is empty"),
    "blank": ("\n\n  \n", "nothing but blanks"),
    "zeros": (b"\0" * 100, "zero bytes"),
    "binary": (bytes(range(256)) * 50, "is no text file .byte 0 is zero"),
    "control characters": (bytes(range(1, 9)) * 500, "is no text file"),
    "zeros within": (GOOD.encode() + b"\0\0\n1,2\n", "line 102 holds a zero byte .NUL, byte"),
    "header only": ("t,F\n", "no rows of numbers"),
    "prose": ("This is a text.\nIt has 5 words.\n", "no rows of numbers"),
    "three rows without names": ("0,1\n1,2\n2,3\n", "only 3 rows of numbers; at least 4"),
    "ragged": ("t,F\n" + "".join(f"{k},1\n" if k % 3 else f"{k}\n" for k in range(1, 100)), "33 of 99 rows .* first in line 4 "),
    "same names": ("t,F,x,F\n" + "1,2,3,4\n" * 9, "columns 2 and 4 are both called 'F'"),
    "more names than cells": ("t,F,x\n" + ROWS, "line 1 names 3 columns, but the rows below it have 2 cells"),
    "fewer names than cells": ("t,F\n" + "0.5,2,3\n" * 9, "line 1 names 2 columns, but the rows below it have 3 cells"),
    "decimal commas parted by commas": ("t,F,x\n" + "0,1,1,5,2,5\n" * 9, "decimal commas"),
    "points and commas": ("t;F\n" + "0.5;1,5\n" * 9, "'0.5' and '1,5'"),
    "a second header": (GOOD + "x,y\n" + ROWS, "a second header begins in line 102 .'x, y'"),
    "too many columns": ("1," * 11_000 + "2\n" + "1," * 11_000 + "2\n", "11001 cells"),
    "no line end": ("1.5," * 2_000_000, "no end within 4 MiB"),
    "a late line without end": (GOOD + "9" * 9_000_000, "line 102 has no end"),
    "late zeros": (("t,F\n" + ROWS * 200).encode() + b"\0\0\n1,2\n", "line 20002 holds zero bytes"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_read_rightly_is_refused_with_its_place(
    tmp_path: Path, content: str | bytes, message: str
) -> None:
    path = written(tmp_path, content)
    with pytest.raises(InputError, match=message) as caught:
        read(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_folder_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"):
        READER.open(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        READER.open(tmp_path / "nothing.csv")


def test_an_unknown_channel_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no channel 'G'; it has t, F"):
        list(READER.open(written(tmp_path, GOOD)).tables[0].blocks(["G"]))


TOLD = {
    "one ragged row": (GOOD.replace("50,50.5\n", "50,50.5,1\n"), 99, "warning", "1 row .* line 52 .3 instead of 2 cells: '50,50.5,1'"),
    "cut in a cell": (GOOD + "100", 100, "warning", "breaks off in line 102 "),
    "cut in the decimals": (GOOD + "100,100", 100, "warning", "breaks off in line 102 "),
    "cut in a quote": (GOOD + '100,"100.5', 100, "warning", "breaks off in line 102 "),
    "cut in an exponent": (GOOD + "100,1.5e", 100, "warning", "breaks off in line 102 "),
    "zeros at the end": (GOOD + "100,\0\0\0\0", 100, "warning", "From line 102 on the file holds zero bytes"),
    "one bad cell": (GOOD.replace("60.5", "OVER"), 100, "warning", "Column 'F' .* 'OVER' in line 62; taken as missing"),
    "many bad cells": (GOOD.replace(",9", ",x9"), 100, "error", "Column 'F' .* 'x9.5' in line 11, the first of 11 such cells"),
    "the header again": (GOOD + "t,F\n" + ROWS, 200, "warning", "header comes again, 1 time, first in line 102"),
    "comments among the rows": (GOOD + "# valve open\n" + ROWS, 200, "note", "1 comment line .* line 102: '# valve open'"),
    "empty cells": (GOOD + ",\n,\n", 100, "note", "2 rows of empty cells left out, the first in line 102"),
    "a nameless empty column": (GOOD.replace("\n", ",\n"), 100, "note", "Column 3 has neither name nor content"),
    "no names": (ROWS, 100, "note", "no names above it; its columns are called column_1 to column_2"),
    "a nameless column": (GOOD.replace("t,F", "t,"), 100, "note", "Column 2 has no name; it is called column_2"),
    "a value beside": ("t,F,fs\n0,1,99\n" + ROWS.replace("\n", ",\n"), 101, "note", "Column 3 holds one value only; .* fs = 99"),
    "a doubtful comma": ("t;F\n" + "".join(f"{k};1,{k + 100}\n" for k in range(9)), 9, "warning", "decimal comma, as 1.100"),
    "doubtful dates": ("t,F\n" + "".join(f"02/03/2024 12:00:0{k},1\n" for k in range(9)), 9, "note", "read as day/month/year"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "rows", "level", "message"), TOLD.values(), ids=TOLD.keys())
def test_what_is_mended_is_told(tmp_path: Path, content: str, rows: int, level: str, message: str) -> None:
    columns, notes = read(written(tmp_path, content))
    assert {values.size for values in columns.values()} == {rows}
    assert [note.level for note in notes] == [level] * len(notes)
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(" ".join(note.message for note in notes))


def test_a_bad_cell_is_missing_and_its_channel_named(tmp_path: Path) -> None:
    columns, (note,) = read(written(tmp_path, GOOD.replace("60.5", "OVER")))
    assert np.flatnonzero(np.isnan(columns["F"])).tolist() == [60]
    assert note.channel == "F"


def test_a_last_row_without_line_end_counts_where_it_is_whole(tmp_path: Path) -> None:
    columns, notes = read(written(tmp_path, GOOD[:-1]))
    assert columns["F"][-1] == 99.5
    assert not notes


def test_a_dos_end_of_file_mark_is_no_row(tmp_path: Path) -> None:
    columns, notes = read(written(tmp_path, GOOD + "\x1a"))
    assert columns["t"].size == 100
    assert not notes


@pytest.mark.parametrize("quick_from", [0, 1 << 40])
@pytest.mark.parametrize("size", [64, 1000, 1 << 22])
def test_lines_are_counted_right_wherever_the_file_is_parted(tmp_path: Path, quick_from: int, size: int) -> None:
    content = "# über\n\n" + GOOD.replace("60,60.5", "60,OVER").replace("80,80.5", "80").replace("\n", "\r\n")
    layout = survey(written(tmp_path, content)).layout
    found = {}
    for parsed in parsed_chunks(layout, layout.columns, size=size, quick_from=quick_from):
        for (kind, _), oddity in parsed.oddities.found.items():
            found[kind] = oddity.line
    assert found == {"bad": 64, "ragged": 84}


def test_blocks_may_be_asked_for_again(tmp_path: Path) -> None:
    (table,) = READER.open(written(tmp_path, GOOD.replace("60.5", "OVER"))).tables
    first, again = list(table.blocks()), list(table.blocks(["F"]))
    np.testing.assert_array_equal(first[0]["F"], again[0]["F"])
    assert len(table.notes()) == 1


def test_reading_may_stop_early(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,F\n" + ROWS * 12_000)  # large enough to be read ahead
    blocks = READER.open(path).tables[0].blocks()
    assert next(blocks)["t"].size > 1000
    blocks.close()


@pytest.mark.parametrize("codec", ["gb18030", "utf-16", "utf-8", "shift_jis"])
def test_characters_that_two_pieces_share_are_not_lost(tmp_path: Path, codec: str) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(("t,状態\n" + "".join(f"{k},動作中\n" for k in range(200))).encode(codec))
    layout = survey(path).layout
    for size in (33, 34, 35, 37):
        texts = [t for parsed in parsed_chunks(layout, layout.columns, size=size) for t in parsed.texts[1]]
        assert texts == ["動作中"] * 200


def test_a_file_is_not_held_in_memory(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    path = tmp_path / "log.csv"
    path.write_text("t,F\n" + ROWS * 4000)  # small numbers: 3.7 MB of text make 6.4 MB of numbers
    rows = 0
    with path.open("ab") as file:
        for _ in range(9):
            file.write((ROWS * 4000).encode())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for block in DelimitedTable(survey(path).layout).blocks():
        rows += block["t"].size
    assert rows == 4_000_000
    # Arrays of the whole would be 64 MB, their texts several times that; libraries loaded on the way count too.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 250_000


def test_points_that_may_part_thousands_are_told_with_what_they_would_mean(tmp_path: Path) -> None:
    numbers = [f"{k * 77:,}".replace(",", ".") for k in range(100)]
    notes = READER.open(written(tmp_path, "t;F\n" + "".join(f"{k};{n}\n" for k, n in enumerate(numbers)))).notes
    [note] = [note for note in notes if "may part thousands" in note.message]
    assert note.level == "warning"
    assert "'1.001' is then 1001" in note.message


@pytest.mark.parametrize(
    "rows",
    [
        [f"{k};{1 + k / 8:.3f}" for k in range(100)],  # three decimals throughout
        [f"{k};{k * 0.125:g}" for k in range(100)],  # as many decimals as it takes
        [f"{k / 1000:.3f};{k * 77}" for k in range(100)],  # whole numbers, and a time with decimals
        [f"{k / 100:.2f};{n}" for k, n in enumerate(["1.001", "12", "999"] * 30)],  # another column settles it
    ],
)
def test_decimal_points_are_not_taken_for_those_of_thousands(tmp_path: Path, rows: list[str]) -> None:
    notes = READER.open(written(tmp_path, "\n".join(["t;F", *rows]) + "\n")).notes
    assert not [note for note in notes if "thousands" in note.message]


def test_rows_of_one_error_word_are_no_header(tmp_path: Path) -> None:
    rows = "".join(f"{k / 10},{k},{k}\n" for k in range(50))
    path = written(tmp_path, "t,F,x\n" + rows + "ERR,ERR,OVERLOAD\n" * 3 + rows.replace("0.", "9."))
    columns, notes = read(path)
    assert np.flatnonzero(np.isnan(columns["F"])).tolist() == [50, 51, 52]
    assert any("'ERR' in line 52, the first of 3 such cells" in note.message for note in notes)
