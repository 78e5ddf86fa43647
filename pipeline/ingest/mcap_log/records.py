"""The records of MCAP as bytes: what each holds, nothing about files, damage or messages' content.

Format: mcap.dev, specification, version 0. A record is an opcode (1 byte), the length of its body
(8 bytes) and the body; all numbers are little-endian, text is a length (4 bytes) and UTF-8.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, METADATA, DATA_END = 0x09, 0x0C, 0x0F
STATISTICS = 0x0B

# A message's body: channel (2), sequence (4), log time (8), publish time (8), then the payload.
MESSAGE_HEAD = 22
_CHUNK_HEAD = struct.Struct("<QQQI")
_CHUNK_INDEX_HEAD = struct.Struct("<QQQQ")


class MalformedError(Exception):
    """A record whose body is not what its opcode says; the text tells why."""


@dataclass(frozen=True)
class Schema:
    """What messages look like: `encoding` is that of `data` (``jsonschema``, ``ros2msg``, ...)."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """A publisher on a topic; `encoding` is that of its messages (``json``, ``cdr``, ...).

    `problem` tells why its messages cannot be read, where the container of the log knows.
    """

    id: int
    schema_id: int
    topic: str
    encoding: str
    metadata: dict[str, str]
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """The body of a chunk up to its data: times in ns, `data_offset` counts from the body's start."""

    start_time: int
    end_time: int
    size: int
    crc: int
    compression: str
    data_offset: int
    data_length: int


def printable(text: str) -> str:
    """Return a name as it may stand in a message: without line ends and other control characters."""
    return text if text.isprintable() else "".join(c if c.isprintable() else "\ufffd" for c in text)


class _Cursor:
    """Reads one body from front to back; raises MalformedError where it is too short."""

    def __init__(self, body: bytes) -> None:
        self.body = body
        self.at = 0

    def take(self, length: int) -> bytes:
        if length > len(self.body) - self.at:
            raise MalformedError(f"a field of {length} bytes does not fit into its record of {len(self.body)} bytes")
        self.at += length
        return self.body[self.at - length : self.at]

    def number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        return self.take(self.number(4)).decode("utf-8", "replace")

    def name(self) -> str:
        return printable(self.text())

    def pairs(self) -> dict[str, str]:
        end = self.number(4) + self.at
        found: dict[str, str] = {}
        while self.at < end:
            key = self.name()
            found[key] = self.text()
        return found


def header(body: bytes) -> tuple[str, str]:
    """Return profile and library."""
    cursor = _Cursor(body)
    return cursor.name(), cursor.name()


def schema(body: bytes) -> Schema:
    """Return the schema that `body` holds."""
    cursor = _Cursor(body)
    return Schema(cursor.number(2), cursor.name(), cursor.name(), cursor.take(cursor.number(4)))


def channel(body: bytes) -> Channel:
    """Return the channel that `body` holds."""
    cursor = _Cursor(body)
    return Channel(cursor.number(2), cursor.number(2), cursor.name(), cursor.name(), cursor.pairs())


def metadata(body: bytes) -> tuple[str, dict[str, str]]:
    """Return name and pairs of a metadata record."""
    cursor = _Cursor(body)
    return cursor.name(), cursor.pairs()


def message_index(body: bytes) -> tuple[int, int]:
    """Return channel and number of the messages that a message index lists."""
    cursor = _Cursor(body)
    return cursor.number(2), cursor.number(4) // 16


def message_counts(body: bytes) -> dict[int, int]:
    """Return the number of messages of each channel from a statistics record."""
    cursor = _Cursor(body)
    cursor.take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8)
    end = cursor.number(4) + cursor.at
    counts: dict[int, int] = {}
    while cursor.at < end:
        channel_id = cursor.number(2)
        counts[channel_id] = cursor.number(8)
    return counts


def chunk_index(body: bytes) -> tuple[int, int]:
    """Return where in the file the chunk starts and how long its record is."""
    if len(body) < _CHUNK_INDEX_HEAD.size:
        raise MalformedError("a chunk index is too short")
    _, _, offset, length = _CHUNK_INDEX_HEAD.unpack_from(body)
    return offset, length


def summary_start(footer: bytes) -> int:
    """Return where the summary starts; 0 means that there is none."""
    return _Cursor(footer).number(8)


def chunk_head(body: bytes) -> ChunkHead:
    """Return the head of a chunk; `body` may end anywhere in the chunk's data."""
    cursor = _Cursor(body)
    start_time, end_time, size, crc = _CHUNK_HEAD.unpack(cursor.take(_CHUNK_HEAD.size))
    compression = cursor.name()
    length = cursor.number(8)
    return ChunkHead(start_time, end_time, size, crc, compression, cursor.at, length)
