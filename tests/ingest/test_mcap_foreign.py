"""Logs with ROS 1, ROS 2 and Protobuf messages, written by the official writers."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.timestamp_pb2 import Timestamp
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_logs import EPOCH, messages_of, open_log, rows, table
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros1._vendor.genpy import dynamic, rostime
from mcap_ros1.writer import Writer as Ros1Writer
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as Ros2Writer

from pipeline.errors import InputError

STEP = 1_000_000
WRENCH = """std_msgs/Header header
Wrench wrench  # two vectors
float64[3] position
float64[] trace
uint8 LIMIT=3
string<=10 state "idle"
bool[2] switches
int64 count 5
uint8[] picture
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: rig_msgs/Wrench
geometry_msgs/Vector3 force
geometry_msgs/Vector3 torque
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float32 y
float64 z
"""


def wrench(i: int) -> dict:
    return {
        "header": {"stamp": {"sec": 100 + i, "nanosec": 500_000_000}, "frame_id": "cell" * (i % 3)},
        "wrench": {"force": {"x": i + 0.5, "y": -0.25 * i, "z": 1e-3}, "torque": {"x": 0.0, "y": 1.0, "z": float(i)}},
        "position": [i * 1.0, i * 2.0, i * 3.0],
        "trace": [100.0 * i + k for k in range(10)],
        "state": "on" if i % 2 else "offline",
        "switches": [True, bool(i % 2)],
        "count": -(2**40) + i,
        "picture": b"\x01\x02\x03",
    }


def write_ros2(path: Path, name: str, definition: str, messages: list[dict]) -> Path:
    with path.open("wb") as file, Ros2Writer(file) as writer:
        schema = writer.register_msgdef(name, definition)
        for i, message in enumerate(messages):
            stamp = EPOCH + i * 10 * STEP
            writer.write_message("/rig", schema, message, stamp, stamp, i)
    return path


def test_ros2_messages_with_nesting_strings_arrays_and_samples(tmp_path):
    count = 40
    log = open_log(write_ros2(tmp_path / "a.mcap", "rig_msgs/msg/Sample", WRENCH, [wrench(i) for i in range(count)]))
    rig = table(log, "rig")
    read = rows(rig)
    assert read["trace"].size == 10 * count
    np.testing.assert_array_equal(read["trace"], [100.0 * i + k for i in range(count) for k in range(10)])
    np.testing.assert_allclose(read["log_time"], np.arange(10 * count) * 1e-3, rtol=0, atol=1e-9)
    first = slice(None, None, 10)
    np.testing.assert_array_equal(read["wrench.force.x"][first], np.arange(count) + 0.5)
    np.testing.assert_array_equal(read["wrench.force.y"][first], -0.25 * np.arange(count))
    np.testing.assert_array_equal(read["wrench.torque.z"][first], np.arange(count))
    np.testing.assert_array_equal(read["position.1"][first], 2.0 * np.arange(count))
    np.testing.assert_array_equal(read["switches.1"][first], np.arange(count) % 2)
    np.testing.assert_array_equal(read["count"][first], -(2.0**40) + np.arange(count))
    np.testing.assert_array_equal(read["header.stamp"][first], 100.5 + np.arange(count))
    assert read["state"][first][:2].tolist() == ["offline", "on"]
    assert read["header.frame_id"][first][:3].tolist() == ["", "cell", "cellcell"]
    assert "picture" not in read
    assert "raw bytes were left out: picture" in messages_of(log.notes)
    assert "trace: blocks of 10 samples, the first at the message's stamp" in log.details["topic rig"]


SCALARS = [
    "bool",
    "int8",
    "uint8",
    "int16",
    "uint16",
    "int32",
    "uint32",
    "int64",
    "uint64",
    "float32",
    "float64",
    "string",
]
LIMITS = {"int8": 7, "int16": 15, "int32": 31, "int64": 63, "uint8": 8, "uint16": 16, "uint32": 32, "uint64": 64}


def values(kind: str) -> st.SearchStrategy:
    if kind == "bool":
        return st.booleans()
    if kind == "string":
        return st.text(st.characters(codec="ascii", exclude_categories=["Cc"]), max_size=6)
    if kind.startswith("float"):
        return st.floats(width=32 if kind == "float32" else 64, allow_nan=False, allow_infinity=False)
    high = 2 ** LIMITS[kind]
    return st.integers(0 if kind[0] == "u" else -high, high - 1)


@st.composite
def ros_messages(draw):
    kinds = draw(st.lists(st.sampled_from(SCALARS), min_size=1, max_size=7))
    shapes = [draw(st.sampled_from(["", "[3]", "[]"])) for _ in kinds]
    shapes = ["" if kind == "uint8" else shape for kind, shape in zip(kinds, shapes, strict=True)]
    messages = []
    for _ in range(draw(st.integers(1, 6))):
        message = {}
        for i, (kind, shape) in enumerate(zip(kinds, shapes, strict=True)):
            one = values(kind)
            many = st.lists(one, min_size=3, max_size=3) if shape == "[3]" else st.lists(one, min_size=2, max_size=2)
            message[f"f{i}"] = draw(one if not shape else many)
        messages.append(message)
    return "\n".join(f"{kind}{shape} f{i}" for i, (kind, shape) in enumerate(zip(kinds, shapes, strict=True))), messages


def compare(read: dict, decoded: list[dict]) -> None:
    for name in decoded[0]:
        for i, message in enumerate(decoded):
            value = message[name]
            members = [read[name]] if not isinstance(value, list) else [read[f"{name}.{j}"] for j in range(len(value))]
            for column, one in zip(members, value if isinstance(value, list) else [value], strict=True):
                assert column[i] == (one if isinstance(one, str) else float(one))


@settings(max_examples=40, deadline=None)
@given(case=ros_messages())
def test_any_ros2_message_reads_as_the_official_decoder_reads_it(tmp_path_factory, case):
    definition, messages = case
    path = write_ros2(tmp_path_factory.mktemp("h") / "a.mcap", "rig_msgs/msg/Any", definition, messages)
    with path.open("rb") as file:
        found = [m for _, _, _, m in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()]
    decoded = [{name: getattr(message, name) for name in messages[0]} for message in found]
    compare(rows(table(open_log(path))), decoded)


@settings(max_examples=40, deadline=None)
@given(case=ros_messages())
def test_any_ros1_message_reads_as_it_was_written(tmp_path_factory, case):
    definition, messages = case
    kind = dynamic.generate_dynamic("rig_msgs/Any", definition)["rig_msgs/Any"]
    path = tmp_path_factory.mktemp("h") / "a.mcap"
    with path.open("wb") as file, Ros1Writer(file) as writer:
        for i, message in enumerate(messages):
            writer.write_message("/rig", kind(**message), EPOCH + i * STEP)
    compare(rows(table(open_log(path))), messages)


def test_ros1_header_and_time(tmp_path):
    definition = (
        "Header header\nfloat32 force\nduration wait\n"
        + "=" * 80
        + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
    )
    types = dynamic.generate_dynamic("rig_msgs/Sample", definition)
    path = tmp_path / "a.mcap"
    with path.open("wb") as file, Ros1Writer(file) as writer:
        for i in range(5):
            message = types["rig_msgs/Sample"]()
            message.header.stamp = rostime.Time(7 + i, 125_000_000)
            message.header.frame_id = "x" * i
            message.force = 0.5 * i
            message.wait = rostime.Duration(-1, 500_000_000)
            writer.write_message("/rig", message, EPOCH + i * STEP)
    read = rows(table(open_log(path)))
    np.testing.assert_array_equal(read["header.stamp"], 7.125 + np.arange(5))
    np.testing.assert_array_equal(read["wait"], np.full(5, -0.5))
    np.testing.assert_array_equal(read["force"], 0.5 * np.arange(5))
    assert read["header.frame_id"].tolist() == ["", "x", "xx", "xxx", "xxxx"]


def test_joint_states_with_names_are_vectors_even_when_there_are_many(tmp_path):
    definition = "string[] name\nfloat64[] position\nfloat64[] effort"
    names = [f"joint{i}" for i in range(12)]
    messages = [{"name": names, "position": [i + k for k in range(12)], "effort": []} for i in range(5)]
    read = rows(table(open_log(write_ros2(tmp_path / "a.mcap", "sensor_msgs/msg/JointState", definition, messages))))
    assert read["position.11"].tolist() == [11.0, 12.0, 13.0, 14.0, 15.0]
    assert read["name.3"].tolist() == ["joint3"] * 5


def test_arrays_of_structs_are_lists_of_their_fields(tmp_path):
    definition = "Point[] samples\n====\nMSG: rig_msgs/Point\nfloat32 force\nfloat64[2] xy"
    messages = [{"samples": [{"force": 10 * i + k, "xy": [k, -k]} for k in range(8 + i % 2)]} for i in range(6)]
    read = rows(table(open_log(write_ros2(tmp_path / "a.mcap", "rig_msgs/msg/Samples", definition, messages))))
    expected = [10 * i + k for i in range(6) for k in range(8 + i % 2)]
    np.testing.assert_array_equal(read["samples.force"], expected)
    np.testing.assert_array_equal(read["samples.xy.1"], [-k for i in range(6) for k in range(8 + i % 2)])


def write_cdr(path: Path, schema: tuple[str, str, str], payloads: list[bytes]) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channel = writer.register_channel(
            "/rig", "cdr", writer.register_schema(schema[0], schema[1], schema[2].encode())
        )
        for i, payload in enumerate(payloads):
            writer.add_message(channel, EPOCH + i * STEP, payload, EPOCH + i * STEP)
        writer.finish()
    return path


IDL = """
================================================================================
IDL: rig_msgs/msg/Sample
#include "geometry_msgs/msg/Vector3.idl"
module geometry_msgs { module msg { struct Vector3 { double x; double y; double z; }; }; };
module rig_msgs {
  module msg {
    typedef float float__2[2];
    const long COUNT = 2;
    enum Mode { OFF, ON };
    @verbatim (language="comment", text="A sample; (with) brackets")
    struct Sample {
      @unit(value="kN")
      double force;  // N
      octet flag;
      unsigned long long count;
      geometry_msgs::msg::Vector3 direction;
      float__2 pair;
      short shorts[COUNT];
      sequence<double, 16> trace;
      @default (value=3) string<16> state;
      Mode mode;
    };
  };
};
"""


def sample_in_cdr(i: int, order: str, widest: int) -> bytes:
    data = b""

    def put(kind: str, *values: float) -> None:
        nonlocal data
        for value in values:
            size = min(struct.calcsize(kind), widest)
            data += b"\0" * (-len(data) % size) + struct.pack(order + kind, value)

    put("d", 1.5 * i)
    put("B", i)
    put("Q", 2**40 + i)
    put("d", 1.0, 2.0, 3.0)
    put("f", 0.5, 0.25)
    put("h", -1, -2)
    put("I", 3)
    put("d", i, i + 1, i + 2)
    put("I", 4)
    data += b"run\0"
    put("I", 1)
    kinds = {("<", 8): 1, (">", 8): 0, ("<", 4): 7, (">", 4): 6}
    return bytes([0, kinds[order, widest], 0, 0]) + data


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("widest", [8, 4])
def test_ros2_idl_in_both_byte_orders_and_alignments_of_cdr(tmp_path, order, widest):
    payloads = [sample_in_cdr(i, order, widest) for i in range(12)]
    rig = table(open_log(write_cdr(tmp_path / "a.mcap", ("rig_msgs/msg/Sample", "ros2idl", IDL), payloads)))
    read = rows(rig)
    np.testing.assert_array_equal(read["force"], 1.5 * np.arange(12))
    np.testing.assert_array_equal(read["count"], 2.0**40 + np.arange(12))
    assert read["direction.z"][3] == 3.0
    assert read["pair.1"][3] == 0.25
    assert read["shorts.1"][3] == -2.0
    np.testing.assert_array_equal(read["trace.2"], np.arange(12) + 2)
    assert read["state"][5] == "run"
    assert read["mode"][5] == 1.0
    assert {c.name: c.unit for c in rig.channels}["force"] == "kN"


def test_short_or_lying_ros_messages_are_left_out_and_counted(tmp_path):
    definition = "float64 force\nfloat64[] trace"
    good = b"\0\1\0\0" + struct.pack("<dI4xd", 5.0, 1, 2.0)
    lying = b"\0\1\0\0" + struct.pack("<dI4xd", 5.0, 2**31, 2.0)
    path = write_cdr(tmp_path / "a.mcap", ("p/msg/A", "ros2msg", definition), [good, b"", good[:9], lying, good])
    rig = table(open_log(path))
    assert rows(rig)["force"].tolist() == [5.0, 5.0]
    assert "3 of 5 messages malformed" in messages_of(rig.notes())


@pytest.mark.parametrize(
    ("definition", "why"),
    [
        ("Thing thing", "type 'Thing' is not defined"),
        ("wstring name", "wide strings"),
        ("float64", "is no field"),
        ("A again", "contains itself"),
    ],
)
def test_a_definition_that_cannot_be_understood_is_named(tmp_path, definition, why):
    path = write_cdr(tmp_path / "a.mcap", ("p/msg/A", "ros2msg", definition), [b"\0\1\0\0"])
    with pytest.raises(InputError, match=why):
        open_log(path)


def protobuf_class():
    """Build rig.Sample with nesting, lists, a map, presence, an enum, bytes and a timestamp."""
    file = descriptor_pb2.FileDescriptorProto(name="rig.proto", package="rig", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    sample = file.message_type.add(name="Sample")
    vector = sample.nested_type.add(name="Vector")
    kind = descriptor_pb2.FieldDescriptorProto
    for i, name in enumerate("xy", start=1):
        vector.field.add(name=name, number=i, type=kind.TYPE_DOUBLE, label=kind.LABEL_OPTIONAL)
    sample.enum_type.add(name="Mode").value.add(name="OFF", number=0)
    sample.enum_type[0].value.add(name="ON", number=1)
    entry = sample.nested_type.add(name="LoadsEntry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, type=kind.TYPE_STRING, label=kind.LABEL_OPTIONAL)
    entry.field.add(name="value", number=2, type=kind.TYPE_FLOAT, label=kind.LABEL_OPTIONAL)
    sample.oneof_decl.add(name="_current")

    def add(name: str, number: int, type_: int, **options):
        sample.field.add(name=name, number=number, type=type_, **{"label": kind.LABEL_OPTIONAL, **options})

    add("stamp", 1, kind.TYPE_MESSAGE, type_name=".google.protobuf.Timestamp")
    add("force", 2, kind.TYPE_MESSAGE, type_name=".rig.Sample.Vector")
    add("trace", 3, kind.TYPE_FLOAT, label=kind.LABEL_REPEATED)
    add("current", 4, kind.TYPE_DOUBLE, oneof_index=0, proto3_optional=True)
    add("mode", 5, kind.TYPE_ENUM, type_name=".rig.Sample.Mode")
    add("loads", 6, kind.TYPE_MESSAGE, type_name=".rig.Sample.LoadsEntry", label=kind.LABEL_REPEATED)
    add("picture", 7, kind.TYPE_BYTES)
    add("state", 8, kind.TYPE_STRING)
    add("count", 9, kind.TYPE_INT64)
    pool = descriptor_pool.DescriptorPool()
    for needed in (Timestamp.DESCRIPTOR.file, file):
        pool.AddSerializedFile(needed.serialized_pb if hasattr(needed, "serialized_pb") else needed.SerializeToString())
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("rig.Sample"))


def test_protobuf_messages(tmp_path):
    sample, count = protobuf_class(), 20
    path = tmp_path / "a.mcap"
    with path.open("wb") as file, ProtobufWriter(file) as writer:
        for i in range(count):
            message = sample(trace=[i + 0.125 * k for k in range(8)], mode=i % 2, state="s", count=-i, picture=b"abc")
            message.stamp.seconds, message.stamp.nanos = 50 + i, 250_000_000
            if i % 2:
                message.current = 0.5 * i
                message.force.x = i
            message.loads["left"] = 2.0 * i
            writer.write_message("/rig", message, EPOCH + i * 8 * STEP, EPOCH + i * 8 * STEP)
    log = open_log(path)
    read = {name: column[::8] for name, column in rows(table(log)).items() if name != "trace"}
    trace = rows(table(log), ["trace"])["trace"]
    np.testing.assert_array_equal(trace, [i + 0.125 * k for i in range(count) for k in range(8)])
    i = np.arange(count)
    np.testing.assert_array_equal(read["stamp"], 50.25 + i)
    np.testing.assert_array_equal(read["current"], np.where(i % 2, 0.5 * i, np.nan))
    np.testing.assert_array_equal(read["force.x"], np.where(i % 2, i, np.nan))
    np.testing.assert_array_equal(read["mode"], i % 2)
    np.testing.assert_array_equal(read["count"], -i)
    np.testing.assert_array_equal(read["loads.left"], 2.0 * i)
    assert read["state"][0] == "s"
    assert "raw bytes were left out: picture" in messages_of(log.notes)


def test_damaged_protobuf_messages_and_descriptions(tmp_path):
    good = protobuf_class()(state="a").SerializeToString()
    from mcap_protobuf.schema import build_file_descriptor_set

    description = build_file_descriptor_set(protobuf_class()).SerializeToString()

    def write(name: str, schema: bytes) -> Path:
        with (tmp_path / name).open("wb") as file:
            writer = Writer(file)
            writer.start()
            channel = writer.register_channel(
                "/rig", "protobuf", writer.register_schema("rig.Sample", "protobuf", schema)
            )
            for i, payload in enumerate([good, b"\xff\xff\xff", good]):
                writer.add_message(channel, EPOCH + i * STEP, payload, EPOCH)
            writer.finish()
        return tmp_path / name

    rig = table(open_log(write("a.mcap", description)))
    assert rows(rig)["state"].tolist() == ["a", "a"]
    assert "1 of 3 messages malformed" in messages_of(rig.notes())
    for damaged in (b"\xff\xff\xff", description[:40], b""):
        with pytest.raises(InputError, match="Protobuf description is damaged"):
            open_log(write("b.mcap", damaged))
