"""What is remembered of files saves reading them, and is never believed of a file that changed."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from pipeline.campaign import ingest_stage, ingested, logs
from pipeline.campaign import seen as seen_module
from pipeline.campaign.alone import alone_in
from pipeline.campaign.recipe import Recipe
from pipeline.campaign.seen import Seen
from pipeline.ingest.registry import reader_for
from pipeline.recording.storage import sha256_of
from pipeline.rigs.registry import experiment

MOMENT = 0.15  # s after which a change is old enough to be believed


def write(path: Path, seed: int) -> Path:
    rng = np.random.default_rng(seed)
    extension = np.linspace(0.0, 0.01, 60) + rng.normal(0, 1e-6, 60)
    rows = "".join(f"{k / 100:.2f},{x:.9f},{200 * x:.9f}\n" for k, x in enumerate(extension))
    path.write_text(f"# wire_diameter: 1 mm\ntime [s],extension [m],force [N]\n{rows}")
    return path


class Reads:
    """Counts which files are hashed and which runs are read."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.hashed: list[str] = []
        self.runs: list[str] = []
        read_one = ingest_stage._read_one

        def hashing(path: Path) -> str:
            self.hashed.append(path.name)
            return sha256_of(path)

        def reading(task: ingest_stage._Task, folder: Path) -> object:
            self.runs.append(task.run)
            return read_one(task, folder)

        monkeypatch.setattr(seen_module, "sha256_of", hashing)
        monkeypatch.setattr(ingest_stage, "_read_one", reading)

    def clear(self) -> None:
        self.hashed.clear()
        self.runs.clear()


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> Reads:
    return Reads(monkeypatch)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "logs").mkdir()
    for k in range(12):
        write(tmp_path / "logs" / f"r{k}.csv", k)
    return tmp_path


def ingest(folder: Path, *, force: bool = False) -> ingested.Ingested:
    recordings = folder / "recordings"
    recipe = Recipe.default(experiment("spring.pull"))
    runs = logs.runs_of(logs.of_folder(folder / "logs"))
    seen = Seen(recordings, force=force)
    return ingest_stage.ingest(recipe, runs, recordings, base=folder, seen=seen, force=force)


def twice(folder: Path, reads: Reads) -> bytes:
    """Ingest and look again when all files are old enough to be believed; return the manifest."""
    ingest(folder)
    time.sleep(MOMENT)
    ingest(folder)
    reads.clear()
    return (folder / "recordings" / ingested.MANIFEST).read_bytes()


def test_of_a_thousand_logs_only_the_new_one_is_looked_into(folder: Path, reads: Reads) -> None:
    twice(folder, reads)
    write(folder / "logs" / "r12.csv", 12)
    assert list(ingest(folder).files) == [f"r{k}" for k in range(13)]
    assert reads.runs == ["r12"]
    assert reads.hashed == ["r12.csv"]


def test_a_log_replaced_by_one_of_the_same_size_is_read_again_and_only_it(folder: Path, reads: Reads) -> None:
    twice(folder, reads)
    before = (folder / "logs" / "r3.csv").read_text()
    (folder / "logs" / "r3.csv").write_text(before.replace("0.00,0.00000", "0.00,0.00001"))
    ingest(folder)
    assert reads.runs == ["r3"]
    assert len(before) == (folder / "logs" / "r3.csv").stat().st_size


def test_a_removed_log_takes_its_recording_with_it_and_reads_nothing(folder: Path, reads: Reads) -> None:
    twice(folder, reads)
    (folder / "logs" / "r3.csv").unlink()
    assert "r3" not in ingest(folder).files
    assert not (folder / "recordings" / "r3.parquet").exists()
    assert (reads.runs, reads.hashed) == ([], [])


def test_a_renamed_log_is_a_new_run(folder: Path, reads: Reads) -> None:
    twice(folder, reads)
    (folder / "logs" / "r3.csv").rename(folder / "logs" / "other.csv")
    assert "other" in ingest(folder).files
    assert reads.runs == ["other"]


def test_a_recording_that_was_altered_is_made_anew(folder: Path, reads: Reads) -> None:
    manifest = twice(folder, reads)
    path = folder / "recordings" / "r5.parquet"
    content = path.read_bytes()
    path.write_bytes(content[:100] + b"\0" + content[101:])
    seen = Seen(folder / "recordings")
    recipe = Recipe.default(experiment("spring.pull"))
    ingest_stage.ingest(recipe, logs.runs_of(logs.of_folder(folder / "logs")), path.parent, base=folder, seen=seen)
    assert reads.runs == ["r5"]
    assert path.read_bytes() == content
    assert (path.parent / ingested.MANIFEST).read_bytes() == manifest


def test_a_recording_overwritten_by_that_of_another_run_is_made_anew(folder: Path, reads: Reads) -> None:
    manifest = twice(folder, reads)
    path = folder / "recordings" / "r5.parquet"
    content = path.read_bytes()
    path.write_bytes((folder / "recordings" / "r6.parquet").read_bytes())
    ingest(folder)
    assert reads.runs == ["r5"]
    assert path.read_bytes() == content
    assert (folder / "recordings" / ingested.MANIFEST).read_bytes() == manifest


def test_force_starts_afresh_and_comes_out_the_same(folder: Path, reads: Reads) -> None:
    manifest = twice(folder, reads)
    ingest(folder, force=True)
    assert reads.runs == [f"r{k}" for k in range(12)]
    assert {f"r{k}.csv" for k in range(12)} <= set(reads.hashed)
    assert (folder / "recordings" / ingested.MANIFEST).read_bytes() == manifest


@pytest.mark.parametrize("content", [b"", b"[]", b'{"hashes": 3}', b"\0\xff", b"0" * 64 + b'\n{"hashes": {}}\n'])
def test_without_what_was_seen_all_comes_out_the_same(folder: Path, reads: Reads, content: bytes) -> None:
    manifest = twice(folder, reads)
    (folder / ".recordings.seen.json").write_bytes(content)
    ingest(folder)
    assert reads.runs == []
    assert len(reads.hashed) == 24
    assert (folder / "recordings" / ingested.MANIFEST).read_bytes() == manifest


def test_a_file_changed_a_moment_ago_is_looked_into_again(tmp_path: Path, reads: Reads) -> None:
    def looked_into() -> int:
        seen = Seen(tmp_path / "recordings")
        assert seen.sha256(path) == sha256_of(path)
        seen.save()
        return len(reads.hashed)

    path = tmp_path / "log.csv"
    path.write_text("1,2,3\n")
    assert [looked_into(), looked_into()] == [1, 2]
    time.sleep(MOMENT)
    assert [looked_into(), looked_into()] == [3, 3]


def test_a_file_that_changes_while_it_is_hashed_is_looked_into_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "log.csv"
    path.write_text("1,2,3\n")

    def slowly(path: Path) -> str:
        digest = sha256_of(path)
        path.write_text("4,5,6\n")
        time.sleep(MOMENT)
        return digest

    with monkeypatch.context() as patch:
        patch.setattr(seen_module, "sha256_of", slowly)
        seen = Seen(tmp_path / "recordings")
        seen.sha256(path)
        seen.save()
    assert Seen(tmp_path / "recordings").sha256(path) == sha256_of(path)


def test_a_log_of_the_same_size_with_its_time_put_back_is_read_again(folder: Path, reads: Reads) -> None:
    twice(folder, reads)
    path = folder / "logs" / "r3.csv"
    about = path.stat()
    path.write_text(path.read_text().replace("0.00,0.00000", "0.00,0.00001"))
    os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (about.st_size, about.st_mtime_ns)
    ingest(folder)
    assert reads.runs == ["r3"]


def test_an_identification_that_finds_a_damaged_recording_makes_the_next_ingest_look_into_all(
    folder: Path, reads: Reads
) -> None:
    twice(folder, reads)
    path = folder / "recordings" / "r5.parquet"
    content = path.read_bytes()
    path.write_bytes(content[:100] + b"\0" + content[101:])
    with pytest.raises(ingested.InputError, match="rigfit ingest recordings"):
        ingested.load(folder / "recordings").recordings()
    ingest(folder)
    assert reads.runs == ["r5"]
    assert path.read_bytes() == content


def test_a_newer_reader_reads_its_logs_again_and_no_others(
    folder: Path, reads: Reads, monkeypatch: pytest.MonkeyPatch
) -> None:
    with h5py.File(folder / "logs" / "r12.h5", "w") as file:
        for name, unit, scale in (("time", "s", 0.01), ("extension", "m", 1e-4), ("force", "N", 0.02)):
            file[name] = scale * np.arange(60.0)
            file[name].attrs["unit"] = unit
        file.attrs["wire_diameter"] = "1 mm"
    assert "r12" in ingest(folder).files
    ingest(folder)
    reads.clear()
    hdf5 = reader_for(folder / "logs" / "r12.h5")
    monkeypatch.setattr(type(hdf5), "version", hdf5.version + 1)
    ingest(folder)
    assert reads.runs == ["r12"]


def test_a_log_is_read_again_when_a_file_changes_that_it_is_read_with(
    folder: Path, reads: Reads, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = folder / "definitions.txt"
    beside.write_text("one")
    reader = reader_for(folder / "logs" / "r0.csv")
    monkeypatch.setattr(type(reader), "beside", lambda _, path: [beside] if path.stem == "r3" else [])
    twice(folder, reads)
    beside.write_text("two")
    ingest(folder)
    assert reads.runs == ["r3"]


def test_definitions_of_messages_and_unwritten_rows_belong_to_a_ros_2_bag(tmp_path: Path) -> None:
    bag = tmp_path / "test" / "bag_0.db3"
    (tmp_path / "my_msgs" / "msg").mkdir(parents=True)
    bag.parent.mkdir()
    bag.write_bytes(b"SQLite format 3\0")
    own, waiting = tmp_path / "my_msgs" / "msg" / "Sample.msg", bag.with_name("bag_0.db3-wal")
    assert list(reader_for(bag).beside(bag)) == []
    own.write_text("float64 force\n")
    waiting.write_bytes(b"rows")
    assert set(reader_for(bag).beside(bag)) == {own, waiting}


def test_an_ingest_that_is_killed_goes_on_where_it_was(
    folder: Path, reads: Reads, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = {path.name: path.read_bytes() for path in ingest(folder).folder.iterdir()}
    for path in (folder / "recordings").iterdir():
        path.unlink()
    (folder / ".recordings.seen.json").unlink()
    reads.clear()
    monkeypatch.setattr(seen_module, "SAVED_EVERY", -1.0)
    monkeypatch.setattr(seen_module, "_SHARE", 0)
    counting = ingest_stage._read_one

    def killed(task: ingest_stage._Task, to: Path) -> object:
        if task.run == "r8":
            raise KeyboardInterrupt
        return counting(task, to)

    monkeypatch.setattr(ingest_stage, "_read_one", killed)
    with pytest.raises(KeyboardInterrupt):
        ingest(folder)
    reads.clear()
    monkeypatch.setattr(ingest_stage, "_read_one", counting)
    assert {path.name: path.read_bytes() for path in ingest(folder).folder.iterdir()} == whole
    assert reads.runs == ["r8", "r9", "r10", "r11"]


def test_two_at_once_on_one_campaign_are_told(project: Path, rigfit: Callable[..., Any]) -> None:
    rigfit("new", "spring.pull", "wire")
    rigfit("synthesize", "wire")
    with alone_in(project / "recordings" / "wire"):
        answer = rigfit("ingest", "wire")
    assert answer.status == 2
    assert "recordings/wire: another rigfit is at work there. Wait until it has ended" in answer.err
    assert rigfit("ingest", "wire").status == 0
