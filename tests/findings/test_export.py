"""Findings handed on: every parameter in the CSV, bearing tables as ROSS and plain readers take them."""

from __future__ import annotations

import csv
import io
import tomllib
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.findings import Findings, Parameter, storage
from pipeline.findings.export import COEFFICIENTS, as_csv, bearing_tables

TONES = (7.0, 13.0, 23.0, 37.0, 43.0)
SPEEDS = (104.7, 209.4)


def findings(missing: float | None = None) -> Findings:
    """Coefficients at five tones and two speeds; those at the tone `missing` are not told."""
    parameters = []
    for i, name in enumerate(COEFFICIENTS):
        unit = "N/m" if name[0] == "k" else "N s/m"
        for speed in SPEEDS:
            at: dict[str, float | str | bool] = {"static_load": 4e4, "shaft_speed": speed}
            for tone in TONES:
                told = tone != missing
                parameters.append(
                    Parameter(
                        name=name,
                        symbol=name,
                        value=1e8 * (i + 1) + tone if told else None,
                        std_error=1e4 if told else None,
                        unit=unit,
                        at={**at, "frequency": tone},
                        description="" if told else "=not told",
                    )
                )
            parameters.append(
                Parameter(
                    name=name, symbol=name, value=1e8 * (i + 1) + speed, unit=unit, at={**at, "synchronous": True}
                )
            )
    return Findings(campaign="pads", experiment="tpjb.dynamic", verdict="ok", parameters=parameters)


def test_the_csv_holds_every_parameter_with_its_operating_point() -> None:
    rows = list(csv.DictReader(io.StringIO(as_csv(findings(missing=13.0)))))
    assert len(rows) == len(findings().parameters)
    assert rows[0] == {
        "name": "kxx",
        "static_load": "40000",
        "shaft_speed": "104.7",
        "frequency": "7",
        "synchronous": "",
        "value": "100000007",
        "std_error": "10000",
        "type_b": "",
        "ci95_low": "",
        "ci95_high": "",
        "unit": "N/m",
        "description": "",
    }
    assert rows[1]["value"] == ""
    assert rows[1]["description"] == "'=not told"  # no formula for a spreadsheet
    assert rows[5]["synchronous"] == "true"


def test_tables_go_over_speed_and_over_frequency() -> None:
    tables = {table.name: table for table in bearing_tables(findings())}
    assert set(tables) == {
        "pads-static_load_40000-speed",
        "pads-shaft_speed_104.7-static_load_40000-frequency",
        "pads-shaft_speed_209.4-static_load_40000-frequency",
    }
    assert tables["pads-static_load_40000-speed"].frequency == SPEEDS
    over = tables["pads-shaft_speed_104.7-static_load_40000-frequency"]
    np.testing.assert_allclose(over.frequency, 2 * np.pi * np.array(TONES))
    assert over.columns["kyx"][0] == 3e8 + 7


def test_a_row_with_a_coefficient_that_is_not_told_is_left_out() -> None:
    over = next(t for t in bearing_tables(findings(missing=13.0)) if t.over == "frequency")
    np.testing.assert_allclose(over.skipped, [2 * np.pi * 13])
    assert len(over.frequency) == 4


def test_the_toml_and_the_sheet_hold_the_same_numbers() -> None:
    table = bearing_tables(findings())[0]
    ((name, content),) = tomllib.loads(table.toml()).items()
    assert name == f"BearingElement_{table.name}"
    assert content["n"] == 0
    assert content["kxx"] == list(table.columns["kxx"])
    assert content["frequency"] == list(table.frequency)
    with zipfile.ZipFile(io.BytesIO(table.sheet())) as book:
        sheet = ElementTree.fromstring(book.read("xl/worksheets/sheet1.xml"))
    rows = [["".join(cell.itertext()) for cell in row] for row in sheet.iterfind(".//{*}row")]
    assert rows[0] == [*COEFFICIENTS, "frequency"]
    assert [float(row[-1]) for row in rows[1:]] == list(table.frequency)
    assert [float(row[0]) for row in rows[1:]] == content["kxx"]


def test_findings_without_a_bearing_are_refused_with_what_they_hold() -> None:
    other = Findings(
        campaign="rubber",
        experiment="mre.shear",
        verdict="ok",
        parameters=[Parameter(name="k1", symbol="k_1", value=1.0, unit="N/m")],
    )
    with pytest.raises(InputError, match=r"rubber.*parameters are k1"):
        bearing_tables(other)


def test_the_command_writes_tables_and_csv(tmp_path: Path, rigfit: Callable) -> None:
    storage.write(findings(), tmp_path / "results")
    told = rigfit("export", tmp_path / "results", "--to", "ross", "--out", tmp_path / "tables")
    assert told.status == 0, told.err
    assert len(list((tmp_path / "tables").glob("*.toml"))) == len(list((tmp_path / "tables").glob("*.xlsx"))) == 3
    assert rigfit("export", tmp_path / "results" / "findings.json", "--to", "csv").status == 0
    assert (tmp_path / "results" / "export" / "pads.csv").is_file()


def test_a_campaign_without_findings_is_told(project: Path, rigfit: Callable) -> None:
    told = rigfit("export", "nothing", "--to", "csv")
    assert told.status == 2
    assert "there is no campaign 'nothing'" in told.err


def test_ross_reads_both_forms(tmp_path: Path) -> None:
    ross = pytest.importorskip("ross", reason="ross-rotordynamics is not installed (pip install 'rigfit[ross]')")
    for table in bearing_tables(findings()):
        (tmp_path / "table.toml").write_text(table.toml())
        (tmp_path / "table.xlsx").write_bytes(table.sheet())
        loaded = ross.BearingElement.load(tmp_path / "table.toml")
        read = ross.BearingElement.from_table(n=0, file=str(tmp_path / "table.xlsx"))
        for bearing in (loaded, read):
            np.testing.assert_allclose(bearing.frequency, table.frequency)
            for name in COEFFICIENTS:
                np.testing.assert_allclose(getattr(bearing, name), table.columns[name])
        first = table.frequency[0]
        np.testing.assert_allclose(loaded.K(first)[:2, :2], np.array([[1, 2], [3, 4]]) * 1e8, rtol=1e-4)
        np.testing.assert_allclose(loaded.C(first)[:2, :2], np.array([[5, 6], [7, 8]]) * 1e8, rtol=1e-4)
