"""From log files to one recording on disk: complete, repeatable, bounded in memory, or nothing at all."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from memory_log import MemoryTable, Spec, log_of

from pipeline.errors import InputError
from pipeline.ingest import ingest
from pipeline.ingest.mapping import ChannelMap
from pipeline.ingest.reader import RawLog, Reader
from pipeline.recording import QualityFinding, Recording
from pipeline.recording.storage import read, read_folder

FORCE, DISPLACEMENT = Spec("force", "N", "shear force"), Spec("displacement", "m", "platelet", limit=0.02)
N, RATE = 20000, 5000.0
TIME = np.arange(N) / RATE
SINE = np.sin(2 * np.pi * 5 * TIME)


class MemoryReader(Reader):
    name = "memory"
    version = 3
    suffixes = (".log",)

    def __init__(self) -> None:
        self.logs: dict[str, RawLog] = {}

    def recognises(self, head: bytes, suffix: str) -> bool:
        return True

    def open(self, path: Path) -> RawLog:
        return self.logs[path.name]


@pytest.fixture
def put(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Make a log of tables that ingest will find at the returned path."""
    reader = MemoryReader()
    monkeypatch.setattr(ingest, "reader_for", lambda path: reader)
    monkeypatch.setattr(ingest, "open_log", reader.open)

    def make(name: str, *tables: MemoryTable, metadata: Mapping[str, str] | None = None) -> Path:
        path = tmp_path / "logs" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"bytes of " + name.encode())
        log = log_of(*tables, metadata=metadata, path=str(path))
        reader.logs[name] = log
        return path

    return make


def shear(n: int = N, **about: object) -> MemoryTable:
    columns = {"time": TIME[:n], "Load cell": 0.2 * SINE[:n], "displacement": 0.4 * SINE[:n], "spare": SINE[:n]}
    units = {"time": "s", "Load cell": "kN", "displacement": "mm", "spare": "V"}
    return MemoryTable(columns, units, **about)


def taken(
    folder: Path,
    files: Path | Sequence[tuple[str, Path]],
    specs: Sequence[Spec] = (FORCE, DISPLACEMENT),
    maps: Mapping[str, ChannelMap] | None = None,
    run: str = "r1",
    **about: object,
) -> list[Path]:
    files = [("", files)] if isinstance(files, Path) else files
    maps = {"force": ChannelMap("Load cell")} if maps is None else maps
    sources = {"coil_current": "runs.csv"}
    return ingest.ingest_run(run, files, specs, maps, {"coil_current": 6.0}, sources, folder, **about)


def test_a_recording_says_all_of_itself(tmp_path: Path, put: Callable[..., Path]) -> None:
    path = put("r1.log", shear())
    notes = [QualityFinding("warning", "coil_current disagrees")]
    (written,) = taken(tmp_path / "out", path, notes=notes, shown={"": "datasets/c/r1.log"})
    assert written == tmp_path / "out" / "r1.parquet"
    back = read(written)
    assert back.run == "r1"
    assert list(back.streams) == [""]
    np.testing.assert_array_equal(back.streams[""].time, TIME)
    np.testing.assert_allclose(back.values("force"), 200 * SINE, rtol=1e-14)
    np.testing.assert_allclose(back.values("displacement"), 4e-4 * SINE, rtol=1e-14)
    assert back.stream_of("force").channels["force"].unit == "N"
    assert back.conditions == {"coil_current": 6.0}
    (file,) = back.provenance.files
    assert (file.path, file.reader, file.size) == ("datasets/c/r1.log", "memory 3", len(b"bytes of r1.log"))
    assert file.units_found == {"time": "s", "force": "kN", "displacement": "mm"}
    assert back.provenance.condition_sources == {"coil_current": "runs.csv"}
    assert back.provenance.repairs == ("datasets/c/r1.log: not taken: spare.",)
    assert [(finding.run, finding.message) for finding in back.quality] == [("r1", "coil_current disagrees")]


def test_repairs_stand_in_the_provenance_and_in_the_quality(tmp_path: Path, put: Callable[..., Path]) -> None:
    table = shear(block_rows=3000)
    table.columns["time"] = TIME.copy()
    table.columns["time"][9000] = TIME[8999]
    table.columns["Load cell"] = table.columns["Load cell"].copy()
    table.columns["Load cell"][5] = np.inf
    back = read(taken(tmp_path / "out", put("r1.log", table)))
    assert back.streams[""].time.size == N - 1
    for part in ("row 9001", "1 infinite value"):
        assert any(part in repair for repair in back.provenance.repairs)
        assert any(part in finding.message for finding in back.quality)
    assert all(finding.run == "r1" for finding in back.quality)


def test_the_rigs_own_check_sees_the_recording_and_its_findings_are_kept(
    tmp_path: Path, put: Callable[..., Path]
) -> None:
    def check(recording: Recording) -> list[QualityFinding]:
        assert recording.condition("coil_current") == 6.0
        size = recording.values("force").size
        return [QualityFinding("error", f"signs are swapped in {size} samples", channel="force")]

    path = put("r1.log", shear())
    (written,) = taken(tmp_path / "out", path, check=check)
    finding = read(written).quality[-1]
    assert (finding.run, finding.message) == ("r1", f"signs are swapped in {N} samples")
    assert json.loads(pq.read_schema(written).metadata[b"rigfit"])["quality"][-1]["level"] == "error"
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["r1.parquet"]


@pytest.mark.parametrize(("offset", "begins"), [(1.7e9, 1.7e9), (12.5, None)])
def test_when_a_log_with_dates_begins_is_kept(
    tmp_path: Path, put: Callable[..., Path], offset: float, begins: float | None
) -> None:
    units = {"time": "s", "displacement": "m", "force": "N"}
    path = put("r1.log", MemoryTable({"time": TIME + offset, "displacement": 1e-4 * SINE, "force": SINE}, units))
    (written,) = taken(tmp_path / "out", path, maps={})
    back = read(written)
    assert back.provenance.begins == begins
    assert any("second 0 is 2023-11-14T22:13:20" in repair for repair in back.provenance.repairs) == bool(begins)


def test_the_same_input_gives_the_same_bytes(tmp_path: Path, put: Callable[..., Path]) -> None:
    path = put("r1.log", shear(block_rows=3000))
    first, second = (taken(tmp_path / folder, path)[0].read_bytes() for folder in ("a", "b"))
    assert first == second
    assert str(tmp_path).encode() not in first, "no absolute path"


def test_files_and_topics_become_streams_with_their_own_clocks(tmp_path: Path, put: Callable[..., Path]) -> None:
    device = put("r1.device.log", MemoryTable({"time": TIME, "force": SINE}, {"time": "s", "force": "N"}))
    bench = put(
        "r1.bench.log",
        MemoryTable(
            {"time": TIME[::100], "displacement": SINE[::100]}, {"time": "s", "displacement": "m"}, name="/a/b"
        ),
        MemoryTable({"time": TIME, "other": SINE}, name="/unused"),
    )
    paths = taken(tmp_path / "out", [("device", device), ("bench", bench)], maps={})
    assert [path.name for path in paths] == ["r1.device.parquet", "r1.bench_a_b.parquet"]
    back = read(paths)
    assert back.streams["device"].rate == pytest.approx(5000)
    assert back.streams["bench_a_b"].rate == pytest.approx(50)
    assert len(back.provenance.files) == 2
    for path in paths:
        assert len(json.loads(pq.read_schema(path).metadata[b"rigfit"])["provenance"]["files"]) == 2


def test_reading_a_run_again_with_other_streams_leaves_no_old_file(tmp_path: Path, put: Callable[..., Path]) -> None:
    two = put(
        "r1.log",
        MemoryTable({"time": TIME, "force": SINE}, {"force": "N"}, name="a"),
        MemoryTable({"time": TIME, "displacement": SINE}, {"displacement": "m"}, name="b"),
    )
    assert len(taken(tmp_path / "out", two, maps={})) == 2
    other = put("r1.x.log", shear())
    taken(tmp_path / "out", other, run="r1.x")
    taken(tmp_path / "out", put("r1.log", shear()))
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["r1.parquet", "r1.x.parquet"]
    assert [recording.run for recording in read_folder(tmp_path / "out")] == ["r1", "r1.x"]


def test_two_runs_do_not_share_a_file(tmp_path: Path, put: Callable[..., Path]) -> None:
    taken(tmp_path, put("r1.a.log", shear()), run="r1.a")
    two = put(
        "r1.log",
        MemoryTable({"time": TIME, "force": SINE}, {"force": "N"}, name="a"),
        MemoryTable({"time": TIME, "displacement": SINE}, {"displacement": "m"}, name="b"),
    )
    with pytest.raises(InputError, match=r"'r1' and 'r1\.a' would both be written to r1\.a\.parquet"):
        taken(tmp_path, two, maps={})


@pytest.mark.parametrize("name", ["", "../evil", "a/b", "a\\b", ".hidden", "a\nb", "a\0b", "x" * 300])
def test_a_name_that_leaves_the_folder_is_refused(tmp_path: Path, put: Callable[..., Path], name: str) -> None:
    path = put("r1.log", shear())
    with pytest.raises(InputError, match="cannot be the name of a run"):
        taken(tmp_path / "out", path, run=name)
    assert not (tmp_path / "out").exists()


def test_a_topic_cannot_leave_the_folder_either(tmp_path: Path, put: Callable[..., Path]) -> None:
    tables = [
        MemoryTable({"time": TIME, "force": SINE}, {"force": "N"}, name="/../../etc/x"),
        MemoryTable({"time": TIME, "displacement": SINE}, {"displacement": "m"}, name="///"),
    ]
    paths = taken(tmp_path / "out", put("r1.log", *tables), maps={})
    assert {path.parent for path in paths} == {tmp_path / "out"}
    assert all(path.is_file() for path in paths)


def test_a_failure_leaves_what_was_there(tmp_path: Path, put: Callable[..., Path]) -> None:
    (written,) = taken(tmp_path / "out", put("r1.log", shear()))
    before = written.read_bytes()
    bad = shear()
    bad.columns["time"] = np.zeros(N)
    with pytest.raises(InputError, match="stands still"):
        taken(tmp_path / "out", put("r1.log", bad))
    assert written.read_bytes() == before
    assert list((tmp_path / "out").iterdir()) == [written]


def test_an_ingest_that_breaks_in_the_middle_leaves_nothing(tmp_path: Path, put: Callable[..., Path]) -> None:
    class Breaking(MemoryTable):
        def blocks(self, names: Sequence[str] | None = None):
            yield from list(super().blocks(names))[:2]
            raise InputError("the file is cut off at byte 12")

    time = np.arange(120_000) / RATE
    columns = {"time": time, "Load cell": np.sin(time), "displacement": np.cos(time)}
    table = Breaking(columns, {"time": "s", "Load cell": "kN", "displacement": "mm"}, block_rows=40_000)
    with pytest.raises(InputError, match="cut off at byte 12"):
        taken(tmp_path / "out", put("r1.log", table))
    assert list((tmp_path / "out").iterdir()) == []


def test_what_a_killed_ingest_left_is_removed(tmp_path: Path, put: Callable[..., Path]) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / ".r1.parquet.4711.partial").write_bytes(b"half")
    taken(out, put("r1.log", shear()))
    assert [path.name for path in out.iterdir()] == ["r1.parquet"]


def test_a_needed_channel_without_values_is_refused_and_an_optional_one_warned_of(
    tmp_path: Path, put: Callable[..., Path]
) -> None:
    table = shear()
    table.columns["displacement"] = np.full(N, np.nan)
    path = put("r1.log", table)
    with pytest.raises(InputError, match=r"r1\.log, channel 'displacement': holds no number in any of 20000 rows"):
        taken(tmp_path, path)
    optional = Spec("displacement", "m", required=False)
    back = read(taken(tmp_path, path, specs=[FORCE, optional]))
    assert any("no value (NaN) in any sample" in finding.message for finding in back.quality)


def test_logs_without_rows_are_refused(tmp_path: Path, put: Callable[..., Path]) -> None:
    empty = MemoryTable({key: values[:0] for key, values in shear().columns.items()}, {"Load cell": "kN"})
    with pytest.raises(InputError, match="holds no rows"):
        taken(tmp_path, put("r1.log", empty))


def test_three_rows_are_a_recording(tmp_path: Path, put: Callable[..., Path]) -> None:
    back = read(taken(tmp_path, put("r1.log", shear(3))))
    assert back.streams[""].time.size == 3


def test_a_log_of_nothing_that_is_asked_for_is_refused(tmp_path: Path, put: Callable[..., Path]) -> None:
    optional = [Spec("temperature", "K", required=False)]
    with pytest.raises(InputError, match="holds none of the channels temperature"):
        taken(tmp_path, put("r1.log", shear()), specs=optional, maps={})


def test_channels_of_words_and_missing_samples_survive(tmp_path: Path, put: Callable[..., Path]) -> None:
    table = shear()
    table.columns["displacement"] = np.where(np.arange(N) == 7, np.nan, table.columns["displacement"])
    table.columns["state"] = np.array(["läuft", "stop"] * (N // 2), dtype=object)
    words = MemoryTable(table.columns, {"time": "s", "Load cell": "kN", "displacement": "mm"})
    back = read(taken(tmp_path, put("r1.log", words), specs=[FORCE, DISPLACEMENT, Spec("state", "")]))
    assert list(back.values("state")[:3]) == ["läuft", "stop", "läuft"]
    assert np.flatnonzero(np.isnan(back.values("displacement"))).tolist() == [7]


def test_memory_is_bounded_by_the_block_and_not_by_the_log(tmp_path: Path, put: Callable[..., Path]) -> None:
    class Endless(MemoryTable):
        """20 blocks made on demand, each as large as the first."""

        def blocks(self, names: Sequence[str] | None = None):
            for number in range(20):
                block = next(super().blocks(names))
                yield {key: values + number * 20.0 if key == "time" else values for key, values in block.items()}

    n = 100_000
    time = np.arange(n) / 5000.0
    table = Endless({"time": time, "force": np.sin(time), "x": np.cos(time)}, {"time": "s", "force": "N", "x": "m"})
    path = put("r1.log", table)
    tracemalloc.start()
    (written,) = taken(tmp_path, path, specs=[FORCE, Spec("x", "m")], maps={})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert pq.read_metadata(written).num_rows == 20 * n
    whole = 20 * n * 3 * 8
    assert peak < whole / 3
    assert written.stat().st_size > whole / 20
