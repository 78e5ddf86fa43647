"""Where things lie in a ROS 1 bag: one walk over its records, without reading chunks.

The walk goes by the records themselves, so that a bag that was never closed (``.bag.active``) or was cut off needs no
index; where the index survived, reading goes on behind damage.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from pipeline.errors import InputError
from pipeline.ingest.mcap_log.layout import LARGEST_CHUNK, Damage, Layout, Segment
from pipeline.ingest.mcap_log.records import ChunkHead, MalformedError, printable
from pipeline.ingest.misnamed import misnamed
from pipeline.ingest.rosbag1 import records
from pipeline.ingest.rosbag1.records import Fields

MAGIC = b"#ROSBAG V"
_VERSION = b"#ROSBAG V2.0\n"
# Heads have some dozen bytes, those of connections a topic's name; a longer one is a lie.
_LONGEST_HEAD = 1 << 16
_LONGEST_DATA = 64 << 20
_RUN_BYTES = 1 << 20
# The bag's first record is padded to 4096 bytes.
_BEHIND_THE_HEAD = len(_VERSION) + 4096
_COMPRESSIONS = {"none": ""}
# Of a chunk that was never finished nothing tells its size; no packing of logs gains more than this.
_MOST_GAINED = 50


def survey_bag(path: Path) -> Layout:
    """Walk over the records of a bag, without reading its chunks.

    Raises
    ------
    InputError
        If the file cannot be read, or is no bag of version 2.0.
    """
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            line = file.read(len(_VERSION))
            if line != _VERSION:
                raise _no_bag(path, line)
            layout = Layout(path, size, profile="ros1")
            _Walk(layout, file).go()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    return layout


def _no_bag(path: Path, line: bytes) -> InputError:
    if line.startswith(MAGIC):
        version = line[len(MAGIC) :].split(b"\n")[0].decode("ascii", "replace")
        return InputError(
            f"{path}: is a ROS bag of version {printable(version)}; only version 2.0 is read. Write it anew with ROS's own "
            f"'rosbag filter {path.name} new.bag True'."
        )
    return misnamed(path, "ROS 1 bag")


class _Walk:
    """Goes from record to record and notes in the layout where messages stand."""

    def __init__(self, layout: Layout, file: BinaryIO) -> None:
        self.layout, self.file = layout, file
        self.index_at = 0
        self.begins: dict[int, Segment] = {}

    def go(self) -> None:
        at = len(_VERSION)
        while at < self.layout.size:
            try:
                at = self.take(at)
            except MalformedError as error:
                behind = [_BEHIND_THE_HEAD] if at < _BEHIND_THE_HEAD else self.indexed_chunks()
                resume = next((chunk for chunk in behind if at < chunk < self.layout.size), self.layout.size)
                self.layout.damages.append(Damage(at, resume, str(error)))
                for segment in self.layout.segments[-1:]:
                    segment.counts = None  # its index may be what was lost
                at = resume
        self.layout.has_footer = self.index_at > 0
        if self.layout.segments:
            self.layout.segments[-1].counts = None if self.layout.damages else self.layout.segments[-1].counts

    def take(self, at: int) -> int:
        """Take in the record at `at`; return where the next one stands."""
        fields, start, length = self.record(at)
        kind = records.kind_of(fields)
        left = self.layout.size - start
        if kind == records.CHUNK:
            return self.chunk(fields, at, start, length)
        if length > left:
            raise MalformedError(
                f"a {records.NAMES[kind]} record says that it has {length} bytes, but only {left} are left in the file"
            )
        if kind == records.MESSAGE:
            self.loose(fields, at, start + length)
        elif length > _LONGEST_DATA:
            raise MalformedError(
                f"a {records.NAMES[kind]} record says that it has {length} bytes, which is beyond belief"
            )
        elif kind == records.CONNECTION:
            records.define(self.layout, fields, self.read(start, length))
        elif kind == records.BAG:
            self.bag(fields)
        elif kind == records.INDEX and self.layout.segments:
            count, last = records.number(fields, "count"), self.layout.segments[-1]
            last.counts = {} if last.counts is None else last.counts
            last.counts[records.number(fields, "conn")] = count
        elif kind == records.CHUNK_INFO and (segment := self.begins.get(records.number(fields, "chunk_pos", 8))):
            self.dated(segment, fields)
        return start + length

    def record(self, at: int) -> tuple[Fields, int, int]:
        """Return the fields of a record's head, where its data start and how long they are."""
        (head,) = records.LENGTH.unpack(self.whole(at, 4))
        if head > _LONGEST_HEAD:
            raise MalformedError(f"the head of a record says that it has {head} bytes, which is beyond belief")
        fields = records.fields_of(self.whole(at + 4, head))
        (length,) = records.LENGTH.unpack(self.whole(at + 4 + head, 4))
        return fields, at + 8 + head, length

    def read(self, at: int, length: int) -> bytes:
        self.file.seek(at)
        return self.file.read(length)

    def whole(self, at: int, length: int) -> bytes:
        found = self.read(at, length)
        if len(found) < length:
            raise MalformedError("the file ends within the head of a record")
        return found

    def bag(self, fields: Fields) -> None:
        if fields.get("encryptor"):
            raise InputError(
                f"{self.layout.path}: this ROS 1 bag is encrypted ({printable(fields['encryptor'].decode('utf-8', 'replace'))}); "
                "write it anew with 'rosbag decrypt'."
            )
        self.index_at = records.number(fields, "index_pos", 8)

    def chunk(self, fields: Fields, at: int, start: int, length: int) -> int:
        """Take in a chunk; one that was never finished says that it has no data, and what follows is its content."""
        said = fields.get("compression", b"").decode("ascii", "replace")
        compression = _COMPRESSIONS.get(said, said)
        left = self.layout.size - start
        unfinished = length == 0 and left > 0 and not records.number(fields, "size")
        if unfinished and compression == "":
            return start
        whole = left if unfinished else length
        size = min(_MOST_GAINED * left, LARGEST_CHUNK) if unfinished else records.number(fields, "size")
        head = ChunkHead(0, 0, size, 0, compression, 0, whole)
        segment = Segment(start, min(whole, left), head.size, head, cut=unfinished or whole > left)
        if segment.length:
            self.layout.segments.append(segment)
            self.begins[at] = segment
        if segment.cut:
            said = (
                "was never finished"
                if unfinished
                else f"says that it has {length} bytes, but only {left} are left in the file"
            )
            self.layout.damages.append(Damage(at, self.layout.size, f"a chunk {said}"))
            return self.layout.size
        return start + length

    def loose(self, fields: Fields, at: int, end: int) -> None:
        """Take in a message outside of chunks."""
        last = self.layout.segments[-1] if self.layout.segments else None
        if last is None or last.chunk is not None or last.offset + last.length != at or last.size > _RUN_BYTES:
            last = Segment(at, 0, 0, counts={})
            self.layout.segments.append(last)
        last.length = last.size = end - last.offset
        conn = records.number(fields, "conn")
        last.counts = {} if last.counts is None else last.counts
        last.counts[conn] = last.counts.get(conn, 0) + 1

    def dated(self, segment: Segment, fields: Fields) -> None:
        if segment.chunk is not None:
            start, end = records.nanoseconds(fields, "start_time"), records.nanoseconds(fields, "end_time")
            segment.chunk = replace(segment.chunk, start_time=start, end_time=end)

    def indexed_chunks(self) -> Iterator[int]:
        """Yield where chunks start by the index at the end of the file, if it is still there."""
        at = self.index_at
        while 0 < at < self.layout.size:
            try:
                fields, start, length = self.record(at)
                if records.kind_of(fields) == records.CHUNK_INFO:
                    yield records.number(fields, "chunk_pos", 8)
            except MalformedError:
                return
            at = start + length
