"""A stage that is killed leaves nothing half-written that counts; the next run repairs it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]
TOY_RIG = Path(__file__).resolve().parents[1] / "toy_rig"


@pytest.fixture
def campaign(project: Path, rigfit: Call) -> Path:
    rigfit("new", "spring.pull", "wire")
    rigfit("synthesize", "wire")
    rigfit("ingest", "wire")
    rigfit("identify", "wire")
    return project


def results(project: Path) -> dict[str, bytes]:
    kept = [*(project / "recordings/wire").glob("*"), project / "reports/wire/findings.json"]
    return {path.name: path.read_bytes() for path in sorted(kept)}


def test_what_a_killed_stage_left_behind_is_removed_and_redone(campaign: Path, rigfit: Call) -> None:
    good = results(campaign)
    folder = campaign / "recordings" / "wire"
    (folder / "pull_1.parquet").unlink()
    (folder / ".pull_1.parquet.123.partial").write_bytes(b"half")
    assert rigfit("ingest", "wire").status == 0
    assert rigfit("identify", "wire").status == 0
    assert results(campaign) == good


def test_a_damaged_manifest_means_reading_again(campaign: Path, rigfit: Call) -> None:
    good = results(campaign)
    (campaign / "recordings/wire/manifest.json").write_text('{"runs": {"pull_1"')
    assert rigfit("ingest", "wire").status == 0
    assert results(campaign) == good


def test_a_damaged_recording_is_an_error_that_says_what_to_do(campaign: Path, rigfit: Call) -> None:
    (campaign / "recordings/wire/pull_2.parquet").write_bytes(b"PAR1 not really")
    answer = rigfit("identify", "wire")
    assert answer.status == 2
    assert "pull_2.parquet" in answer.err
    assert "rigfit ingest" in answer.err


@pytest.mark.parametrize(
    ("words", "after"),
    [(("ingest", "wire", "--force"), 0.5), (("ingest", "wire", "--force"), 0.8), (("identify", "wire"), 1.0)],
    ids=["ingest, early", "ingest", "identify"],
)
def test_kill_at_any_moment_and_the_next_run_completes_identically(
    campaign: Path, rigfit: Call, words: tuple[str, ...], after: float
) -> None:
    good = results(campaign)
    environment = {**os.environ, "PYTHONPATH": str(TOY_RIG)}
    command = [sys.executable, "-m", "pipeline.cli", *words]
    with subprocess.Popen(command, cwd=campaign, env=environment, stdout=subprocess.DEVNULL) as process:
        time.sleep(after)
        process.send_signal(signal.SIGKILL)
    assert rigfit("ingest", "wire").status == 0
    assert rigfit("identify", "wire").status == 0
    assert results(campaign) == good
    assert not list(campaign.rglob("*.partial"))
