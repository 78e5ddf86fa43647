"""`dvc repro` that is killed with all that it started: the next one ends as if nothing had been."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import crash


@pytest.mark.thorough
def test_a_killed_chain_is_completed_by_the_next_run(tmp_path: Path) -> None:
    project = crash.new_project(tmp_path)
    expected = crash.undisturbed(project)
    for share in (0.2, 0.5, 0.8):
        outcome = crash.kill_once(project, share * expected.seconds, expected)
        assert not outcome.failed, outcome
        assert not outcome.wrong, outcome
