"""Good inputs to begin with: a small one of every kind that is read, so that a mutation often hits what matters."""

from __future__ import annotations

import json
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

N = 40
TIME = np.arange(N) / 200.0
X, F = np.sin(9 * TIME), 50 * np.cos(9 * TIME)
_EPOCH, _STEP = 1_700_000_000_000_000_000, 5_000_000


def _made(write: Callable[[Path], object], name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


def csv() -> list[bytes]:
    rows = list(zip(TIME.tolist(), X.tolist(), F.tolist(), strict=True))

    def lines(form: str, *header: str) -> bytes:
        return "\n".join([*header, *(form.format(*row) for row in rows), ""]).encode()

    german = lines("{:.3f};{:.6f};{:.4f}", "time;x;F", "s;mm;N").replace(b".", b",")
    dated = lines("2024-05-01 10:00:0{:.3f},{:.6f},{:.4f}", "timestamp,x [mm],F [N]")
    return [
        lines("{:.3f},{:.6f},{:.4f}", "# coil_current: 2 A", "time [s],x [mm],F [N]"),
        german,
        dated,
        lines("{:.3f}\t{:.6f}\t{:.4f}", "Operator\tSmith", "", "time\tx\tF", "(s)\t(mm)\t(N)"),
        lines('"{:.3f}","{:.6f}","{:.4f}"', '"time","x","F"'),
        german.decode().encode("utf-16"),
    ]


def _mcap(encoding: str, kind: str, name: str, schema: bytes, payloads: list[bytes], packed: str) -> bytes:
    from mcap.writer import CompressionType, Writer

    def write(path: Path) -> None:
        with path.open("wb") as file:
            writer = Writer(file, compression=CompressionType[packed], chunk_size=900)
            writer.start()
            writer.add_metadata("run", {"coil_current": "2 A"})
            channel = writer.register_channel(
                "/rig", encoding, writer.register_schema(name, kind, schema), {"unit.x": "mm"}
            )
            for i, payload in enumerate(payloads):
                writer.add_message(channel, _EPOCH + i * _STEP, payload, _EPOCH + i * _STEP)
            writer.finish()

    return _made(write, "log.mcap")


def mcap() -> list[bytes]:
    plain = {"type": "object", "properties": {"x": {"type": "number", "unit": "mm"}, "F": {"type": "number"}}}
    objects = [{"x": x, "F": f, "state": "run", "w": {"p": [x, f, 1.0]}} for x, f in zip(X, F, strict=True)]
    blocks = [{"F": F.tolist(), "rate": 1000.0} for _ in range(5)]
    definition = (
        b"Inner inner\nfloat64[] block\nfloat64[3] p\nstring state\n===\nMSG: rig/Inner\nfloat64 x\nfloat32 F\n"
    )

    def cdr(x: float, f: float) -> bytes:
        inner = struct.pack("<dfI", x, f, 2) + struct.pack("<dd", x, f)
        return b"\0\1\0\0" + inner + struct.pack("<3d", 1.0, x, f) + struct.pack("<I", 4) + b"run\0"

    messages = [cdr(x, f) for x, f in zip(X.tolist(), F.tolist(), strict=True)]
    described, payloads = _protobuf()
    return [
        *(
            _mcap(
                "json",
                "jsonschema",
                "rig",
                json.dumps(plain).encode(),
                [json.dumps(o).encode() for o in objects],
                packed,
            )
            for packed in ("NONE", "ZSTD", "LZ4")
        ),
        _mcap("json", "", "", b"", [json.dumps(o).encode() for o in blocks], "NONE"),
        _mcap("cdr", "ros2msg", "rig/msg/Sample", definition, messages, "NONE"),
        _mcap("protobuf", "protobuf", "rig.Sample", described, payloads, "NONE"),
    ]


def _protobuf() -> tuple[bytes, list[bytes]]:
    """Return a description of messages that hold each other, and some messages."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    file = descriptor_pb2.FileDescriptorProto(name="rig.proto", package="rig", syntax="proto3")
    message = file.message_type.add(name="Sample")
    of = descriptor_pb2.FieldDescriptorProto
    for number, (name, kind, label) in enumerate(
        [("x", of.TYPE_DOUBLE, of.LABEL_OPTIONAL), ("F", of.TYPE_FLOAT, of.LABEL_OPTIONAL),
         ("block", of.TYPE_DOUBLE, of.LABEL_REPEATED), ("state", of.TYPE_STRING, of.LABEL_OPTIONAL)], 1,
    ):  # fmt: skip
        message.field.add(name=name, number=number, type=kind, label=label)
    message.field.add(name="within", number=5, type=of.TYPE_MESSAGE, type_name=".rig.Sample", label=of.LABEL_OPTIONAL)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    sample: Any = message_factory.GetMessageClass(pool.FindMessageTypeByName("rig.Sample"))
    payloads = [
        sample(x=x, F=f, block=[x, f], state="run", within=sample(x=f)).SerializeToString()
        for x, f in zip(X.tolist(), F.tolist(), strict=True)
    ]
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString(), payloads


def mat() -> list[bytes]:
    import h5py
    import scipy.io

    words = {"t": TIME, "x": X, "rec": {"F": F, "note": "run"}, "coil_current": 2.0, "z": X + 1j * F, "b": X > 0}

    def save_73(path: Path) -> None:
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, values in (("t", TIME), ("x", X), ("F", F)):
                data = file.create_dataset(name, data=values[None, :], chunks=(1, 20), compression="gzip")
                data.attrs["MATLAB_class"] = np.bytes_("double")
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")

    return [
        _made(lambda path: scipy.io.savemat(path, {"t": TIME, "x": X, "F": F, "who": "me"}, format="4"), "log.mat"),
        _made(lambda path: scipy.io.savemat(path, words, oned_as="column"), "log.mat"),
        _made(lambda path: scipy.io.savemat(path, words, do_compression=True), "log.mat"),
        _made(save_73, "log.mat"),
    ]


def bag() -> list[bytes]:
    from rosbags.rosbag1 import Writer

    def write(path: Path, packed: str) -> None:
        writer = Writer(path)
        writer.chunk_threshold = 900
        if packed:
            writer.set_compression(Writer.CompressionFormat[packed])
        with writer:
            _write_ros(writer, 1)

    return [_made(lambda path, packed=packed: write(path, packed), "log.bag") for packed in ("", "BZ2", "LZ4")]


def db3() -> list[bytes]:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, Writer

    def written(packed: bool) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            writer = Writer(Path(folder) / "bag", version=9)
            if packed:
                writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
            with writer:
                _write_ros(writer, 2)
            return next((Path(folder) / "bag").glob("*.db3")).read_bytes()

    return [written(packed=False), written(packed=True)]


def _write_ros(writer: Any, ros: int) -> None:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64 x\nfloat64 F\nstring state\nfloat64[] block\n", "rig_msgs/msg/Sample"))
    sample = store.types["rig_msgs/msg/Sample"]
    to_bytes = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    topic = writer.add_connection("/rig", "rig_msgs/msg/Sample", typestore=store)
    for i, (x, f) in enumerate(zip(X.tolist(), F.tolist(), strict=True)):
        message = sample(x=x, F=f, state="run", block=np.array([x, f]))
        writer.write(topic, _EPOCH + i * _STEP, bytes(to_bytes(message, "rig_msgs/msg/Sample")))


def hdf5() -> list[bytes]:
    import h5py

    def write(path: Path) -> None:
        with h5py.File(path, "w") as file:
            file["coil_current"] = 2.0
            for name, values, unit in (("time", TIME, "s"), ("x", X, "mm"), ("F", F, "N")):
                data = file.create_dataset(f"daq/{name}", data=values, chunks=(20,), compression="gzip")
                data.attrs["units"] = unit
            file.create_dataset("daq/state", data=["run"] * N, dtype=h5py.string_dtype())

    return [_made(write, "log.h5")]


def columnar() -> list[bytes]:
    import pyarrow as pa
    import pyarrow.feather as feather
    import pyarrow.parquet as pq

    table = pa.table({"time": TIME, "x [mm]": X, "F [N]": F, "state": ["run"] * N})
    return [
        _made(lambda path: pq.write_table(table, path, compression="zstd", row_group_size=20), "log.parquet"),
        _made(lambda path: pq.write_table(table, path, compression="snappy", use_dictionary=False), "log.parquet"),
        _made(lambda path: feather.write_feather(table, path, compression="lz4"), "log.feather"),
    ]


def recipe() -> list[bytes]:
    return [
        b"experiment: mre.shear\ntitle: A pad\nchannels:\n  displacement: {channel: x, unit: mm, sign: -1}\n"
        b"  force: {channel: F, unit: kN, scale: 1.5, offset: 0.1, gain_u: 0.5 %, offset_u: 2 N}\n"
        b"  time: {rate: 5 kHz}\nconditions:\n  coil_current: 2 A\nexclude: [r1, r2]\nsettings: {}\n",
        b"experiment: mre.step\nuses: [bench]\nfile_name: '{preload}N_{n}'\nsynthetic: {seed: 1, formats: [csv, mcap]}\n",
        b"experiment: mre.shear\nchannels: {force: &a {channel: F}, displacement: *a}\nconditions:\n  coil_current: 2\n",
    ]


def runs() -> list[bytes]:
    return [
        b"run,coil_current [A],frequency,amplitude [mm]\nr1,2,5 Hz,0.4\nr2.csv,3 A,5,0.4\n",
        b"# by hand\nrun;coil_current;note\nr1;2,5 A;=cmd\n",
    ]


def params() -> list[bytes]:
    return [
        b"campaigns:\n  - a\n  - b\nsynthetic: [a]\ndatasets:\n  b: s3://lab/b\nuses:\n  - {campaign: b, of: a}\n",
        b"campaigns: [a]\nsynthetic: []\ndatasets: {a: 'https://x/y', b: /data}\nuses: []\n",
    ]
