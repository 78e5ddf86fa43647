"""Logs of one and the same record in the formats of optional libraries, and as CSV, to compare what is read."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

N, RATE = 3000, 500.0
TIME = np.arange(N) / RATE
FORCE = 0.2 * np.sin(2 * np.pi * 5 * TIME)  # kN
DISPLACEMENT = 1.5 * np.cos(2 * np.pi * 5 * TIME)  # mm
STATE = np.where(TIME < 2.0, "REST", "RUN").astype(object)
BEGIN = np.datetime64("2024-05-06T10:00:00", "ns")


def write_csv(path: Path) -> Path:
    frame = pd.DataFrame({"time [s]": TIME, "force [kN]": FORCE, "displacement [mm]": DISPLACEMENT, "state": STATE})
    frame.to_csv(path, index=False, float_format="%.17g")
    return path


def write_tdms(path: Path) -> Path:
    """LabVIEW's way: waveforms in two segments, a slow group on a clock of its own, properties of the file."""
    nptdms = __import__("nptdms")
    waveform = {"wf_increment": 1 / RATE, "wf_start_offset": 0.0, "wf_start_time": BEGIN}
    half = N // 2
    with nptdms.TdmsWriter(path) as writer:
        for part in (slice(0, half), slice(half, N)):
            writer.write_segment(
                [
                    nptdms.RootObject({"coil_current": "3 A", "operator": "M. Example"}),
                    nptdms.ChannelObject("daq", "force", FORCE[part], {**waveform, "unit_string": "kN"}),
                    nptdms.ChannelObject("daq", "displacement", DISPLACEMENT[part], {**waveform, "unit_string": "mm"}),
                    nptdms.ChannelObject("daq", "state", STATE[part], waveform),
                ]
            )
        slow = {"wf_increment": 1.0, "wf_start_time": BEGIN + np.timedelta64(500, "ms"), "unit_string": "degC"}
        writer.write_segment([nptdms.ChannelObject("oil", "temperature", 20.0 + np.arange(6.0), slow)])
    return path


def write_mdf(path: Path, version: str = "4.10") -> Path:
    """A vehicle logger's way: groups of their own rates, raw integers with a conversion, states as text."""
    from datetime import UTC, datetime

    from asammdf import MDF, Signal

    codes = np.round(FORCE / 1e-5).astype(np.int32)
    begin = datetime(2024, 5, 6, 10, tzinfo=UTC)
    with MDF(version=version) as mdf:
        mdf.header.start_time = begin
        mdf.append(
            [
                Signal(codes, TIME, name="force", unit="kN", conversion={"a": 1e-5, "b": 0.0}),
                Signal(DISPLACEMENT, TIME, name="displacement", unit="mm"),
                Signal(STATE.astype("S4"), TIME, name="state", encoding="utf-8"),
            ],
            acq_name="daq",
        )
        mdf.append(
            [Signal(20.0 + np.arange(6.0), 0.5 + np.arange(6.0), name="temperature", unit="degC")], acq_name="oil"
        )
        mdf.save(path, overwrite=True)
    return path.with_suffix(".mf4") if path.with_suffix(".mf4").exists() else path


def write_hdf5(path: Path) -> Path:
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["operator"] = "M. Example"
        file["coil_current"] = 3.0
        file["coil_current"].attrs["unit"] = "A"
        daq = file.create_group("daq")
        for name, values, unit in (("time", TIME, "s"), ("force", FORCE, "kN"), ("displacement", DISPLACEMENT, "mm")):
            daq.create_dataset(name, data=values, chunks=(700,), compression="gzip").attrs["units"] = unit
        daq.create_dataset("state", data=STATE, dtype=h5py.string_dtype())
        oil = file.create_group("oil")
        oil["time"], oil["temperature"] = 0.5 + np.arange(6.0), 20.0 + np.arange(6.0)
        oil["time"].attrs["units"], oil["temperature"].attrs["units"] = "s", "degC"
    return path


def frame() -> pd.DataFrame:
    dates = pd.DatetimeIndex(BEGIN + (TIME * 1e9).round().astype("timedelta64[ns]"))
    return pd.DataFrame({"time": dates, "force [kN]": FORCE, "displacement": DISPLACEMENT, "state": STATE})


def write_parquet(path: Path) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(frame())
    at = table.schema.get_field_index("displacement")
    schema = table.schema.set(at, table.schema.field(at).with_metadata({"unit": "mm"}))
    schema = schema.with_metadata({**schema.metadata, b"coil_current": b"3 A"})
    pq.write_table(table.cast(schema), path, row_group_size=700)
    return path


def write_feather(path: Path) -> Path:
    frame().rename(columns={"displacement": "displacement [mm]"}).to_feather(path, compression="zstd")
    return path


def write_matlab_73(path: Path, order: str = "C") -> Path:
    """MATLAB's way: a block of 512 bytes before the HDF5 file, arrays transposed, words as 16-bit letters."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:

        def put(group: h5py.Group, name: str, values: np.ndarray, kind: str) -> None:
            group.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_(kind)

        record = file.create_group("rec")
        record.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in (("time", TIME), ("force", FORCE), ("displacement", DISPLACEMENT)):
            put(record, name, values[None, :], "double")
        put(file, "sheet", np.vstack([FORCE, DISPLACEMENT]), "double")  # N x 2 in MATLAB
        put(file, "coil_current", np.array([[3.0]]), "double")
        put(file, "operator", np.frombuffer("M. Éxample".encode("utf-16-le"), np.uint16)[:, None], "char")
        refs = file.create_group("#refs#")
        for at, value in enumerate((1.5, 2.5)):
            put(refs, f"r{at}", np.array([[value]]), "double")
        steps = file.create_group("steps")
        steps.attrs["MATLAB_class"] = np.bytes_("struct")
        steps.create_dataset("level", data=np.array([[refs["r0"].ref], [refs["r1"].ref]], dtype=h5py.ref_dtype))
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon May  6 10:00:00 2024 HDF5 schema 1.00 ."
    with path.open("r+b") as file:
        file.write(head.ljust(116) + bytes(8) + b"\x00\x02IM")
    return path


SAMPLE = "std_msgs/Header header\nfloat64 force\nfloat64 displacement\nstring state\n"


def _ros_messages(ros: int) -> Iterator[tuple[str, str, int, bytes]]:
    """Topic, type, time (ns) and bytes of messages: a laboratory's own type, and one of ROS's for the slow sensor."""
    store = ros_types(ros)
    sample, header, oil, clock = (
        store.types[f"{kind}"]
        for kind in (
            "rig_msgs/msg/Sample",
            "std_msgs/msg/Header",
            "sensor_msgs/msg/Temperature",
            "builtin_interfaces/msg/Time",
        )
    )
    to_bytes = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    begin = int(BEGIN.astype(np.int64))
    count = {"seq": 0} if ros == 1 else {}
    events = [(round(t * 1e9), k, None) for k, t in enumerate(TIME.tolist())]
    events += [(round((0.5 + k) * 1e9) + 1, None, k) for k in range(6)]
    for passed, k, slow in sorted(events, key=lambda event: event[0]):
        head = header(
            stamp=clock(sec=(begin + passed) // 10**9, nanosec=(begin + passed) % 10**9), frame_id="rig", **count
        )
        if k is not None:
            message = sample(
                header=head, force=float(FORCE[k]), displacement=float(DISPLACEMENT[k]), state=str(STATE[k])
            )
            yield "/daq", "rig_msgs/msg/Sample", begin + passed, bytes(to_bytes(message, "rig_msgs/msg/Sample"))
        else:
            message = oil(header=head, temperature=20.0 + slow, variance=0.0)
            kind = "sensor_msgs/msg/Temperature"
            yield "/oil", kind, begin + passed - 1, bytes(to_bytes(message, kind))


def ros_types(ros: int) -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(SAMPLE, "rig_msgs/msg/Sample"))
    return store


def write_bag(path: Path, compression: str = "") -> Path:
    """ROS 1's way: chunks with an index at the end; small ones, so that there are several."""
    from rosbags.rosbag1 import Writer

    writer = Writer(path)
    writer.chunk_threshold = 20_000
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    with writer:
        _write_ros(writer, 1)
    return path


def write_db3(path: Path, compressed: bool = False) -> Path:
    """ROS 2's way: a folder with an SQLite file, here taken out of it."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, Writer

    folder = path.parent / f"{path.stem}-bag"
    writer = Writer(folder, version=9)
    if compressed:
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        _write_ros(writer, 2)
    shutil.copy(folder / f"{folder.name}.db3", path)
    return path


def _write_ros(writer: Any, ros: int) -> None:
    connections: dict[str, Any] = {}
    for topic, kind, time, content in _ros_messages(ros):
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=ros_types(ros))
        writer.write(connections[topic], time, content)


def write_old_db3(path: Path) -> Path:
    """As recorders before ROS 2 Iron wrote: without definitions of messages."""
    write_db3(path)
    with sqlite3.connect(path) as base:
        for table in ("schema", "metadata", "message_definitions"):
            base.execute(f"DROP TABLE {table}")
        base.execute("ALTER TABLE topics DROP COLUMN type_description_hash")
    base.close()
    return path
