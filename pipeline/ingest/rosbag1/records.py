"""The records of a ROS 1 bag as bytes: heads of fields, what connections say; nothing about files or messages' content.

Format: wiki.ros.org, Bags/Format/2.0. A record is a head of ``name=value`` fields and data, each after its length
(4 bytes); all numbers are little-endian.
"""

from __future__ import annotations

import struct

from pipeline.ingest.mcap_log.layout import Layout
from pipeline.ingest.mcap_log.records import Channel, MalformedError, Schema, printable

MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
NAMES = {
    MESSAGE: "message", BAG: "bag", INDEX: "index", CHUNK: "chunk", CHUNK_INFO: "chunk info", CONNECTION: "connection",
}  # fmt: skip
LENGTH = struct.Struct("<I")

Fields = dict[str, bytes]


def fields_of(head: bytes) -> Fields:
    """Return the fields of a record's head.

    Raises
    ------
    MalformedError
        If it is none.
    """
    fields: Fields = {}
    at = 0
    while at < len(head):
        if len(head) - at < 4:
            raise MalformedError("the head of a record ends within a field")
        (length,) = LENGTH.unpack_from(head, at)
        name, sign, value = head[at + 4 : at + 4 + length].partition(b"=")
        if not sign or length > len(head) - at - 4:
            raise MalformedError("the head of a record is not made of fields")
        fields[name.decode("ascii", "replace")] = value
        at += 4 + length
    return fields


def define(layout: Layout, fields: Fields, data: bytes) -> None:
    """Take in a connection: its topic and type; the first of a number counts."""
    try:
        conn, about = number(fields, "conn"), {k: v.decode("utf-8", "replace") for k, v in fields_of(data).items()}
    except MalformedError as error:
        layout.note_bad(f"a connection record is malformed: {error}")
        return
    topic = printable(fields.get("topic", b"").decode("utf-8", "replace"))
    definition = about.get("message_definition", "").encode()
    layout.schemas.setdefault(conn, Schema(conn, printable(about.get("type", "")), "ros1msg", definition))
    layout.channels.setdefault(conn, Channel(conn, conn, topic, "ros1", about))


def kind_of(fields: Fields) -> int:
    """Return what a record is, one of `NAMES`."""
    kind = fields.get("op", b"\0")
    if len(kind) != 1 or kind[0] not in NAMES:
        raise MalformedError(f"a record is of the unknown kind {kind!r}")
    return kind[0]


def number(fields: Fields, name: str, size: int = 4) -> int:
    """Return a field that is a whole number of `size` bytes."""
    value = fields.get(name, b"")
    if len(value) != size:
        raise MalformedError(f"the head of a record lacks its field '{name}'")
    return int.from_bytes(value, "little")


def nanoseconds(fields: Fields, name: str) -> int:
    """Return a field that is a time: seconds and nanoseconds of 4 bytes each."""
    rest, seconds = divmod(number(fields, name, 8), 1 << 32)
    return seconds * 10**9 + rest
