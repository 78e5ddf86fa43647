"""ROS bags: other ways to pack them, definitions that they lack, recorders that were killed, damage; files that are none."""

from __future__ import annotations

import random
import sqlite3
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import format_logs as logs
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.ingest import registry
from pipeline.ingest.reader import RawLog
from pipeline.ingest.rosbag2 import definitions
from pipeline.ingest.scan import scan_log


def column(log: RawLog, topic: str, name: str) -> np.ndarray:
    (table,) = (table for table in log.tables if table.name == topic)
    return np.concatenate([block[name] for block in table.blocks([name])])


def said(log: RawLog) -> str:
    return " ".join(note.message for note in log.notes)


@pytest.mark.parametrize("compression", ["", "bz2", "lz4"])
def test_a_bag_of_ros_1_is_read_however_packed(tmp_path: Path, compression: str) -> None:
    log = registry.open_log(logs.write_bag(tmp_path / "r.bag", compression))
    np.testing.assert_array_equal(column(log, "daq", "force"), logs.FORCE)
    np.testing.assert_allclose(column(log, "daq", "log_time"), logs.TIME, atol=1e-9)
    begin = logs.BEGIN.astype(np.int64) * 1e-9
    np.testing.assert_allclose(column(log, "daq", "header.stamp"), begin + logs.TIME, atol=1e-6)
    assert list(column(log, "daq", "state")) == list(logs.STATE)
    assert log.details["chunks"].endswith(f"({compression or 'none'})")
    assert "3000 messages" in log.details["topic daq"]


@pytest.mark.parametrize("write", [logs.write_bag, logs.write_db3, logs.write_old_db3])
def test_types_of_ros_have_the_units_that_their_definitions_state(
    tmp_path: Path, write: Callable[[Path], Path]
) -> None:
    log = registry.open_log(write(tmp_path / "r"))
    (oil,) = (table for table in log.tables if table.name == "oil")
    assert {channel.name: channel.unit for channel in oil.channels} == {
        "log_time": "s",
        **({"header.seq": None} if write is logs.write_bag else {}),
        "header.stamp": "s",
        "header.frame_id": None,
        "temperature": "degC",
        "variance": None,
    }


def test_messages_packed_one_by_one_are_unpacked(tmp_path: Path) -> None:
    log = registry.open_log(logs.write_db3(tmp_path / "r.db3", compressed=True))
    np.testing.assert_array_equal(column(log, "daq", "force"), logs.FORCE)


@pytest.mark.parametrize("kept", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("compression", ["", "bz2", "lz4"])
def test_a_bag_that_was_cut_off_is_read_up_to_there(tmp_path: Path, compression: str, kept: float) -> None:
    content = logs.write_bag(tmp_path / "r.bag", compression).read_bytes()
    cut = tmp_path / "cut.bag"
    cut.write_bytes(content[: int(kept * len(content))])
    log = registry.open_log(cut)
    force = column(log, "daq", "force")
    np.testing.assert_array_equal(force, logs.FORCE[: force.size])
    assert (kept - 0.1) * logs.N <= force.size < logs.N
    assert "cut off or damaged at byte" in said(log)


def test_a_bag_whose_recorder_was_killed_needs_no_index(tmp_path: Path) -> None:
    """`.bag.active`: the bag's head names no index, the last chunk says that it is empty."""
    content = bytearray(logs.write_bag(tmp_path / "r.bag").read_bytes())
    at = content.index(b"index_pos=") + len(b"index_pos=")
    end = int.from_bytes(content[at : at + 8], "little")
    content[at : at + 8] = bytes(8)
    chunk = content.rindex(b"compression=", 0, end)
    size = content.index(b"size=", chunk) + len(b"size=")
    content[size : size + 8] = bytes(8)  # the size unpacked, and after it the length of the data
    (tmp_path / "r.bag.active").write_bytes(content[:end])
    log = registry.open_log(tmp_path / "r.bag.active")
    np.testing.assert_array_equal(column(log, "daq", "force"), logs.FORCE)
    assert "ends without its closing records" in said(log)


def test_reading_goes_on_behind_damage_where_the_index_tells_where(tmp_path: Path) -> None:
    content = bytearray(logs.write_bag(tmp_path / "r.bag").read_bytes())
    chunk = content.index(b"compression=", len(content) // 2) - 4 - 4
    content[chunk : chunk + 4] = b"\xff\xff\xff\xff"
    (tmp_path / "bad.bag").write_bytes(content)
    log = registry.open_log(tmp_path / "bad.bag")
    force = column(log, "daq", "force")
    assert 0.9 * logs.N < force.size < logs.N
    assert set(force) <= set(logs.FORCE)
    assert "cannot be read" in said(log)
    assert "Reading went on behind" in said(log)


def test_old_bags_of_ros_2_take_definitions_from_files_beside_them(tmp_path: Path) -> None:
    path = logs.write_old_db3(tmp_path / "old.db3")
    log = registry.open_log(path)
    assert [table.name for table in log.tables] == ["oil"]
    np.testing.assert_array_equal(column(log, "oil", "temperature"), 20.0 + np.arange(6.0))
    assert "ROS 2 Humble" in log.details["message definitions"]
    assert "'daq' was left out" in said(log)
    assert "'rig_msgs/msg/Sample'" in said(log)
    assert "rig_msgs/msg/Sample.msg" in said(log)
    (tmp_path / "rig_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "rig_msgs" / "msg" / "Sample.msg").write_text(logs.SAMPLE)
    np.testing.assert_array_equal(column(registry.open_log(path), "daq", "force"), logs.FORCE)


def test_parts_of_a_type_are_looked_for_too(tmp_path: Path) -> None:
    (tmp_path / "Outer.msg").write_text(
        "# a comment\nuint8 KIND=3\nInner[<=4] cells 1\nHeader header\nstring<=5 name\n"
    )
    found = definitions.Definitions(tmp_path / "r.db3", {})
    assert "'rig_msgs/msg/Inner', part of 'rig_msgs/msg/Outer'," in found.of("rig_msgs/msg/Outer")
    (tmp_path / "Inner.msg").write_text("geometry_msgs/Vector3 force\n")
    language, text = found.of("rig_msgs/msg/Outer")
    assert language == "ros2msg"
    assert {"MSG: rig_msgs/msg/Inner", "MSG: geometry_msgs/msg/Vector3", "MSG: std_msgs/msg/Header"} <= set(
        text.decode().splitlines()
    )


def test_a_missing_library_is_asked_for_where_definitions_are_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new, old = logs.write_db3(tmp_path / "new.db3"), logs.write_old_db3(tmp_path / "old.db3")
    bag = logs.write_bag(tmp_path / "r.bag")
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    assert len(registry.open_log(new).tables) == len(registry.open_log(bag).tables) == 2
    with pytest.raises(InputError, match=r"old\.db3.*optional extra 'ros'.*pip install 'rigfit\[ros\]'"):
        registry.open_log(old)


@pytest.mark.parametrize("kept", [0.3, 0.6, 0.95])
def test_an_sqlite_bag_that_was_cut_off_is_read_up_to_there(tmp_path: Path, kept: float) -> None:
    content = logs.write_db3(tmp_path / "r.db3").read_bytes()
    cut = tmp_path / "cut.db3"
    cut.write_bytes(content[: int(kept * len(content))])
    log = registry.open_log(cut)
    force = column(log, "daq", "force")
    assert force.size > 0
    assert set(force) <= set(logs.FORCE)
    assert "cannot be read; the others are" in said(log)


def test_damaged_pages_cost_what_stands_on_them(tmp_path: Path) -> None:
    content = logs.write_db3(tmp_path / "r.db3").read_bytes()
    rng = random.Random(3)
    sizes = []
    for _ in range(10):
        bytes_ = bytearray(content)
        at = rng.randrange(4096, len(bytes_) - 4096)
        bytes_[at : at + 300] = rng.randbytes(300)
        (tmp_path / "bad.db3").write_bytes(bytes_)
        with suppress(InputError):  # of pages that hold the definitions
            sizes += [table.summary.n for table in scan_log(tmp_path / "bad.db3").tables if table.table == "daq"]
    assert sorted(sizes)[len(sizes) // 2] > 0.6 * logs.N


def test_rows_that_a_killed_recorder_left_beside_the_bag_are_read(tmp_path: Path) -> None:
    source = logs.write_db3(tmp_path / "whole.db3")
    base = sqlite3.connect(source)
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA wal_autocheckpoint = 0")
    base.execute("DELETE FROM messages WHERE id > 1000")
    base.commit()
    for name in ("whole.db3", "whole.db3-wal"):
        (tmp_path / "killed").mkdir(exist_ok=True)
        (tmp_path / "killed" / name).write_bytes((tmp_path / name).read_bytes())
    base.close()
    log = registry.open_log(tmp_path / "killed" / "whole.db3")
    assert sum(column(log, name, "log_time").size for name in ("daq", "oil")) == 1000
    assert "whole.db3-wal beside it and are read with it" in said(log)


def test_nothing_is_written_beside_a_bag(tmp_path: Path) -> None:
    path = logs.write_db3(tmp_path / "r.db3")
    before = sorted(tmp_path.iterdir())
    scan_log(path)
    assert sorted(tmp_path.iterdir()) == before


def test_files_of_a_split_recording_are_told(tmp_path: Path) -> None:
    for k in range(2):
        logs.write_db3(tmp_path / f"r_{k}.db3")
    assert "is one of 2 files beside each other" in said(registry.open_log(tmp_path / "r_1.db3"))


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("a.bag", b"#ROSBAG V1.2\n" + bytes(100), r"version 1\.2; only version 2\.0.*rosbag filter"),
        ("a.bag", b"\0\1\2\3" * 30, "is no ROS 1 bag"),
        ("a.bag", b"#ROSBAG V2.0\n", "holds no messages"),
        ("a.bag", b"#ROSBAG V2.0\n" + bytes(range(60)), "nothing could be read of this ROS 1 bag file"),
        ("a.db3", b"\0\1\2\3" * 30, "is no SQLite file"),
        ("a.db3", b"SQLite format 3\0" + bytes(500), "broken or was cut off"),
        ("a.db3", b"SQLite format 3\0", "broken or was cut off"),
    ],
)
def test_files_that_are_no_bags_are_refused_in_words(tmp_path: Path, name: str, content: bytes, match: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=match) as caught:
        scan_log(tmp_path / name)
    assert name in str(caught.value)


def test_another_programs_sqlite_file_is_named_as_such(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "notes.db3") as base:
        base.execute("CREATE TABLE measurements (t REAL, force REAL)")
    base.close()
    with pytest.raises(InputError, match=r"of another program.*has the tables measurements.*as CSV"):
        registry.open_log(tmp_path / "notes.db3")


def test_an_empty_bag_is_told(tmp_path: Path) -> None:
    path = logs.write_db3(tmp_path / "r.db3")
    with sqlite3.connect(path) as base:
        base.execute("DELETE FROM messages")
    base.close()
    with pytest.raises(InputError, match="holds no messages"):
        registry.open_log(path)


def test_an_encrypted_bag_is_told(tmp_path: Path) -> None:
    content = logs.write_bag(tmp_path / "r.bag").read_bytes()
    at = content.index(b"\x0d\x00\x00\x00chunk_count=") if b"\x0d\x00\x00\x00chunk_count=" in content else 17
    head = int.from_bytes(content[13:17], "little")
    field = b"encryptor=rosbag/AesCbcEncryptor"
    added = len(field).to_bytes(4, "little") + field
    spoilt = (
        content[:13]
        + (head + len(added)).to_bytes(4, "little")
        + content[17 : 17 + head]
        + added
        + content[17 + head :]
    )
    assert at > 0
    (tmp_path / "e.bag").write_bytes(spoilt)
    with pytest.raises(InputError, match=r"is encrypted \(rosbag/AesCbcEncryptor\).*rosbag decrypt"):
        registry.open_log(tmp_path / "e.bag")
