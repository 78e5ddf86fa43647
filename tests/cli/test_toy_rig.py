"""A rig in a folder of its own, announced from outside the package, has everything: no edit anywhere else."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]


@pytest.fixture
def campaign(project: Path, rigfit: Call) -> Path:
    """A campaign of the toy rig with its two synthetic logs dropped in, conditions in the logs."""
    assert rigfit("new", "spring.pull", "wire").status == 0
    assert rigfit("synthesize", "wire").status == 0
    return project


def test_it_is_listed(project: Path, rigfit: Call) -> None:
    assert "spring.pull" in rigfit("list").out


def test_a_new_campaign_is_listed_and_its_recipe_is_valid(project: Path, rigfit: Call) -> None:
    assert rigfit("new", "spring.pull", "wire", "--title", 'Wire "A"').status == 0
    assert "wire" in (project / "params.yaml").read_text()
    assert "# my campaigns" in (project / "params.yaml").read_text(), "comments of the user stay"
    assert 'Wire "A"' in rigfit("list").out
    again = rigfit("new", "spring.pull", "wire")
    assert again.status == 2
    assert "already" in again.err


def test_all_stages_run_and_recover_the_stiffness(campaign: Path, rigfit: Call) -> None:
    for stage in ("ingest", "identify", "report"):
        answer = rigfit(stage, "wire")
        assert answer.status == 0, answer.err
    assert rigfit("index").status == 0
    findings = json.loads((campaign / "reports/wire/findings.json").read_text())
    assert findings["verdict"] == "ok"
    stiffness = [p for p in findings["parameters"] if p["name"] == "stiffness"]
    assert len(stiffness) == 2
    for parameter in stiffness:
        assert parameter["value"] == pytest.approx(200.0, abs=5 * parameter["std_error"])
    assert findings["provenance"]["logs"].keys() == {f"datasets/wire/synthetic/pull_{n}.csv" for n in (1, 2)}
    assert "Spring" in (campaign / "reports/wire/report.html").read_text()
    assert "wire" in (campaign / "reports/index.html").read_text()


def test_only_a_new_log_is_read(campaign: Path, rigfit: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    rigfit("ingest", "wire")
    before = {path.name: path.stat().st_mtime_ns for path in (campaign / "recordings/wire").glob("*.parquet")}
    log = campaign / "datasets/wire/synthetic/pull_1.csv"
    (campaign / "datasets/wire/mine.csv").write_text(log.read_text().replace("0.0", "0.01"))
    assert rigfit("ingest", "wire").status == 0
    after = {path.name: path.stat().st_mtime_ns for path in (campaign / "recordings/wire").glob("*.parquet")}
    assert set(after) - set(before) == {"mine.parquet"}
    assert {name: after[name] for name in before} == before
    (campaign / "datasets/wire/mine.csv").unlink()
    rigfit("ingest", "wire")
    assert not (campaign / "recordings/wire/mine.parquet").exists(), "a log that is gone leaves no recording"
    rigfit("ingest", "wire", "--force")
    forced = {path.name: path.stat().st_mtime_ns for path in (campaign / "recordings/wire").glob("*.parquet")}
    assert all(forced[name] != before[name] for name in before)


def test_a_changed_condition_or_recipe_reads_the_log_again_and_settings_do_not(campaign: Path, rigfit: Call) -> None:
    recording = campaign / "recordings/wire/pull_1.parquet"
    rigfit("ingest", "wire")
    first = recording.stat().st_mtime_ns
    recipe = campaign / "recipes/wire.yaml"
    text = recipe.read_text()
    recipe.write_text(text.replace("settings:\n", "settings: {largest_extension: 0.05}\n"))
    rigfit("ingest", "wire")
    assert recording.stat().st_mtime_ns == first
    (campaign / "datasets/wire/runs.csv").write_text("run,wire_diameter [mm]\npull_1,2\n")
    rigfit("ingest", "wire")
    assert recording.stat().st_mtime_ns != first


def test_identification_needs_recordings(campaign: Path, rigfit: Call) -> None:
    answer = rigfit("identify", "wire")
    assert answer.status == 2
    assert "rigfit ingest" in answer.err


def test_a_bad_log_beside_good_ones_is_left_out_and_named(campaign: Path, rigfit: Call) -> None:
    (campaign / "datasets/wire/broken.csv").write_bytes(b"\0\1\2" * 100)
    answer = rigfit("ingest", "wire")
    assert answer.status == 0
    assert "broken" in answer.err
    assert rigfit("identify", "wire").status == 0
    findings = json.loads((campaign / "reports/wire/findings.json").read_text())
    assert findings["verdict"] == "warning"
    assert [run["run"] for run in findings["runs"] if not run["used"]] == ["broken"]
    assert any(q["level"] == "error" and q["run"] == "broken" for q in findings["quality"])


def test_the_same_inputs_give_the_same_findings_to_the_bit(campaign: Path, rigfit: Call) -> None:
    texts = []
    for _ in range(2):
        rigfit("ingest", "wire", "--force")
        rigfit("identify", "wire")
        rigfit("report", "wire")
        texts.append([(campaign / "reports/wire" / name).read_bytes() for name in ("findings.json", "report.html")])
    assert texts[0] == texts[1]


def test_a_stage_that_fails_leaves_earlier_results_in_place(campaign: Path, rigfit: Call) -> None:
    for stage in ("ingest", "identify", "report"):
        rigfit(stage, "wire")
    kept = (campaign / "reports/wire/findings.json").read_bytes()
    recipe = campaign / "recipes/wire.yaml"
    recipe.write_text(recipe.read_text().replace("settings:\n", "settings: {largest_extension: 1.e-9}\n"))
    answer = rigfit("identify", "wire")
    assert answer.status == 2
    assert "10 samples" in answer.err
    assert (campaign / "reports/wire/findings.json").read_bytes() == kept


def test_an_unknown_campaign_is_answered_with_the_nearest(campaign: Path, rigfit: Call) -> None:
    answer = rigfit("ingest", "wier")
    assert answer.status == 2
    assert "Did you mean 'wire'?" in answer.err


def test_outside_a_project_the_way_without_one_is_told(
    tmp_path: Path, rigfit: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = rigfit("ingest", "wire")
    assert answer.status == 2
    assert "rigfit run" in answer.err


def test_a_stated_calibration_stands_apart_in_findings_report_and_export(campaign: Path, rigfit: Call) -> None:
    recipe = campaign / "recipes/wire.yaml"
    recipe.write_text(recipe.read_text().replace("channels:\n", "channels:\n  force: {gain_u: 2 %}\n", 1))
    for stage in ("ingest", "identify", "report"):
        answer = rigfit(stage, "wire")
        assert answer.status == 0, answer.err
    findings = json.loads((campaign / "reports/wire/findings.json").read_text())
    assert findings["calibration"] == {"force": {"gain_u": 0.02, "offset_u": 0.0}}
    for parameter in findings["parameters"]:
        assert parameter["type_b"] == pytest.approx(0.02 * parameter["value"], rel=1e-6)
        assert parameter["std_error"] > parameter["type_b"]
    page = (campaign / "reports/wire/report.html").read_text()
    assert "force gain 2\xa0%" in page
    assert "gain of force 100\xa0%" in page
    assert rigfit("export", "wire", "--to", "csv").status == 0
    assert "type_b" in (campaign / "reports/wire/export/wire.csv").read_text()


def test_a_calibration_stated_later_reads_no_log_again(campaign: Path, rigfit: Call) -> None:
    rigfit("ingest", "wire")
    before = {path.name: path.stat().st_mtime_ns for path in (campaign / "recordings/wire").glob("*.parquet")}
    recipe = campaign / "recipes/wire.yaml"
    recipe.write_text(recipe.read_text().replace("channels:\n", "channels:\n  force: {offset_u: 0.1 N}\n", 1))
    assert rigfit("ingest", "wire").status == 0
    assert before == {path.name: path.stat().st_mtime_ns for path in (campaign / "recordings/wire").glob("*.parquet")}


def test_a_rig_that_proposes_no_runs_says_who_does(campaign: Path, rigfit: Call) -> None:
    for stage in ("ingest", "identify"):
        rigfit(stage, "wire")
    answer = rigfit("advise", "wire")
    assert answer.status == 2
    assert "spring.pull proposes no runs" in answer.err
