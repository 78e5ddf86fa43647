"""A folder here holds what a URL holds: only what changed is fetched, nothing half, nothing outside, nothing of the user's lost."""

from __future__ import annotations

import json
import os
import shutil
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from pathlib import Path

import fsspec
import pytest

from pipeline.campaign.remote.at_once import at_once, within
from pipeline.campaign.remote.mirror import Mirrored, mirror
from pipeline.campaign.remote.source import RemoteLog, Source
from pipeline.errors import InputError

LOG = "time [s],x [mm]\n0,1\n"


@pytest.fixture
def there(tmp_path: Path) -> Path:
    """A folder elsewhere with three logs, a table of conditions, and what is no log."""
    folder = tmp_path / "there"
    (folder / "monday").mkdir(parents=True)
    for name in ("r1.csv", "r2.csv", "monday/r3.csv", "runs.csv", "notes.md", ".hidden.csv", "monday/runs.csv"):
        (folder / name).write_text(f"{LOG}# {name}\n")
    return folder


@pytest.fixture
def here(tmp_path: Path) -> Path:
    return tmp_path / "campaign" / "fetched"


def fetch(url: object, here: Path) -> Mirrored:
    return mirror(Source(str(url), here.parent), here, lambda _number: nullcontext(lambda _name: None))


def held(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_logs_and_their_conditions_come_with_their_folders_and_nothing_else(there: Path, here: Path) -> None:
    done = fetch(there, here)
    assert sorted(done.fetched) == ["monday/r3.csv", "r1.csv", "r2.csv", "runs.csv"]
    assert held(here) == {name: (there / name).read_text() for name in done.fetched}
    assert sorted(path.name for path in here.parent.iterdir()) == [".fetched.json", "fetched"]


def test_what_did_not_change_is_not_fetched_again_and_keeps_its_file(there: Path, here: Path) -> None:
    fetch(there, here)
    before = {path: path.stat().st_mtime_ns for path in here.rglob("*.csv")}
    notes = (here.parent / ".fetched.json").read_bytes()
    done = fetch(there, here)
    assert (done.fetched, done.removed, len(done.kept)) == ([], [], 4)
    assert {path: path.stat().st_mtime_ns for path in here.rglob("*.csv")} == before
    assert (here.parent / ".fetched.json").read_bytes() == notes


def test_new_replaced_and_removed_logs_are_followed(there: Path, here: Path) -> None:
    fetch(there, here)
    (there / "r4.csv").write_text(LOG)
    (there / "r1.csv").write_text(f"{LOG}# r2.csv\n")  # as long as before
    shutil.rmtree(there / "monday")
    done = fetch(there, here)
    assert (sorted(done.fetched), done.removed) == (["r1.csv", "r4.csv"], ["monday/r3.csv"])
    assert held(here) == {name: (there / name).read_text() for name in ("r1.csv", "r2.csv", "r4.csv", "runs.csv")}
    assert not (here / "monday").exists()


def test_a_log_touched_at_the_source_with_the_same_content_keeps_its_file_here(there: Path, here: Path) -> None:
    fetch(there, here)
    before = (here / "r1.csv").stat().st_mtime_ns
    os.utime(there / "r1.csv", ns=(1, 1))
    assert fetch(there, here).fetched == ["r1.csv"]
    assert (here / "r1.csv").stat().st_mtime_ns == before


@pytest.mark.parametrize("keeps_its_time", [False, True])
def test_a_copy_that_was_altered_or_lost_here_is_fetched_again(there: Path, here: Path, keeps_its_time: bool) -> None:
    fetch(there, here)
    about = (here / "r1.csv").stat()
    (here / "r1.csv").write_text((here / "r1.csv").read_text().replace("0,1", "0,2"))
    if keeps_its_time:
        os.utime(here / "r1.csv", ns=(about.st_atime_ns, about.st_mtime_ns))
    (here / "r2.csv").unlink()
    assert sorted(fetch(there, here).fetched) == ["r1.csv", "r2.csv"]
    assert held(here)["r1.csv"] == (there / "r1.csv").read_text()


def test_a_copied_project_needs_no_new_fetch(there: Path, here: Path, tmp_path: Path) -> None:
    fetch(there, here)
    shutil.copytree(here.parent, tmp_path / "clone", copy_function=shutil.copyfile)
    assert fetch(there, tmp_path / "clone" / "fetched").fetched == []


def test_another_place_is_fetched_anew_even_where_its_marks_are_the_same(
    there: Path, here: Path, tmp_path: Path
) -> None:
    fetch(there, here)
    shutil.copytree(there, tmp_path / "moved")
    (tmp_path / "moved" / "r1.csv").write_text(LOG)
    assert sorted(fetch(tmp_path / "moved", here).fetched) == ["monday/r3.csv", "r1.csv", "r2.csv", "runs.csv"]
    assert held(here)["r1.csv"] == LOG


def test_without_its_notes_or_with_broken_ones_everything_is_fetched_again(there: Path, here: Path) -> None:
    fetch(there, here)
    for content in ("", "[]", '{"logs": {"r1.csv": 1}}', '{"origin": 1, "logs": []}'):
        (here.parent / ".fetched.json").write_text(content)
        assert len(fetch(there, here).fetched) == 4


def test_an_own_log_in_the_folder_is_kept_and_told(there: Path, here: Path) -> None:
    fetch(there, here)
    (here / "own.csv").write_text(LOG)
    assert fetch(there, here).foreign == ["own.csv"]
    assert (here / "own.csv").read_text() == LOG


def test_an_interrupted_fetch_goes_on_where_it_was(there: Path, here: Path) -> None:
    @contextmanager
    def stopped(_number: int) -> Iterator[Callable[[str], None]]:
        done: list[str] = []

        def step(name: str) -> None:
            done.append(name)
            if len(done) == 3:
                raise KeyboardInterrupt

        yield step

    with pytest.raises(KeyboardInterrupt):
        mirror(Source(str(there), here.parent), here, stopped)
    assert sorted(path.name for path in here.parent.iterdir()) == [".fetched.json", "fetched"]
    assert len(held(here)) == 3
    (here.parent / ".fetched.partial").mkdir()
    (here.parent / ".fetched.partial" / "0").write_text("half")  # as a killed one leaves it
    assert len(fetch(there, here).fetched) == 1
    assert not (here.parent / ".fetched.partial").exists()


def test_nothing_leads_out_of_the_folder(here: Path, tmp_path: Path) -> None:
    archive = tmp_path / "logs.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for name in ("../evil.csv", "a/../../../evil.csv", "b\\..\\evil.csv", "c.csv", "c:d?.csv"):
            file.writestr(name, name)
    done = fetch(f"zip::{archive}", here)
    assert sorted(held(here).values()) == ["../evil.csv", "a/../../../evil.csv", "b\\..\\evil.csv", "c.csv", "c:d?.csv"]
    assert {path.name for path in tmp_path.iterdir()} == {"logs.zip", "campaign"}
    assert {path.name for path in here.parent.iterdir()} == {"fetched", ".fetched.json"}
    assert len(done.fetched) == 5
    assert fetch(f"zip::{archive}", here).fetched == []


def test_a_link_in_the_folder_is_replaced_and_what_it_leads_to_is_left_alone(
    there: Path, here: Path, tmp_path: Path
) -> None:
    fetch(there, here)
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "r3.csv").write_text("mine")
    shutil.rmtree(here / "monday")
    (here / "monday").symlink_to(outside)
    assert fetch(there, here).fetched == ["monday/r3.csv"]
    assert not (here / "monday").is_symlink()
    shutil.rmtree(here / "monday")
    (here / "monday").symlink_to(outside)
    (there / "monday" / "r3.csv").unlink()
    fetch(there, here)
    assert (outside / "r3.csv").read_text() == "mine"


def test_a_log_that_becomes_a_folder_and_back_is_followed(there: Path, here: Path) -> None:
    fetch(there, here)
    (there / "r1.csv").unlink()
    (there / "r1.csv").mkdir()
    (there / "r1.csv" / "part.csv").write_text(LOG)
    assert fetch(there, here).fetched == ["r1.csv/part.csv"]
    shutil.rmtree(there / "r1.csv")
    (there / "r1.csv").write_text(LOG)
    fetch(there, here)
    assert sorted(held(here)) == ["monday/r3.csv", "r1.csv", "r2.csv", "runs.csv"]


def test_links_at_the_source_are_followed_and_what_is_no_file_is_passed_by(there: Path, here: Path) -> None:
    (there / "link.csv").symlink_to(there / "r1.csv")
    (there / "broken.csv").symlink_to(there / "nowhere")
    os.mkfifo(there / "pipe.csv")
    assert sorted(fetch(there, here).fetched) == ["link.csv", "monday/r3.csv", "r1.csv", "r2.csv", "runs.csv"]
    assert not (here / "link.csv").is_symlink()


def test_logs_in_memory_and_in_archives_are_fetched_like_others(here: Path, tmp_path: Path) -> None:
    memory = fsspec.filesystem("memory")
    memory.pipe("/rigfit-mirror/a/r1.csv", LOG.encode())
    assert fetch("memory://rigfit-mirror", here).fetched == ["a/r1.csv"]
    assert fetch("memory://rigfit-mirror", here).fetched == []
    memory.pipe("/rigfit-mirror/a/r1.csv", LOG.encode()[::-1])
    assert fetch("memory://rigfit-mirror", here).fetched == ["a/r1.csv"]
    with zipfile.ZipFile(tmp_path / "logs.zip", "w") as file:
        file.writestr("monday/r2.csv", LOG)
    assert fetch("zip::../logs.zip", here).removed == ["a/r1.csv"]
    assert held(here) == {"monday/r2.csv": LOG}


def test_one_log_and_a_pattern_are_places_too(there: Path, here: Path) -> None:
    assert fetch(there / "r1.csv", here).fetched == ["r1.csv"]
    assert sorted(fetch(f"{there}/r*.csv", here).fetched) == ["r1.csv", "r2.csv", "runs.csv"]


def test_a_log_is_called_by_its_own_url(there: Path, tmp_path: Path) -> None:
    archive = tmp_path / "logs.zip"
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("monday/r2.csv", LOG)

    def called(url: str) -> list[str]:
        source = Source(url, tmp_path)
        return [source.called(log) for log in source.logs()]

    for url in ("zip::", "zip://monday::", "zip://monday/*.csv::", "zip://monday/r2.csv::"):
        assert called(f"{url}{archive}") == [f"zip://monday/r2.csv::{archive}"]
    assert called(there.as_uri())[0] == called(f"{there.as_uri()}/monday/")[0] == f"{there.as_uri()}/monday/r3.csv"
    assert called("there/monday/r3.csv") == ["there/monday/r3.csv"]


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("s4://bucket/x", ["'s4://' is no file system that is known", "s3://"]),
        ("memori://x", ["Did you mean 'memory'?"]),
        ("s3:/bucket/x", ["a URL begins with 's3://' where this has 's3:/'"]),
        ("gs://bucket/x", ["takes a package that is not installed", "gcsfs"]),
        ("file:///nowhere/at/all", ["file:///nowhere/at/all: there is nothing of this name"]),
        ("memory://rigfit-nothing", ["there is nothing of this name", "capitals too"]),
        ("http://127.0.0.1:9/logs", ["cannot be reached"]),
        ("http://lab:secret@127.0.0.1:9/logs", ["http://127.0.0.1:9/logs: cannot be reached"]),
    ],
)
def test_a_place_that_cannot_be_read_is_told_in_plain_words(url: str, words: list[str], here: Path) -> None:
    if url.startswith("gs:") and find_spec("gcsfs"):
        pytest.skip("gcsfs is installed")
    with pytest.raises(InputError) as told:
        fetch(url, here)
    for word in words:
        assert word in str(told.value)
    assert "secret" not in str(told.value)
    assert not here.exists()


def test_a_place_without_logs_changes_nothing_here(there: Path, here: Path) -> None:
    fetch(there, here)
    before = held(here)
    for path in (*there.glob("r?.csv"), there / "monday" / "r3.csv"):
        path.unlink()
    with pytest.raises(InputError, match="holds no logs"):
        fetch(there, here)
    assert held(here) == before


@pytest.mark.parametrize("place", [".", "fetched", "fetched/monday", ".."])
def test_a_folder_is_not_copied_into_itself(there: Path, here: Path, place: str) -> None:
    fetch(there, here)
    with pytest.raises(InputError, match="lie one in the other"):
        fetch(here.parent / place, here)


def test_a_log_that_comes_half_is_told_and_the_others_come(
    there: Path, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = Source.logs

    def announced(source: Source) -> list[RemoteLog]:
        return [
            RemoteLog(log.name, log.key, (log.size or 0) + (log.name == "r1.csv"), log.mark) for log in listed(source)
        ]

    monkeypatch.setattr(Source, "logs", announced)
    with pytest.raises(InputError, match=r"of 'r1.csv' came 29 bytes, expected are 30.*run the same command again"):
        fetch(there, here)
    assert sorted(held(here)) == ["monday/r3.csv", "r2.csv", "runs.csv"]


def test_logs_that_may_not_be_read_are_named_and_the_others_come(
    there: Path, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    get = Source.fetch

    def refused(source: Source, log: RemoteLog, path: Path) -> None:
        if log.name.startswith("r1"):
            raise PermissionError(13, "Permission denied")
        get(source, log, path)

    monkeypatch.setattr(Source, "fetch", refused)
    with pytest.raises(InputError, match=r"'r1.csv': there is no permission to read it .*Ask its owner"):
        fetch(there, here)
    assert sorted(held(here)) == ["monday/r3.csv", "r2.csv", "runs.csv"]


def test_notes_hold_no_secret(there: Path, here: Path) -> None:
    fetch(there, here)
    notes = json.loads((here.parent / ".fetched.json").read_text())
    assert notes["origin"] == str(there)
    assert set(notes["logs"]["r1.csv"]) == {"mark", "size", "sha256", "stamps"}


def test_who_does_not_answer_is_not_waited_for_for_ever() -> None:
    with pytest.raises(TimeoutError):
        within(lambda: time.sleep(30), 0.2)
    stuck = [name for name, error in at_once(lambda _task: time.sleep(30), [1, 2, 3], 2, seconds=0.2) if error]
    assert sorted(stuck) == [1, 2, 3]


def test_a_slow_transfer_that_goes_on_is_waited_for() -> None:
    came: list[int] = []

    def slow(_task: int) -> None:
        for _ in range(12):
            time.sleep(0.1)
            came.append(1)

    assert [error for _, error in at_once(slow, [1, 2], 2, lambda: len(came), 0.8)] == [None, None]


def test_what_a_task_raises_is_told_with_the_task() -> None:
    def work(task: int) -> None:
        if task == 2:
            raise ValueError("two")

    found = {task: str(error) for task, error in at_once(work, [1, 2, 3], 2)}
    assert found == {1: "None", 2: "two", 3: "None"}
