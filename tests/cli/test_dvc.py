"""DVC runs the chain: only what depends on a change runs again, nothing is wiped, metrics can be compared."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent
TOY_RIG = ROOT / "tests" / "toy_rig"


def run(project: Path, *words: str, status: int = 0) -> str:
    """Run a command of the project's environment in the project and return what it prints."""
    environment = {
        **os.environ,
        "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(TOY_RIG),
        "GIT_CONFIG_GLOBAL": os.devnull,
    }
    done = subprocess.run(words, cwd=project, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == status, f"{words}: {done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


def ran(output: str) -> set[str]:
    return {line.split("'")[1] for line in output.splitlines() if line.startswith("Running stage")}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with two campaigns of the toy rig, one of them synthetic, taken through the chain once."""
    folder = tmp_path_factory.mktemp("dvc") / "project"
    folder.mkdir()
    for name in ("dvc.yaml", ".dvcignore", ".gitignore"):
        shutil.copy(ROOT / name, folder / name)
    (folder / "params.yaml").write_text(
        "campaigns: []\nsynthetic:\n  - one\ndatasets: {}\nuses: [{campaign: two, of: one}]\n"
    )
    for part in ("ingest", "recording", "rigs", "estimation", "signals", "findings", "report"):
        (folder / "pipeline" / part).mkdir(parents=True)
        (folder / "pipeline" / part / "code.py").write_text("")
    run(folder, "git", "init", "-q")
    run(folder, "dvc", "init", "-q")
    run(folder, "rigfit", "new", "spring.pull", "one")
    run(folder, "rigfit", "new", "spring.pull", "two")
    run(folder, "rigfit", "synthesize", "spring.pull", "--out", str(folder / "made"))
    shutil.copy(folder / "made" / "pull_1.csv", folder / "datasets" / "two" / "first.csv")
    recipe = folder / "recipes" / "two.yaml"
    recipe.write_text(recipe.read_text() + "uses: [one]\n")
    out = run(folder, "dvc", "repro")
    assert {"synthesize@one", "ingest@one", "identify@two", "report@two", "index"} <= ran(out)
    return folder


def test_a_second_repro_does_nothing(project: Path) -> None:
    assert ran(run(project, "dvc", "repro")) == set()


def test_a_dropped_log_reruns_its_campaign_only_and_old_recordings_stay(project: Path) -> None:
    old = project / "recordings" / "two" / "first.parquet"
    before = old.stat().st_mtime_ns
    shutil.copy(project / "made" / "pull_2.csv", project / "datasets" / "two" / "second.csv")
    out = ran(run(project, "dvc", "repro"))
    assert out == {"ingest@two", "identify@two", "report@two", "index"}
    assert old.stat().st_mtime_ns == before
    findings = json.loads((project / "reports" / "two" / "findings.json").read_text())
    assert [entry["run"] for entry in findings["runs"]] == ["first", "second"]


@pytest.mark.thorough
def test_new_findings_of_a_campaign_rerun_the_one_that_uses_them_without_reading_its_logs_again(project: Path) -> None:
    recording = project / "recordings" / "two" / "first.parquet"
    before = recording.stat().st_mtime_ns
    recipe = project / "recipes" / "one.yaml"
    recipe.write_text(recipe.read_text().replace("settings:\n", "settings: {largest_extension: 0.015}\n"))
    assert {"identify@one", "hand-over@0", "ingest@two", "identify@two"} <= ran(run(project, "dvc", "repro"))
    assert recording.stat().st_mtime_ns == before
    assert ran(run(project, "dvc", "repro")) == set()


@pytest.mark.thorough
def test_a_changed_setting_does_not_read_the_logs_again_and_metrics_tell_the_difference(project: Path) -> None:
    run(project, "git", "add", "-A")
    run(project, "git", "-c", "user.name=t", "-c", "user.email=t@example.org", "commit", "-qm", "state")
    recording = project / "recordings" / "two" / "first.parquet"
    before = recording.stat().st_mtime_ns
    recipe = project / "recipes" / "two.yaml"
    recipe.write_text(recipe.read_text().replace("settings:\n", "settings: {largest_extension: 0.01}\n"))
    run(project, "dvc", "repro")
    assert recording.stat().st_mtime_ns == before
    assert "reports/two/metrics.json" in run(project, "dvc", "metrics", "show")
    assert "largest_extension" in run(project, "dvc", "params", "diff")
    run(project, "dvc", "metrics", "diff")
    run(project, "dvc", "plots", "show", "-o", str(project / "plots_page"))


def test_a_campaign_that_fails_keeps_its_earlier_results(project: Path) -> None:
    page = project / "reports" / "two" / "report.html"
    kept = page.read_bytes()
    recipe = project / "recipes" / "two.yaml"
    good = recipe.read_text()
    recipe.write_text(good.replace("settings:", "setings:"))
    out = run(project, "dvc", "repro", status=255)
    assert "setings" in out
    assert page.read_bytes() == kept
    recipe.write_text(good)
    run(project, "dvc", "repro")
