"""findings.json: what is written is read back, is valid by the published schema, and hides nothing."""

from __future__ import annotations

import json
import math
from pathlib import Path

import jsonschema
import pandas as pd
import pytest
from pydantic import ValidationError

from pipeline.errors import InputError
from pipeline.findings import Findings, ModelResult, Parameter, Quality, Run
from pipeline.findings.storage import json_schema, read, to_json, write

SCHEMA = Path(__file__).parents[2] / "docs" / "findings.schema.json"


def some_findings() -> Findings:
    return Findings(
        campaign="c",
        experiment="mre.shear",
        verdict="warning",
        reasons=["only sums are identified"],
        parameters=[
            Parameter(name="k1", symbol="k_1", value=1.2e5, std_error=350.0, ci95=(1.193e5, 1.207e5), unit="N/m"),
            Parameter(
                name="k2", symbol="k_2", value=None, unit="N/m", description="one frequency: only k1 + k2 is known"
            ),
            Parameter(name="k_mr", symbol="k_{MR}", value=7e4, unit="N/m", at={"coil_current": 2.0}),
            Parameter(name="k_mr", symbol="k_{MR}", value=15e4, unit="N/m", at={"coil_current": 4.0}),
        ],
        models=[ModelResult(name="ks", selected=True, n_parameters=9, n_data=24000, nrmse=math.nan)],
        quality=[Quality(level="warning", run="a", channel="force", span=(0.5, 1.0), message="flat tops <b>µ")],
        runs=[Run(run="a", conditions={"coil_current": 2.0, "pad_id": "7"}, sha256=["00"])],
        arrays={"loops": pd.DataFrame({"x": [1.0, 2.0], "run": ["a", "b"]})},
    )


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    findings = some_findings()
    write(findings, tmp_path)
    again = read(tmp_path)
    assert to_json(again) == to_json(findings)
    pd.testing.assert_frame_equal(again.arrays["loops"], findings.arrays["loops"], check_dtype=False)


def test_arrays_of_an_earlier_identification_do_not_stay(tmp_path: Path) -> None:
    findings = some_findings()
    write(findings, tmp_path)
    write(findings.model_copy(update={"arrays": {}}), tmp_path)
    assert list((tmp_path / "arrays").iterdir()) == []


def test_findings_are_valid_by_the_schema_in_docs() -> None:
    content = json.loads(to_json(some_findings()))
    jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text())).validate(content)
    assert content["schema"] == 1
    assert content["models"][0]["nrmse"] is None, "a NaN is no JSON"


def test_the_schema_in_docs_is_that_of_the_code() -> None:
    assert json.loads(SCHEMA.read_text()) == json_schema(), "write it anew with 'make schema'"


def test_an_undetermined_parameter_has_a_reason_and_no_interval() -> None:
    with pytest.raises(ValidationError, match="needs the reason"):
        Parameter(name="k", symbol="k", value=None, unit="N/m")
    with pytest.raises(ValidationError, match="carries no interval"):
        Parameter(name="k", symbol="k", value=None, std_error=1.0, unit="N/m", description="one frequency")


def test_a_parameter_is_found_by_its_operating_point() -> None:
    assert some_findings().one("k_mr", coil_current=4.0).value == 15e4
    with pytest.raises(LookupError, match="2 parameters"):
        some_findings().one("k_mr")


@pytest.mark.parametrize("text", ["", "{", "[]", '{"schema": 1}', '{"schema": 1, "campaign": 3, "verdict": "fine"}'])
def test_a_file_that_is_no_findings_is_refused_in_a_sentence(tmp_path: Path, text: str) -> None:
    path = tmp_path / "findings.json"
    path.write_text(text)
    with pytest.raises(InputError, match="not findings as rigfit writes them"):
        read(path)
    with pytest.raises(InputError, match="cannot be read"):
        read(tmp_path / "missing.json")
