"""Logs of real machines that nobody here made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.ingest.delimited import READER

FOLDER = Path(__file__).parents[3] / "shared" / "realdata"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the folder of real logs is not beside the repository")


@pytest.mark.parametrize(
    ("name", "rows"), [("0d01_1d5", 5006), ("0d03_1d5_1", 1675), ("0d03_2d0_1", 3340), ("0d05_1d5_1", 1007)]
)
def test_the_tensile_machine_in_chinese(name: str, rows: int) -> None:
    log = READER.open(FOLDER / "vhb4910" / f"{name}.csv")
    (table,) = log.tables
    assert [(c.name, c.unit, c.is_text) for c in table.channels] == [
        ("时间", "s", False),
        ("位移", "mm", False),
        ("力", "N", False),
    ]
    assert log.details["encoding"] == "gb18030"
    (block,) = table.blocks()
    assert {values.size for values in block.values()} == {rows}
    assert not any(np.isnan(values).any() for values in block.values())
    assert (np.diff(block["时间"]) > 0).all()
    assert block["位移"][0] <= 0.0 < 39 < block["位移"].max() + 40
    assert not log.notes
    assert not table.notes()


def test_the_damper_with_one_value_beside_and_a_trailing_comma() -> None:
    log = READER.open(FOLDER / "mr_damper_random" / "ranran_50_converted.csv")
    (table,) = log.tables
    assert [c.name for c in table.channels] == ["t", "A", "D", "Y", "V", "F"]
    assert not any(c.unit or c.is_text for c in table.channels)
    assert log.metadata == {"fs": "3004.8"}
    (block,) = table.blocks()
    assert block["t"].size == 74_068
    assert block["F"][[0, -1]].tolist() == [946.961, -88.5717]
    assert [note.level for note in log.notes] == ["note", "note"]
