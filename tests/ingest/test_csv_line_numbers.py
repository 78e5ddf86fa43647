"""Messages name the line of the file, as an editor shows it, whatever stands between the rows."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pipeline.ingest.delimited import READER
from pipeline.ingest.delimited.table import parsed_chunks
from pipeline.ingest.scan import scan_log


def lines_of(n: int) -> list[str]:
    return [f"{k / 1000:.3f},{np.sin(k):.6f}" for k in range(n)]


def warnings(path) -> str:
    return " ".join(finding.message for finding in scan_log(path).quality)


@pytest.mark.parametrize("header", [["time [s],force [N]"], ["# a: b", "", "time,force", "s,N", ""]])
@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ("nan,1.0", "without a time dropped, first line {}."),
        ("0.010,1.0", "in line {}; 1 row dropped"),
        ("0.098,1.0", "repeated stamps, 0.33 %, first line {} at 0.098"),
    ],
)
def test_what_is_wrong_with_a_stamp_is_told_with_its_line(tmp_path, header, spoilt, words):
    rows = lines_of(300)
    rows[99] = spoilt
    lines = [*header, *rows[:50], "", "# a remark", *rows[50:]]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    assert words.format(lines.index(spoilt) + 1) in warnings(path)


def test_both_ways_of_reading_give_the_same_lines(tmp_path):
    rows = lines_of(5000)
    lines = ["time [s],force [N]"]
    for at, row in enumerate(rows):
        lines += [row, ""] if at % 7 == 3 else [row]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    layout = READER.open(path).tables[0]._layout
    for quick_from in (0, 1 << 30):
        done, found = 0, {}
        for parsed in parsed_chunks(layout, layout.columns, 1 << 13, quick_from):
            starts = [*parsed.lines, (parsed.rows, 0)]
            for (row, line), (after, _) in pairwise(starts):
                found.update({done + k: line + k - row for k in range(row, after)})
            done += parsed.rows
        assert found == {row: lines.index(text) + 1 for row, text in enumerate(rows)}
