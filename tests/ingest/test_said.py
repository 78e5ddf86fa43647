"""What logs say of a run: contradictions and misspelt conditions are told, foreign entries are left in peace."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from pipeline.ingest.registry import open_log
from pipeline.ingest.said import said_by


@dataclass(frozen=True)
class Spec:
    name: str
    unit: str


SPECS = (Spec("coil_current", "A"), Spec("preload", "N"), Spec("amplitude", "m"), Spec("control", ""))


def said(tmp_path, *header: str, column: str | None = None, values=None, channels=("displacement", "force")):
    rows = [[f"{k / 100:.2f}", f"{np.sin(k):.5f}", f"{np.cos(k):.5f}"] for k in range(100)]
    names = ["time [s]", "displacement [m]", "force [N]"]
    if column is not None:
        names.append(column)
        rows = [[*row, str(value)] for row, value in zip(rows, values, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*header, ",".join(names), *map(",".join, rows)]) + "\n")
    return said_by([open_log(path)], SPECS, channels)


def told(found) -> list[str]:
    return [note.message for note in found.notes if note.level == "warning"]


def test_of_two_lines_the_first_holds_and_both_are_named(tmp_path):
    found = said(tmp_path, "# coil_current: 2 A", "# preload: 200 N", "# Coil current [mA]: 4000")
    (warning,) = told(found)
    assert "'2 A' by line 1 but '4000 mA' by line 3; line 1 is used" in warning
    assert found.metadata["coil_current"] == "2 A"
    assert "Coil current" not in found.metadata


def test_a_line_that_cannot_be_read_yields_to_one_that_can(tmp_path):
    found = said(tmp_path, "# coil_current: two", "# coil_current: 3 A")
    assert found.metadata["coil_current"] == "3 A"
    assert "line 2 is used" in told(found)[0]


def test_the_same_value_twice_is_no_contradiction(tmp_path):
    found = said(tmp_path, "# coil_current: 2 A", column="coil_current [mA]", values=[2000] * 100)
    assert told(found) == []


def test_a_constant_column_against_the_header_is_told(tmp_path):
    found = said(tmp_path, "# coil_current: 1.2 A", column="coil_current [A]", values=[2] * 100)
    assert "'1.2 A' by line 1 but '2.0 A' by the column 'coil_current'; line 1 is used" in told(found)[0]


def test_a_constant_column_alone_gives_the_condition_and_one_that_varies_does_not(tmp_path):
    assert said(tmp_path, column="coil_current [A]", values=[2] * 100).metadata["coil_current"] == "2.0 A"
    assert "coil_current" not in said(tmp_path, column="coil_current [A]", values=range(100)).metadata


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("# coil_curent: 1.2 A", "coil_current"),
        ("# Coil curret [A]: 1.2", "coil_current"),
        ("# preolad: 3 N", "preload"),
        ("# amplitud: 3 mm", "amplitude"),
    ],
)
def test_a_misspelt_condition_is_asked_back(tmp_path, line, meant):
    (warning,) = told(said(tmp_path, line))
    assert "line 1 gives" in warning
    assert f"Did you mean '{meant}'?" in warning


def test_a_misspelt_constant_column_is_asked_back(tmp_path):
    (warning,) = told(said(tmp_path, column="coil_curent [A]", values=[2] * 100))
    assert "the column 'coil_curent' gives" in warning
    assert "Did you mean 'coil_current'?" in warning


def test_what_instruments_write_is_left_in_peace(tmp_path):
    lines = [
        "Operator: Smith",
        "Amplifier: 3",
        "amplitude_v: 2",
        "Controller: X",
        "preload2: 1",
        "Current: 1",
        "Load: 2",
    ]
    found = said(tmp_path, *(f"# {line}" for line in lines))
    assert found.notes == ()
    assert found.metadata["Operator"] == "Smith"
