"""MCAP logs that lie: about sizes, about what they unpack to, with definitions and messages without end."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap_logs import stamped, write_json

from pipeline.errors import InputError
from pipeline.ingest.mcap_log.encodings.idl import parse_idl
from pipeline.ingest.mcap_log.encodings.ros_messages import RosDecoder
from pipeline.ingest.mcap_log.encodings.ros_types import DefinitionError, parse_msg
from pipeline.ingest.scan import scan_log

MAGIC = b"\x89MCAP0\r\n"
HUGE = (1 << 64) - 1
SAMPLES = [{"x": float(np.sin(0.1 * k)), "F": float(k)} for k in range(300)]


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(word: str) -> bytes:
    return struct.pack("<I", len(word)) + word.encode()


def schema(encoding: str, data: bytes, name: str = "s") -> bytes:
    return record(3, struct.pack("<H", 1) + text(name) + text(encoding) + struct.pack("<I", len(data)) + data)


def channel(encoding: str = "json", metadata: bytes = b"\0\0\0\0", schema_id: int = 1) -> bytes:
    return record(4, struct.pack("<HH", 1, schema_id) + text("/rig") + text(encoding) + metadata)


def message(payload: bytes, stamp: int) -> bytes:
    return record(5, struct.pack("<HIQQ", 1, 0, stamp, stamp) + payload)


def messages(payloads: list[bytes]) -> bytes:
    return b"".join(message(payload, 10**18 + k * 10**6) for k, payload in enumerate(payloads))


GOOD = messages([json.dumps(sample).encode() for sample in SAMPLES])


def chunk(packed: bytes, size: int, compression: str = "zstd", crc: int = 0, data_length: int | None = None) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, crc) + text(compression)
    return record(6, head + struct.pack("<Q", len(packed) if data_length is None else data_length) + packed)


def log(*parts: bytes) -> bytes:
    return MAGIC + record(1, text("") + text("hostile")) + b"".join(parts)


LYING = {
    "a message longer than any file": log(channel(schema_id=0), GOOD, record(5, bytes(40), HUGE)),
    "a chunk longer than any file": log(channel(schema_id=0), GOOD, record(6, bytes(60), HUGE)),
    "a chunk whose data are longer": log(channel(schema_id=0), GOOD, chunk(b"xy", 100, data_length=HUGE)),
    "a chunk that unpacks to all there is": log(channel(schema_id=0), GOOD, chunk(zstandard.compress(b"x"), HUGE)),
    "a chunk that unpacks to more than it says": log(channel(schema_id=0), GOOD, chunk(zstandard.compress(GOOD), 10)),
    "a chunk with a wrong check sum": log(channel(schema_id=0), GOOD, chunk(zstandard.compress(GOOD), len(GOOD), crc=7)),
    "a chunk of 10 GB in a few bytes": log(
        channel(schema_id=0), GOOD, chunk(zstandard.compress(bytes(1 << 24)) * 640, 10 << 30)
    ),
    "an attachment longer than any file": log(channel(schema_id=0), GOOD, record(9, bytes(40), HUGE)),
    "an attachment with a huge name": log(channel(schema_id=0), GOOD, record(9, bytes(16) + b"\xff" * 30)),
    "metadata with a huge length": log(channel(schema_id=0), GOOD, record(12, b"\xff" * 30)),
    "indexes without end": log(channel(schema_id=0), chunk(zstandard.compress(GOOD), len(GOOD)),
                               *(record(7, struct.pack("<HI", k, 16)) for k in range(30_000))),
    "schemas that are all broken": log(
        channel(schema_id=0), GOOD, *(record(3, struct.pack("<HI", 1, k + 10**6)) for k in range(10_000))
    ),
}  # fmt: skip


@pytest.mark.parametrize("lie", LYING)
def test_a_lie_about_sizes_costs_what_it_is_about_and_is_told(tmp_path: Path, lie: str) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(LYING[lie])
    scan = scan_log(path)
    [table] = scan.tables
    assert table.summary.n == len(SAMPLES)
    if not lie.startswith(("an attachment with", "indexes")):
        assert any(finding.level == "warning" for finding in scan.quality)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "bz2"])
def test_a_chunk_of_zeros_that_keeps_its_word_takes_no_more_memory_than_it_may(
    tmp_path: Path, compression: str
) -> None:
    import bz2
    import tracemalloc

    import lz4.frame

    pack: dict[str, Callable[[bytes], bytes]] = {
        "zstd": zstandard.compress, "lz4": lz4.frame.compress, "bz2": bz2.compress
    }  # fmt: skip
    size = 32 << 20
    path = tmp_path / "log.mcap"
    path.write_bytes(log(channel(schema_id=0), GOOD, chunk(pack[compression](bytes(size)), size, compression)))
    tracemalloc.start()
    assert scan_log(path).tables[0].summary.n == len(SAMPLES)
    assert tracemalloc.get_traced_memory()[1] < 4 * size
    tracemalloc.stop()


def test_messages_without_content_by_the_million_stay_small(tmp_path: Path) -> None:
    content = message(b"", 1) * 50_000
    packed = zstandard.compress(content)
    path = tmp_path / "log.mcap"
    path.write_bytes(log(channel(schema_id=0), GOOD, chunk(packed, len(content))))
    assert scan_log(path).tables[0].summary.n == len(SAMPLES)


DEEP = b"[" * 100_000
ODD = {
    "brackets without end": DEEP,
    "brackets that close": DEEP + b"]" * 100_000,
    "objects within objects": b'{"a":' * 900 + b"1" + b"}" * 900,
    "a number of 5000 digits": b'{"x": ' + b"9" * 5000 + b"}",
    "half a character": b'{"x": 1, "F": 2, "w\\ud800": "\\udfff"}',
    "a name of markup and control signs": b'{"<script>alert(1)</script>\\u001b[31m": 1}',
    "three thousand fields": json.dumps({f"f{k}": k for k in range(3000)}).encode(),
}


@pytest.mark.parametrize("name", ODD)
def test_an_odd_json_message_among_good_ones_does_no_harm(tmp_path: Path, name: str) -> None:
    path = write_json(tmp_path / "log.mcap", {"/rig": stamped([*SAMPLES, *[ODD[name]] * 20])})
    try:
        scan = scan_log(path)
    except InputError as error:
        str(error).encode()
    else:
        for finding in scan.quality:
            finding.message.encode()


SCHEMAS = {
    "that holds itself a thousand times": {"properties": {f"p{k}": {"$ref": "#"} for k in range(1000)}},
    "with choices that are a number": {"anyOf": 5, "properties": {"x": {"unit": "mm", "oneOf": None}}},
    "that refers in a circle": {"$ref": "#/properties/a", "properties": {"a": {"$ref": "#"}}},
}


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_json_schema_is_looked_at_within_bounds(tmp_path: Path, name: str) -> None:
    path = write_json(tmp_path / "log.mcap", {"/rig": stamped(SAMPLES)}, schemas={"/rig": SCHEMAS[name]})
    assert scan_log(path).tables[0].summary.n == len(SAMPLES)


def doubling(levels: int, last: str) -> str:
    parts = "".join(f"===\nMSG: p/T{k}\np/T{k + 1} a\np/T{k + 1} b\n" for k in range(1, levels))
    return f"p/T1 a\np/T1 b\n{parts}===\nMSG: p/T{levels}\n{last}\n"


@pytest.mark.parametrize(
    "definition",
    [doubling(40, "float64 x"), doubling(40, ""), "\n===\nMSG: p/E\n".join(["p/E x"] * 2),
     "".join(f"p/T{k + 1} a\n===\nMSG: p/T{k + 1}\n" for k in range(5000)), "float64[" + "9" * 5000 + "] x", "float64[4294967296] x"],
)  # fmt: skip
def test_a_definition_without_end_is_refused(definition: str) -> None:
    for ros in (1, 2):
        with pytest.raises(DefinitionError):
            parse_msg("p/Top", definition, ros)


@pytest.mark.parametrize(
    "definition",
    [
        "module p { struct T0 { double x; }; "
        + " ".join(f"struct T{k + 1} {{ T{k} a; T{k} b; }};" for k in range(40))
        + " struct Top { T40 a; }; };",
        "module p { struct Top { " + "sequence<" * 90 + "double" + ">" * 90 + " x; }; };",
        "/*" * 200_000,
        '"\\' * 200_000,
        "module p { struct Top { double x[" + "9" * 5000 + "]; }; };",
    ],
    ids=["doubling", "sequences", "comments", "quotes", "digits"],
)
def test_idl_without_end_is_refused_soon(definition: str) -> None:
    with pytest.raises(DefinitionError):
        parse_idl("p::Top", definition)


def test_lists_in_cdr_and_ros_1_are_no_longer_than_their_message() -> None:
    blocks = parse_msg("p/Top", "p/In[] a\n===\nMSG: p/In\nfloat64 x\n", 2)
    nothing = parse_msg("p/Top", "p/In[] a\nfloat64 x\n===\nMSG: p/In\n", 1)
    told = b"\xff\xff\xff\xff" + struct.pack("<d", 1.0)
    _, good = RosDecoder(blocks, cdr=True).decode([b"\0\1\0\0" + told])
    assert good is not None
    assert not good.any()
    columns, _ = RosDecoder(nothing, cdr=False).decode([told])
    assert columns["x",].values.tolist() == [1.0]


def test_a_protobuf_description_that_holds_itself_is_read_to_a_depth(tmp_path: Path) -> None:
    from google.protobuf import descriptor_pb2 as pb

    file = pb.FileDescriptorProto(name="r.proto", package="r", syntax="proto3")
    of = pb.FieldDescriptorProto
    for k in range(1500):
        one = file.message_type.add(name=f"T{k}")
        kind = of.TYPE_DOUBLE if k == 1499 else of.TYPE_MESSAGE
        one.field.add(
            name="x", number=1, type=kind, label=of.LABEL_OPTIONAL, type_name=f".r.T{k + 1}" if k < 1499 else ""
        )
    described = pb.FileDescriptorSet(file=[file]).SerializeToString()
    path = tmp_path / "log.mcap"
    within = b""
    for _ in range(200):
        within = b"\x0a" + bytes([len(within)]) + within if len(within) < 127 else within
    path.write_bytes(log(schema("protobuf", described, "r.T0"), channel("protobuf"), messages([within] * 50)))
    with pytest.raises(InputError, match=r"log\.mcap"):
        scan_log(path)


def test_single_values_beside_a_block_that_would_be_repeated_without_end_are_refused(tmp_path: Path) -> None:
    one = {"block": [0] * 200_000, **{f"s{k}": k for k in range(400)}}
    path = write_json(tmp_path / "log.mcap", {"/rig": stamped([one, one])})
    with pytest.raises(InputError, match="topics of their own"):
        scan_log(path)
