"""Recordings on disk are whole or absent, say what they are, and can be read in part."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from pipeline.errors import InputError
from pipeline.recording import Channel, Provenance, QualityFinding, Recording, SourceFile, Stream, storage


def recording() -> Recording:
    time = np.arange(1000) / 100.0
    force = np.sin(time)
    force[3] = np.nan
    fast = Stream(
        "fast",
        time,
        {
            "force": Channel("force", force, "N"),
            "ratio": Channel("ratio", time * 2, "1"),
            "state": Channel("state", np.array(["run", "häl—t"] * 500, dtype=object), ""),
        },
    )
    slow = Stream("slow", time[::100], {"temperature": Channel("temperature", 290 + time[::100], "K")})
    return Recording(
        "r1",
        {"fast": fast, "slow": slow},
        {"coil_current": 6.0, "pad": "A-7", "held": True},
        (QualityFinding("note", "a gap", "r1", "force", (1.0, 2.0)), QualityFinding("warning", "all", "r1")),
        Provenance(
            (SourceFile("logs/r1.csv", "ab" * 32, 12, "csv 1", {"force": "kN"}),), ("x",), {"pad": "runs.csv"}, "0"
        ),
    )


def alike(one: Recording, other: Recording) -> bool:
    assert one.run == other.run
    assert dict(one.conditions) == dict(other.conditions)
    assert one.quality == other.quality
    assert one.provenance == other.provenance
    assert list(one.streams) == list(other.streams)
    for name, stream in one.streams.items():
        np.testing.assert_array_equal(stream.time, other.streams[name].time)
        assert list(stream.channels) == list(other.streams[name].channels)
        for key, channel in stream.channels.items():
            twin = other.streams[name].channels[key]
            assert (channel.unit, channel.is_text) == (twin.unit, twin.is_text)
            np.testing.assert_array_equal(channel.values, twin.values)
    return True


def test_what_is_read_is_what_was_written(tmp_path: Path) -> None:
    paths = storage.write(recording(), tmp_path)
    assert [path.name for path in paths] == ["r1.fast.parquet", "r1.slow.parquet"]
    assert alike(recording(), storage.read(paths))
    assert alike(recording(), storage.read(paths, lazily=True))
    assert alike(recording(), storage.read_folder(tmp_path)[0])


def test_metadata_and_units_stand_in_the_arrow_schema_and_other_programs_read_plain_columns(tmp_path: Path) -> None:
    fast, slow = storage.write(recording(), tmp_path)
    for path in (fast, slow):
        schema = pq.read_schema(path)
        about = json.loads(schema.metadata[b"rigfit"])
        assert about["run"] == "r1"
        assert about["conditions"]["coil_current"] == 6.0
        assert about["quality"][0]["span"] == [1.0, 2.0]
    assert pq.read_schema(fast).field("force").metadata == {b"unit": b"N"}
    assert pq.read_schema(fast).field("time").metadata == {b"unit": b"s"}
    table = pd.read_parquet(fast)
    assert list(table.columns) == ["time", "force", "ratio", "state"]
    assert table["force"].dtype == float
    assert table["force"].isna().sum() == 1


def test_a_channel_that_nobody_asks_for_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = storage.write(recording(), tmp_path)
    asked: list[object] = []
    real = pq.read_table
    monkeypatch.setattr(
        pq, "read_table", lambda path, columns=None, **k: asked.append(columns) or real(path, columns=columns, **k)
    )
    lazy = storage.read(paths, lazily=True)
    assert "force" in lazy
    assert "speed" not in lazy
    np.testing.assert_array_equal(lazy.values("force"), recording().values("force"))
    lazy.values("force")
    assert asked == [["force"]]
    np.testing.assert_array_equal(lazy.streams["fast"].time, recording().streams["fast"].time)
    assert asked == [["force"], ["time"]]


def test_blocks_come_in_order_and_bounded(tmp_path: Path) -> None:
    n = storage.ROW_GROUP + 5000
    time = np.arange(n) / 1000.0
    stream = Stream("", time, {"force": Channel("force", time**2, "N"), "x": Channel("x", -time, "m")})
    (path,) = storage.write(Recording("long", {"": stream}), tmp_path)
    assert path.name == "long.parquet"
    blocks = list(storage.read_blocks(path, ["force"]))
    assert [block["time"].size for block in blocks] == [storage.ROW_GROUP, 5000]
    assert list(blocks[0]) == ["time", "force"]
    np.testing.assert_array_equal(np.concatenate([block["force"] for block in blocks]), time**2)
    assert list(next(storage.read_blocks(path))) == ["time", "force", "x"]


def test_a_stream_gives_the_same_pieces_from_memory_and_from_disk(tmp_path: Path) -> None:
    n = storage.ROW_GROUP + 7
    time = 2.0 + np.arange(n) / 1000.0
    held = Stream("", time, {"force": Channel("force", time**2, "N"), "x": Channel("x", -time, "m")})
    stored = storage.read(storage.write(Recording("long", {"": held}), tmp_path), lazily=True).streams[""]
    for stream in (held, stored):
        pieces = list(stream.blocks(["x"]))
        assert [stamps.size for stamps, _ in pieces] == [storage.ROW_GROUP, 7]
        np.testing.assert_array_equal(np.concatenate([stamps for stamps, _ in pieces]), time)
        np.testing.assert_array_equal(np.concatenate([x for _, (x,) in pieces]), -time)
        assert (stream.size, stream.span, stream.duration) == (n, (time[0], time[-1]), time[-1] - time[0])


def test_writing_block_by_block_gives_the_same_recording(tmp_path: Path) -> None:
    one = recording()
    stream = one.streams["fast"]
    with storage.whole_or_not(tmp_path / "r1.parquet") as partial:
        writer = storage.StreamWriter(partial, {c.name: c.unit for c in stream.channels.values()})
        for start in range(0, 1000, 300):
            part = slice(start, start + 300)
            writer.add(stream.time[part], {c.name: c.values[part] for c in stream.channels.values()})
        writer.close(storage.description(one, "fast"))
    back = storage.read(tmp_path / "r1.parquet")
    np.testing.assert_array_equal(back.values("force"), one.values("force"))
    assert list(back.values("state")) == list(one.values("state"))
    assert back.quality == one.quality


def test_the_same_recording_gives_the_same_bytes(tmp_path: Path) -> None:
    first = [path.read_bytes() for path in storage.write(recording(), tmp_path / "a")]
    second = [path.read_bytes() for path in storage.write(recording(), tmp_path / "b")]
    assert first == second


def test_findings_are_added_to_every_file_and_nothing_else_changes(tmp_path: Path) -> None:
    paths = storage.write(recording(), tmp_path)
    storage.add_quality(paths, [QualityFinding("error", "signs are swapped", "r1", "force")])
    back = storage.read(paths)
    assert back.quality[-1].message == "signs are swapped"
    assert len(back.quality) == 3
    np.testing.assert_array_equal(back.values("force"), recording().values("force"))
    for path in paths:
        assert "signs are swapped" in pq.read_schema(path).metadata[b"rigfit"].decode()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r1.fast.parquet", "r1.slow.parquet"]


def test_a_failure_leaves_the_file_that_was_there(tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    path.write_text("before")

    def fail() -> None:
        with storage.whole_or_not(path) as partial:
            partial.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("content", [b"", b"PAR1", b"not parquet at all" * 100])
def test_a_file_that_is_no_recording_is_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "odd.parquet"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"odd\.parquet is not a recording written by rigfit"):
        storage.read(path)
    with pytest.raises(InputError, match="is not a recording"):
        storage.read_folder(tmp_path)


def test_a_foreign_parquet_file_is_no_recording(tmp_path: Path) -> None:
    pd.DataFrame({"time": [0.0, 1.0]}).to_parquet(tmp_path / "other.parquet")
    with pytest.raises(InputError, match="is not a recording"):
        storage.read(tmp_path / "other.parquet")


def test_the_hash_is_that_of_the_bytes(tmp_path: Path) -> None:
    (tmp_path / "abc").write_bytes(b"abc")
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # FIPS 180-2, appendix B.1
    assert storage.sha256_of(tmp_path / "abc") == expected
