"""100 000 messages of an inertial sensor in ROS bags: log to recording, against rosbags' reader into a DataFrame."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.csv_ingest import seconds_of

MESSAGES = 100_000
STEP = 2_000_000  # ns
START = 1_700_000_000_000_000_000
KIND = "sensor_msgs/msg/Imu"
FIELDS = ("angular_velocity", "linear_acceleration")


def messages(ros: int) -> tuple[Any, list[tuple[int, bytes]]]:
    """Return the types, and times (ns) with bytes of messages, each made anew from one and its own numbers."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    imu, header, time, vector, turn = (
        store.types[f"{kind}"]
        for kind in (KIND, "std_msgs/msg/Header", "builtin_interfaces/msg/Time", "geometry_msgs/msg/Vector3",
                     "geometry_msgs/msg/Quaternion")
    )  # fmt: skip
    pack = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    rng = np.random.default_rng(0)
    numbers = rng.standard_normal((MESSAGES, 6))
    count = {"seq": 0} if ros == 1 else {}
    listed = []
    for i, row in enumerate(numbers.tolist()):
        at = START + i * STEP
        head = header(stamp=time(at // 10**9, at % 10**9), frame_id="imu", **count)
        message = imu(
            head, turn(0.0, 0.0, 0.0, 1.0), np.zeros(9), vector(*row[:3]), np.zeros(9), vector(*row[3:]), np.zeros(9)
        )
        listed.append((at, bytes(pack(message, KIND))))
    return store, listed


def write_bag(folder: Path) -> Path:
    from rosbags.rosbag1 import Writer

    store, listed = messages(1)
    with Writer(folder / "r.bag") as writer:
        topic = writer.add_connection("/imu", KIND, typestore=store)
        for time, content in listed:
            writer.write(topic, time, content)
    return folder / "r.bag"


def write_db3(folder: Path) -> Path:
    from rosbags.rosbag2 import Writer

    store, listed = messages(2)
    with Writer(folder / "r", version=9) as writer:
        topic = writer.add_connection("/imu", KIND, typestore=store)
        for time, content in listed:
            writer.write(topic, time, content)
    return folder / "r" / "r.db3"


def ours(log: Path, folder: Path) -> Path:
    """The whole way: units, quality checks, Parquet written."""
    from pipeline.ingest.ingest import ingest_run
    from pipeline.ingest.mapping import ChannelMap
    from pipeline.rigs.experiment import ChannelSpec

    units = {"angular_velocity": "rad/s", "linear_acceleration": "m/s^2"}
    names = {f"{field}_{axis}": (f"{field}.{axis}", units[field]) for field in FIELDS for axis in "xyz"}
    specs = [ChannelSpec(name, unit, name) for name, (_, unit) in names.items()]
    maps = {name: ChannelMap(path, unit=unit) for name, (path, unit) in names.items()}
    (written,) = ingest_run("r1", [("", log)], specs, maps, {}, {}, folder)
    return written


def arrays_only(log: Path) -> int:
    """The reader alone: all fields of all messages as logged, block by block."""
    from pipeline.ingest.registry import open_log

    (table,) = open_log(log).tables
    return sum(block["linear_acceleration.x"].size for block in table.blocks())


def theirs(log: Path) -> Any:
    """What a user writes: each message decoded, six of its numbers into a row."""
    import pandas as pd
    from rosbags.highlevel import AnyReader

    rows = []
    with AnyReader([log if log.suffix == ".bag" else log.parent]) as reader:
        for topic, time, content in reader.messages():
            message = reader.deserialize(content, topic.msgtype)
            w, a = message.angular_velocity, message.linear_acceleration
            rows.append((time, w.x, w.y, w.z, a.x, a.y, a.z))
    return pd.DataFrame(rows, columns=["time", *(f"{field}_{axis}" for field in FIELDS for axis in "xyz")])


def assert_same(written: Path, frame: Any) -> None:
    from pipeline.recording import storage

    recording = storage.read(written)
    for name in frame.columns[1:]:
        np.testing.assert_array_equal(recording.values(name), frame[name].to_numpy())


def measure() -> list[dict[str, Any]]:
    from importlib.metadata import version

    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kind, log in (("ROS 1 bag", write_bag(folder)), ("ROS 2 bag (SQLite)", write_db3(folder))):
            assert_same(ours(log, folder / "out"), theirs(log))
            whole, alone, reference = seconds_of(
                partial(ours, log, folder / "out"),
                partial(arrays_only, log),
                partial(theirs, log),
                repeat=3,
            )
            for what, took in (
                (f"{MESSAGES} messages, {kind} -> SI, checked, Parquet", whole),
                ("the same, reader alone, all fields", alone),
            ):
                rows.append(
                    {
                        "what": what,
                        "against": f"rosbags {version('rosbags')} AnyReader, DataFrame",
                        "ours": took,
                        "theirs": reference,
                        "goal": "",
                    }
                )
    return rows
