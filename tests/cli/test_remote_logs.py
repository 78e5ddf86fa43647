"""Logs that lie elsewhere, through the command line: check, run, new and fetch; and through DVC."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fsspec
import pytest

from pipeline.recording.storage import sha256_of

Call = Callable[..., Any]


@pytest.fixture
def there(project: Path, rigfit: Call) -> str:
    """A folder in memory with two logs of the toy rig, its URL."""
    assert rigfit("synthesize", "spring.pull", "--out", project / "made").status == 0
    memory = fsspec.filesystem("memory")
    if memory.exists("/lab"):
        memory.rm("/lab", recursive=True)
    for number in (1, 2):
        memory.pipe(f"/lab/monday/pull_{number}.csv", (project / "made" / f"pull_{number}.csv").read_bytes())
    return "memory://lab"


def put(name: str, content: bytes) -> None:
    fsspec.filesystem("memory").pipe(f"/lab/{name}", content)


def test_check_tells_of_a_url_what_it_tells_of_the_file(there: str, project: Path, rigfit: Call) -> None:
    for words in ([], ["-e", "spring.pull"]):
        remote = rigfit("check", f"{there}/monday/pull_1.csv", *words)
        local = rigfit("check", project / "made" / "pull_1.csv", *words)
        assert remote.status == local.status == 0
        assert remote.out == local.out.replace(str(project / "made"), f"{there}/monday")


def test_check_of_a_damaged_log_names_its_url(there: str, rigfit: Call) -> None:
    put("monday/broken.csv", b"\x00\x01\x02nothing")
    answer = rigfit("check", there, "-e", "spring.pull")
    assert answer.status == 2
    assert f"{there}/monday/broken.csv" in answer.out + answer.err
    assert f"{there}/monday/pull_2.csv: delimited text" in answer.out
    assert "rigfit-" not in answer.out + answer.err


def test_run_keeps_the_url_and_the_hash_of_each_log_and_no_temporary_path(
    there: str, project: Path, rigfit: Call
) -> None:
    answer = rigfit("run", "spring.pull", there, "--out", project / "out")
    assert answer.status == 0, answer.err
    findings = json.loads((project / "out" / "findings.json").read_text())
    assert [run["run"] for run in findings["runs"]] == ["pull_1", "pull_2"]
    said = json.dumps(findings)
    for number in (1, 2):
        assert f"{there}/monday/pull_{number}.csv" in said
        assert sha256_of(project / "made" / f"pull_{number}.csv") in said
    for path in (project / "out").rglob("*"):
        if path.is_file():
            assert b"rigfit-" not in path.read_bytes(), path


def test_a_url_with_a_password_is_nowhere_in_the_results(
    there: str, project: Path, rigfit: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = there.replace("memory://", "memory://lab-user:secret-word@")
    put_at = fsspec.filesystem("memory")
    for number in (1, 2):
        content = (project / "made" / f"pull_{number}.csv").read_bytes()
        put_at.pipe(f"/lab-user:secret-word@lab/pull_{number}.csv", content)
    answer = rigfit("run", "spring.pull", url, "--out", project / "out")
    assert answer.status == 0, answer.err
    assert "secret-word" not in answer.out + answer.err
    for path in (project / "out").rglob("*"):
        if path.is_file():
            assert b"secret-word" not in path.read_bytes(), path
    put_at.rm("/lab-user:secret-word@lab", recursive=True)


def test_conditions_that_lie_with_the_logs_count(there: str, project: Path, rigfit: Call) -> None:
    put("runs.csv", b"run,wire_diameter [mm]\npull_1,2\npull_2,0\n")
    answer = rigfit("check", there, "-e", "spring.pull")
    assert "wire_diameter: 0.002 m (from runs.csv)" in answer.out
    put("copy/runs.csv", b"run,wire_diameter [mm]\npull_1,2\n")
    put("copy/pull_1.csv", (project / "made" / "pull_1.csv").read_bytes())
    twice = rigfit("check", there, f"{there}/copy", "-e", "spring.pull")
    assert twice.status == 2
    assert "several tables of conditions" in twice.err
    (project / "mine.csv").write_text("run,wire_diameter [mm]\npull_1,4\n")
    own = rigfit("check", f"{there}/monday", "-e", "spring.pull", "--runs", project / "mine.csv")
    assert "wire_diameter: 0.004 m" in own.out


@pytest.mark.parametrize("command", [("check",), ("run", "spring.pull")])
def test_a_url_that_cannot_be_read_is_one_paragraph(command: tuple[str, ...], project: Path, rigfit: Call) -> None:
    words = ["--out", "out"] if command[0] == "run" else []
    answer = rigfit(*command, "memory://rigfit-nowhere", *words)
    assert answer.status == 2
    assert answer.err.startswith("rigfit: memory://rigfit-nowhere: there is nothing of this name.")
    assert answer.err.count("\n") == 1
    assert not (project / "out").exists()


def test_a_campaign_elsewhere_goes_from_new_to_ingest(there: str, project: Path, rigfit: Call) -> None:
    made = rigfit("new", "spring.pull", "wire", "--datasets", there)
    assert made.status == 0, made.err
    assert 'datasets: {wire: "memory://lab"}' in (project / "params.yaml").read_text()
    assert "# my campaigns" in (project / "params.yaml").read_text()
    early = rigfit("ingest", "wire")
    assert early.status == 2
    assert "rigfit fetch wire" in early.err
    assert "2 logs fetched, 0 removed, 0 as before; in datasets/wire/fetched/" in rigfit("fetch", "wire").out
    assert rigfit("ingest", "wire").status == 0
    manifest = (project / "recordings" / "wire" / "manifest.json").read_text()
    put("monday/pull_3.csv", (project / "made" / "pull_1.csv").read_bytes().replace(b"0", b"1", 1))
    assert "1 log fetched, 0 removed, 2 as before" in rigfit("fetch", "wire").out
    assert (project / "recordings" / "wire" / "manifest.json").read_text() == manifest


def test_a_table_of_conditions_here_and_one_elsewhere_are_an_error(there: str, project: Path, rigfit: Call) -> None:
    put("runs.csv", b"run,wire_diameter [mm]\npull_1,2\n")
    rigfit("new", "spring.pull", "wire", "--datasets", there)
    assert rigfit("fetch", "wire").status == 0
    assert rigfit("ingest", "wire").status == 0
    (project / "datasets" / "wire" / "runs.csv").write_text("run,wire_diameter [mm]\npull_1,2\n")
    answer = rigfit("ingest", "wire")
    assert answer.status == 2
    assert "datasets/wire/runs.csv and datasets/wire/fetched/runs.csv: there are two tables" in answer.err


def test_a_place_that_is_gone_leaves_everything_and_says_so(there: str, project: Path, rigfit: Call) -> None:
    rigfit("new", "spring.pull", "wire", "--datasets", there)
    rigfit("fetch", "wire")
    before = sorted((project / "datasets").rglob("*"))
    fsspec.filesystem("memory").rm("/lab", recursive=True)
    answer = rigfit("fetch", "wire")
    assert answer.status == 2
    assert answer.err.startswith("rigfit: wire: memory://lab: there is nothing of this name.")
    assert "Recordings and reports are as they were." in answer.err
    assert sorted((project / "datasets").rglob("*")) == before


@pytest.mark.parametrize(
    ("datasets", "words"),
    [
        ("datasets: {}", "gives no URL for the campaign 'wire'"),
        ("datasets: [wire]", "line 2: 'datasets' must say of campaigns where their logs lie"),
        ("datasets: {wire: }", "line 2: 'wire' has no URL"),
        ("datasets: {wire: 7}", "line 2: 'wire' has no URL"),
        ("datasets: {wire: s4://x}", "no file system that is known"),
    ],
)
def test_an_entry_that_is_no_url_is_told_with_its_line(project: Path, rigfit: Call, datasets: str, words: str) -> None:
    rigfit("new", "spring.pull", "wire")
    (project / "params.yaml").write_text(f"campaigns: [wire]\n{datasets}\n")
    answer = rigfit("fetch", "wire")
    assert answer.status == 2
    assert words in answer.err


def test_a_password_does_not_get_into_params(project: Path, rigfit: Call) -> None:
    before = (project / "params.yaml").read_text()
    answer = rigfit("new", "spring.pull", "wire", "--datasets", "sftp://lab:secret-word@host/logs")
    assert answer.status == 2
    assert "sftp://host/logs: the URL holds a user, a password or a signature" in answer.err
    assert "secret-word" not in answer.err
    assert (project / "params.yaml").read_text() == before
    assert not (project / "recipes" / "wire.yaml").exists()


def test_a_path_begins_at_the_project_wherever_the_command_is_given(
    project: Path, rigfit: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    rigfit("synthesize", "spring.pull", "--out", project / "made")
    (project / "recipes" / "deep").mkdir()
    monkeypatch.chdir(project / "recipes" / "deep")
    assert rigfit("new", "spring.pull", "wire", "--datasets", "../../made").status == 0
    assert '{wire: "made"}' in (project / "params.yaml").read_text()
    assert "2 logs fetched" in rigfit("fetch", "wire").out


def test_an_unknown_campaign_is_told_with_the_nearest(project: Path, rigfit: Call) -> None:
    rigfit("new", "spring.pull", "wire")
    answer = rigfit("fetch", "wirre")
    assert answer.status == 2
    assert "Did you mean 'wire'?" in answer.err
