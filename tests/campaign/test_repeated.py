"""One recording dropped twice is counted once, whatever it is called; what its two labels say is told."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.campaign.repeated import Head, repeated
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.registry import experiment

Call = Callable[..., Any]


def pull(seed: int, n: int = 400) -> np.ndarray:
    """One pull, shape (n, 3): time s, extension m, force N."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) / 100.0
    extension = 0.02 * np.sin(2 * np.pi * 0.5 * time)
    return np.column_stack([time, extension, 200.0 * extension + rng.normal(0, 0.05, n)])


def write(path: Path, rows: np.ndarray, diameter: str = "1 mm", unit: str = "m") -> Path:
    scale = {"m": 1.0, "mm": 1e3}[unit]
    lines = [f"{t:.9g},{x * scale:.9g},{f:.9g}" for t, x, f in rows]
    path.write_text(
        "\n".join([f"# wire_diameter: {diameter}", f"time [s],extension [{unit}],force [N]", *lines]) + "\n"
    )
    return path


def found(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "findings.json").read_text())
    return content


def used(findings: dict[str, Any]) -> list[str]:
    return [run["run"] for run in findings["runs"] if run["used"]]


def run(rigfit: Call, folder: Path, *logs: Path) -> dict[str, Any]:
    answer = rigfit("run", "spring.pull", *logs, "--out", folder / "out")
    assert answer.status == 0, answer.err
    return found(folder / "out")


def test_the_same_samples_in_another_unit_and_later_by_the_clock_are_counted_once(tmp_path: Path, rigfit: Call) -> None:
    rows = pull(1)
    logs = [write(tmp_path / "a.csv", rows), write(tmp_path / "again.csv", rows + np.array([7.0, 0, 0]), unit="mm")]
    logs.append(write(tmp_path / "b.csv", pull(2)))
    findings = run(rigfit, tmp_path, *logs)
    assert used(findings) == ["a", "b"]
    assert findings["verdict"] == "warning"
    [told] = [q for q in findings["quality"] if q["run"] == "again"]
    assert told["level"] == "warning"
    assert "again.csv holds the same samples as run 'a'" in told["message"]
    assert "a.csv" in told["message"]


def test_the_beginning_of_a_run_is_no_run_of_its_own(tmp_path: Path, rigfit: Call) -> None:
    rows = pull(1)
    findings = run(rigfit, tmp_path, write(tmp_path / "cut.csv", rows[:150]), write(tmp_path / "whole.csv", rows))
    assert used(findings) == ["whole"]
    told = rigfit("check", "-e", "spring.pull", tmp_path / "cut.csv", tmp_path / "whole.csv")
    assert told.status == 0
    assert "only the first 150 samples of run 'whole'" in told.out
    assert "only the first 150 samples of run 'whole'" in findings["runs"][-1]["reason"]


def test_a_recording_with_two_labels_does_not_enter(tmp_path: Path, rigfit: Call) -> None:
    logs = [
        write(tmp_path / "a.csv", pull(1), "1 mm"),
        write(tmp_path / "a2.csv", pull(1), "2 mm"),
        write(tmp_path / "b.csv", pull(2), "1 mm"),
    ]
    findings = run(rigfit, tmp_path, *logs)
    assert used(findings) == ["b"]
    assert findings["verdict"] == "warning"
    for name in ("a", "a2"):
        [told] = [q["message"] for q in findings["quality"] if q["run"] == name and q["level"] == "error"]
        assert "a.csv" in told
        assert "a2.csv" in told
        assert "wire_diameter is 0.002 m by run 'a2' and 0.001 m by run 'a'" in told
        assert any(f"Run {name} is left out" in reason for reason in findings["reasons"])


def test_a_label_beside_none_is_no_contradiction_and_holds() -> None:
    time, extension, force = pull(1).T
    channels = {"extension": Channel("extension", extension, "m"), "force": Channel("force", force, "N")}
    bare = Recording("bare", {"": Stream("", time, channels)})
    labelled = replace(bare, run="labelled", conditions={"wire_diameter": 1e-3})
    recordings = [bare, labelled]
    [repeat] = repeated([Head.of(recording) for recording in recordings], recordings, experiment("spring.pull"))
    assert (repeat.run, repeat.of, repeat.contradicted) == ("bare", "labelled", "")


def test_a_recording_with_two_labels_alone_is_refused_with_both_files(tmp_path: Path, rigfit: Call) -> None:
    logs = [write(tmp_path / "a.csv", pull(1), "1 mm"), write(tmp_path / "a2.csv", pull(1), "2 mm")]
    answer = rigfit("run", "spring.pull", *logs, "--out", tmp_path / "out")
    assert answer.status == 2
    assert "labels contradict" in answer.err
    checked = rigfit("check", "-e", "spring.pull", *logs)
    assert checked.status == 2
    assert "labels contradict" in checked.out
    assert "'exclude'" in answer.err


def test_runs_that_share_a_set_value_or_their_command_are_two(tmp_path: Path, rigfit: Call) -> None:
    first, second = pull(1), pull(2)
    assert np.array_equal(first[:, 1], second[:, 1]), "both follow the same command"
    findings = run(rigfit, tmp_path, write(tmp_path / "a.csv", first), write(tmp_path / "b.csv", second))
    assert used(findings) == ["a", "b"]


@pytest.fixture
def campaign(project: Path, rigfit: Call) -> Path:
    assert rigfit("new", "spring.pull", "wire").status == 0
    write(project / "datasets/wire/a.csv", pull(1), "1 mm")
    write(project / "datasets/wire/b.csv", pull(2), "1 mm")
    return project


def test_a_repeat_that_is_gone_leaves_the_other_label_in_force(campaign: Path, rigfit: Call) -> None:
    write(campaign / "datasets/wire/a2.csv", pull(1), "2 mm")
    for stage in ("ingest", "identify"):
        assert rigfit(stage, "wire").status == 0
    assert used(found(campaign / "reports/wire")) == ["b"]
    (campaign / "datasets/wire/a2.csv").unlink()
    for stage in ("ingest", "identify"):
        assert rigfit(stage, "wire").status == 0
    findings = found(campaign / "reports/wire")
    assert used(findings) == ["a", "b"]
    assert findings["verdict"] == "ok"


def test_a_log_that_cannot_be_read_is_a_log_of_the_campaign_with_its_path_in_the_project(
    campaign: Path, rigfit: Call, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    (campaign / "datasets/wire/broken.csv").write_bytes(b"\0\1\2" * 100)
    clone = tmp_path_factory.mktemp("clone") / "elsewhere"
    shutil.copytree(campaign, clone)
    texts = []
    for project in (campaign, clone):
        monkeypatch.chdir(project)
        for stage in ("ingest", "identify", "report"):
            assert rigfit(stage, "wire").status == 0
        names = ["findings.json", "report.html"]
        texts.append([(project / "reports/wire" / name).read_text() for name in names])
        assert str(project) not in "".join(texts[-1])
    assert texts[0] == texts[1]
    findings = found(campaign / "reports/wire")
    [broken] = [entry for entry in findings["runs"] if not entry["used"]]
    assert broken["files"] == ["datasets/wire/broken.csv"]
    assert "left out: datasets/wire/broken.csv" in broken["reason"]
    assert set(findings["provenance"]["logs"]) == {f"datasets/wire/{name}.csv" for name in ("a", "b", "broken")}


def test_a_head_with_more_rows_than_heads_have_counts_as_none() -> None:
    time, extension, _ = pull(1).T
    bare = Recording("bare", {"": Stream("", time, {"extension": Channel("extension", extension, "m")})})
    told = Head.of(bare).as_json()
    assert Head.from_json(told) is not None
    told["first"] = {"extension": told["first"]["extension"] * 9}
    assert Head.from_json(told) is None
