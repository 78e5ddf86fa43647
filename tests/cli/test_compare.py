"""`rigfit compare`: what a word names, what is said where it names nothing, findings of a revision that DVC keeps."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.findings import Findings, Parameter, Run, storage

BIN = Path(sys.executable).parent


def findings(k: float, campaign: str = "one", experiment: str = "mre.shear") -> Findings:
    """Findings with one key parameter of `k` N/m and one of a run."""
    error = {"std_error": 0.1e3, "ci95": (k - 0.2e3, k + 0.2e3), "unit": "N/m"}
    parameters = [
        Parameter(name="k1", symbol="k_1", value=k, **error),
        Parameter(name="stiffness_secant", symbol="K", value=2e5, at={"run": "<b>r</b>"}, unit="N/m"),
    ]
    runs = [Run(run="r", files=["r.csv"], sha256=["a" * 64])]
    return Findings(campaign=campaign, experiment=experiment, verdict="ok", parameters=parameters, runs=runs)


def put(project: Path, found: Findings) -> None:
    """Make a campaign of the project with these findings."""
    (project / "recipes" / f"{found.campaign}.yaml").write_text(f"experiment: {found.experiment}\n")
    params = project / "params.yaml"
    if found.campaign not in params.read_text():
        params.write_text(params.read_text().replace("campaigns: [", f"campaigns: [{found.campaign}, "))
    storage.write(found, project / "reports" / found.campaign)


def test_two_campaigns_are_compared_and_what_moved_is_said(project: Path, rigfit: Callable) -> None:
    put(project, findings(1e5))
    put(project, findings(1.005e5, "two"))
    told = rigfit("compare", "one", "two")
    assert told.status == 0, told.err
    assert "one -> two: ok; 1 parameter changed, most k1, by +5 standard errors" in told.out
    page = (project / "reports" / "comparison.html").read_text()
    assert "100.50 ± 0.10" in page
    assert "+5.0" in page
    assert "have no standard error of its own" not in page
    assert "a difference has no standard error of its own" in page
    assert "<b>r</b>" not in page


def test_a_file_and_its_folder_name_the_same_findings(tmp_path: Path, rigfit: Callable) -> None:
    storage.write(findings(1e5), tmp_path / "a")
    told = rigfit("compare", tmp_path / "a", tmp_path / "a" / "findings.json", "--out", tmp_path / "page.html")
    assert told.status == 0, told.err
    assert "no parameter changed" in told.out
    assert "every number are the same" in (tmp_path / "page.html").read_text()


def test_outside_a_project_a_folder_without_findings_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rigfit: Callable
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    storage.write(findings(1e5), tmp_path / "a")
    assert "empty: holds no findings.json" in rigfit("compare", "a", "empty").err
    told = rigfit("compare", "a", "yesterday").err
    assert "yesterday: there is no such file or folder" in told
    assert "within a project only" in told
    assert rigfit("compare", "a", "a").status == 0
    assert (tmp_path / "comparison.html").is_file()


def test_different_experiments_are_refused(project: Path, rigfit: Callable) -> None:
    put(project, findings(1e5))
    put(project, findings(1e5, "two", "mre.axial"))
    told = rigfit("compare", "one", "two")
    assert told.status == 2
    assert "'one' is a campaign of mre.shear, 'two' one of mre.axial" in told.err


@pytest.mark.parametrize("schema", [0, 2])
def test_findings_of_another_schema_are_refused_as_such(schema: int, tmp_path: Path, rigfit: Callable) -> None:
    content = json.loads(storage.to_json(findings(1e5))) | {"schema": schema}
    if schema == 2:
        content["colour"] = "red"
    (tmp_path / "findings.json").write_text(json.dumps(content))
    told = rigfit("compare", tmp_path, tmp_path)
    assert told.status == 2
    assert f"findings of schema {schema}; this rigfit" in told.err


def test_a_word_that_names_nothing_is_told_what_it_may_name(project: Path, rigfit: Callable) -> None:
    put(project, findings(1e5))
    assert "is not under Git and DVC" in rigfit("compare", "one", "yesterday").err
    assert "no campaign 'on' at 'workspace'. Did you mean 'one'?" in rigfit("compare", ":on", "one").err
    assert "there is no findings.json" in rigfit("compare", "nothing/here.json", "one").err


def run(folder: Path, *words: str) -> None:
    """Run a command of Git or DVC in a folder."""
    environment = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "GIT_CONFIG_GLOBAL": os.devnull}
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def kept(project: Path) -> Path:
    """The project under Git and DVC; its first state, k1 = 100 kN/m, is called `then`."""

    never = "stages: {never: {cmd: 'true', outs: [reports/never/findings.json]}}\n"
    (project / "dvc.yaml").write_text(never)
    put(project, findings(1e5, "never"))
    (project / "reports" / "never" / "findings.json").unlink()
    put(project, findings(1e5))
    run(project, "git", "init", "-q")
    run(project, "dvc", "init", "-q")
    run(project, "dvc", "add", "-q", "reports/one/findings.json")
    run(project, "git", "add", "-A")
    run(project, "git", "-c", "user.name=t", "-c", "user.email=t@example.org", "commit", "-qm", "then")
    run(project, "git", "tag", "then")
    put(project, findings(0.998e5))
    return project


def test_a_revision_is_read_from_dvc_and_held_against_the_present(kept: Path, rigfit: Callable) -> None:
    for words in (("then",), ("then:one", "one"), ("then", "one"), ("then", "workspace")):
        told = rigfit("compare", *words)
        assert told.status == 0, told.err
        assert "one: ok; 1 parameter changed, most k1, by -2 standard errors" in told.out
    assert "1 campaign without findings at either: never." in told.out
    put(kept, findings(1e5, "fresh"))
    told = rigfit("compare", "then")
    assert "fresh: findings only at workspace." in told.out
    assert "findings only at workspace" in (kept / "reports" / "comparison.html").read_text()
    assert "no revision of this project" in rigfit("compare", "yesterday").err
    assert "no campaign 'fresh' at 'then'" in rigfit("compare", "then:fresh", "fresh").err
    for blob in (kept / ".dvc" / "cache").rglob("*"):
        if blob.is_file():
            blob.chmod(0o644)
            blob.unlink()
    assert "its bytes are not in the cache here" in rigfit("compare", "then").err


def test_a_project_in_a_folder_of_its_repository_is_found_there(
    project: Path, monkeypatch: pytest.MonkeyPatch, rigfit: Callable
) -> None:
    put(project, findings(1e5))
    inner = project / "labs" / "pads"
    inner.mkdir(parents=True)
    for name in ("params.yaml", "dvc.yaml", "recipes", "reports"):
        (project / name).rename(inner / name)
    (inner / "dvc.yaml").write_text("stages: {}\n")
    run(project, "git", "init", "-q")
    run(inner, "dvc", "init", "-q", "--subdir")
    run(inner, "dvc", "add", "-q", "reports/one/findings.json")
    run(project, "git", "add", "-A")
    run(project, "git", "-c", "user.name=t", "-c", "user.email=t@example.org", "commit", "-qm", "then")
    monkeypatch.chdir(inner)
    told = rigfit("compare", "HEAD")
    assert told.status == 0, told.err
    assert "one: ok; no parameter changed" in told.out
