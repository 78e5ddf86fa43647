"""What was damaged on disk is noticed and made anew; the command that a message advises works as printed."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]


@pytest.fixture
def campaign(project: Path, rigfit: Call) -> Path:
    for words in (("new", "spring.pull", "wire"), ("synthesize", "wire"), ("ingest", "wire"), ("identify", "wire")):
        assert rigfit(*words).status == 0
    return project


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 0xFF
    path.write_bytes(content)


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def remove(path: Path) -> None:
    path.unlink()


def empty(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [flip, truncate, remove, empty])
def test_a_damaged_recording_is_refused_and_read_anew_by_the_command_that_is_printed(
    campaign: Path, rigfit: Call, damage: Callable[[Path], None]
) -> None:
    recording = campaign / "recordings/wire/pull_2.parquet"
    whole = recording.read_bytes()
    other = (campaign / "recordings/wire/pull_1.parquet").stat().st_mtime_ns
    damage(recording)
    answer = rigfit("identify", "wire")
    assert answer.status == 2
    assert "pull_2.parquet" in answer.err
    advised = re.search(r"'rigfit ([^']+)'", answer.err)
    assert advised is not None
    assert rigfit(*advised[1].split()).status == 0
    assert recording.read_bytes() == whole
    assert (campaign / "recordings/wire/pull_1.parquet").stat().st_mtime_ns == other, "the sound one is kept"
    assert rigfit("identify", "wire").status == 0


def test_recordings_of_an_earlier_version_are_read_again(campaign: Path, rigfit: Call) -> None:
    manifest = campaign / "recordings/wire/manifest.json"
    manifest.write_text('{"runs": {"pull_1": {"key": "x", "files": ["pull_1.parquet"]}}, "quality": []}')
    assert rigfit("ingest", "wire").status == 0
    assert rigfit("identify", "wire").status == 0


@pytest.mark.parametrize("name", ["findings.json", "arrays/pulls.parquet"])
def test_damaged_findings_are_an_input_error_that_names_the_file(campaign: Path, rigfit: Call, name: str) -> None:
    truncate(campaign / "reports/wire" / name)
    answer = rigfit("report", "wire")
    assert answer.status == 2
    assert Path(name).name in answer.err
    assert "rigfit identify" in answer.err


def test_a_damaged_entry_of_the_index_is_an_input_error_that_names_it(campaign: Path, rigfit: Call) -> None:
    assert rigfit("report", "wire").status == 0
    (campaign / "reports/entries/wire.json").write_text('{"name"')
    answer = rigfit("index")
    assert answer.status == 2
    assert "wire.json" in answer.err
    assert "'rigfit report wire'" in answer.err
