"""Where things lie in an MCAP file: one walk over its top-level records, without reading chunks.

The walk goes by the records themselves, so a file needs no summary and no index, and a damaged one
is mapped up to the damage and, where its index survived, beyond it.
"""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from pipeline.errors import InputError
from pipeline.ingest.mcap_log import records
from pipeline.ingest.mcap_log.records import RECORD_HEAD, Channel, ChunkHead, MalformedError, Schema

_WINDOW = 1 << 16
_RUN_BYTES = 1 << 20
# Chunks are meant to hold about 1 MB. One beyond this is not unpacked; the records of one that is not packed are walked over.
LARGEST_CHUNK = 256 << 20
# Bodies read whole at the top level (schemas, metadata, indexes); a longer one is a lie.
_LARGEST_BODY = 64 << 20
_MOST_BAD = 100
_KNOWN = range(records.HEADER, records.DATA_END + 1)
_PRIVATE = 0x80
_MESSAGE, _CHUNK = bytes((records.MESSAGE,)), bytes((records.CHUNK,))


@dataclass(slots=True)
class Segment:
    """A stretch of the file that holds messages: a chunk, or a run of messages outside chunks.

    `offset` and `length` (bytes) are where its (packed) records lie, `size` is theirs unpacked.
    `counts` gives the messages by channel, None where no index tells. `cut` marks a chunk whose end
    is missing.
    """

    offset: int
    length: int
    size: int
    chunk: ChunkHead | None = None
    counts: dict[int, int] | None = None
    cut: bool = False


@dataclass
class Damage:
    """Bytes `start` to `stop` of the file that cannot be read, and why, as part of a sentence."""

    start: int
    stop: int
    reason: str


@dataclass
class Layout:
    """What one walk over a file found.

    `data_end` is where the data section closes, None where it does not; `lists_channels` tells that the
    summary repeats all channels.
    """

    path: Path
    size: int
    profile: str = ""
    library: str = ""
    segments: list[Segment] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    attachments: int = 0
    message_counts: dict[int, int] | None = None
    lists_channels: bool = False
    data_end: int | None = None
    has_footer: bool = False
    damages: list[Damage] = field(default_factory=list)
    bad_definitions: list[str] = field(default_factory=list)

    def define(self, opcode: int, body: bytes) -> None:
        """Take in a schema or channel record; the first of an id counts."""
        try:
            if opcode == records.SCHEMA:
                schema = records.schema(body)
                self.schemas.setdefault(schema.id, schema)
            else:
                channel = records.channel(body)
                self.channels.setdefault(channel.id, channel)
        except MalformedError as error:
            self.note_bad(f"a {'schema' if opcode == records.SCHEMA else 'channel'} record is malformed: {error}")

    def note_bad(self, text: str) -> None:
        """Note a definition that cannot be used; of very many the first."""
        if len(self.bad_definitions) < _MOST_BAD and text not in self.bad_definitions:
            self.bad_definitions.append(text)


class _Window:
    """Reads bytes at any offset, a window at a time, so that a walk in steps of 40 bytes stays quick."""

    def __init__(self, file: BinaryIO) -> None:
        self.file = file
        self.start = 0
        self.bytes = b""

    def at(self, offset: int, length: int) -> bytes:
        begin = offset - self.start
        if begin < 0 or begin + length > len(self.bytes):
            self.file.seek(offset)
            self.bytes = self.file.read(max(length, _WINDOW))
            self.start, begin = offset, 0
        return self.bytes[begin : begin + length]


def survey_layout(path: Path) -> Layout:
    """Walk over the file's top-level records.

    Raises
    ------
    InputError
        If the file cannot be opened, is empty, or is no MCAP.
    """
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            _check_magic(path, file.read(len(records.MAGIC)), size)
            layout = Layout(path, size)
            _walk(layout, _Window(file))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    return layout


def _check_magic(path: Path, found: bytes, size: int) -> None:
    if size == 0:
        raise InputError(f"{path}: the file is empty (0 bytes). Record or copy it again.")
    if found == records.MAGIC:
        return
    if found[:5] == records.MAGIC[:5] and len(found) == len(records.MAGIC):
        raise InputError(f"{path}: MCAP of version {found[5:6]!r}, only version 0 is known. Convert it with 'mcap'.")
    if size < len(records.MAGIC) and records.MAGIC.startswith(found):
        raise InputError(f"{path}: the file ends after {size} bytes, within the MCAP magic. Record or copy it again.")
    raise InputError(
        f"{path}: this is no MCAP file: it begins with {found!r} where {records.MAGIC!r} was expected. "
        "If it holds another kind of log, give it that kind's suffix (.csv, .mat); else record or copy it again."
    )


def _walk(layout: Layout, window: _Window) -> None:
    at = len(records.MAGIC)
    indexed: list[int] | None = None
    while at < layout.size:
        behind = _behind_messages(layout, window, at) or _within_large_chunk(window, at)
        if behind is not None:
            at = behind
            continue
        last = layout.segments[-1] if layout.segments else None
        reason = _step_reason(layout, window, at)
        if reason is None:
            opcode, length = RECORD_HEAD.unpack(window.at(at, RECORD_HEAD.size))
            _take(layout, window, last, opcode, at, length)
            at += RECORD_HEAD.size + length
            if opcode == records.DATA_END:
                layout.data_end = at
            elif opcode == records.CHANNEL and layout.data_end is not None:
                layout.lists_channels = True
            elif opcode == records.FOOTER:
                layout.has_footer = True
                return
            continue
        cut = _cut_chunk(layout, window, at)
        if indexed is None:
            indexed = sorted(set(_indexed_chunks(layout, window)))
        place = bisect_right(indexed, at)
        resume = indexed[place] if place < len(indexed) else layout.size
        layout.damages.append(Damage(at, resume, reason))
        if cut is not None and resume == layout.size:
            layout.segments.append(cut)
        if last is not None:
            last.counts = None  # its message indexes may be what was lost
        at = resume
    if layout.segments:
        layout.segments[-1].counts = None


def _behind_messages(layout: Layout, window: _Window, at: int) -> int | None:
    """Take the messages outside chunks that follow each other from `at`; return where they end, None where none is whole."""
    if window.at(at, 1) != _MESSAGE:
        return None
    data = window.at(at, _RUN_BYTES)
    last, unpack = len(data) - RECORD_HEAD.size - 2, RECORD_HEAD.unpack_from
    segment = layout.segments[-1] if layout.segments else None
    i = 0
    while i <= last and data[i] == records.MESSAGE:
        if segment is None or not _goes_on(segment, at + i):
            segment = Segment(at + i, 0, 0, counts={})
        counts = {} if segment.counts is None else segment.counts
        begin, most = i, i + _RUN_BYTES - segment.size
        while i <= last and i < most:
            opcode, length = unpack(data, i)
            behind = i + RECORD_HEAD.size + length
            if opcode != records.MESSAGE or behind > len(data):
                break
            channel_id = data[i + RECORD_HEAD.size] | data[i + RECORD_HEAD.size + 1] << 8
            counts[channel_id] = counts.get(channel_id, 0) + 1
            i = behind
        if i == begin:
            break
        if not segment.size:
            layout.segments.append(segment)
        segment.length += i - begin
        segment.size += i - begin
    return at + i if i else None


def _goes_on(segment: Segment, at: int) -> bool:
    """Tell whether a record outside chunks at `at` belongs to this stretch."""
    return segment.chunk is None and segment.offset + segment.length == at and segment.size < _RUN_BYTES


def _within_large_chunk(window: _Window, at: int) -> int | None:
    """Return where the records of a chunk begin that is not packed and too large to be held; None for all else."""
    if window.at(at, 1) != _CHUNK:
        return None
    start = at + RECORD_HEAD.size
    try:
        head = records.chunk_head(window.at(start, 256))
    except MalformedError:
        return None
    return start + head.data_offset if head.compression == "" and head.size > LARGEST_CHUNK else None


def _step_reason(layout: Layout, window: _Window, at: int) -> str | None:
    """Return None where a whole record lies at `at`, else what is wrong there."""
    head = window.at(at, RECORD_HEAD.size)
    if len(head) < RECORD_HEAD.size:
        return "the file ends within the head of a record"
    opcode, length = RECORD_HEAD.unpack(head)
    left = layout.size - at - RECORD_HEAD.size
    if opcode not in _KNOWN and opcode < _PRIVATE:
        return f"0x{opcode:02x} stands where the kind of a record was expected"
    if length > left:
        return f"a record says that it has {length} bytes, but only {left} are left in the file"
    if length > _LARGEST_BODY and opcode in (records.SCHEMA, records.CHANNEL, records.METADATA, records.HEADER):
        return f"a record of kind 0x{opcode:02x} says that it has {length} bytes, which is beyond belief"
    return None


def _take(layout: Layout, window: _Window, last: Segment | None, opcode: int, at: int, length: int) -> None:
    start = at + RECORD_HEAD.size
    if opcode in (records.MESSAGE, records.SCHEMA, records.CHANNEL):
        if opcode != records.MESSAGE:
            layout.define(opcode, window.at(start, length))
        _add_loose(layout, last, opcode, window, at, length)
    elif opcode == records.CHUNK:
        _add_chunk(layout, window, start, length)
    elif opcode == records.ATTACHMENT:
        layout.attachments += 1
    elif opcode == records.MESSAGE_INDEX and last is not None and last.chunk is not None:
        channel_id, count = records.message_index(window.at(start, min(length, 6)) + bytes(6))
        if count:
            last.counts = {} if last.counts is None else last.counts
            last.counts[channel_id] = count
    elif opcode in (records.HEADER, records.METADATA, records.STATISTICS) and length <= _LARGEST_BODY:
        _take_said(layout, opcode, window.at(start, length), at)


def _take_said(layout: Layout, opcode: int, body: bytes, at: int) -> None:
    try:
        if opcode == records.HEADER:
            layout.profile, layout.library = records.header(body)
        elif opcode == records.METADATA:
            layout.metadata.append(records.metadata(body))
        else:
            layout.message_counts = records.message_counts(body)
    except MalformedError as error:
        layout.damages.append(Damage(at, at + RECORD_HEAD.size + len(body), str(error)))


def _add_loose(layout: Layout, last: Segment | None, opcode: int, window: _Window, at: int, length: int) -> None:
    whole = RECORD_HEAD.size + length
    if last is None or not _goes_on(last, at):
        if opcode != records.MESSAGE:
            return
        last = Segment(at, 0, 0, counts={})
        layout.segments.append(last)
    last.length += whole
    last.size += whole
    if opcode == records.MESSAGE and last.counts is not None:
        channel_id = int.from_bytes(window.at(at + RECORD_HEAD.size, 2), "little")
        last.counts[channel_id] = last.counts.get(channel_id, 0) + 1


def _add_chunk(layout: Layout, window: _Window, start: int, length: int) -> None:
    try:
        head = records.chunk_head(window.at(start, min(length, 256)))
    except MalformedError as error:
        layout.damages.append(Damage(start - RECORD_HEAD.size, start + length, f"a chunk's head is malformed: {error}"))
        return
    if head.data_offset + head.data_length > length:
        reason = f"a chunk says that it has {head.data_length} bytes of data in a record of {length} bytes"
        layout.damages.append(Damage(start - RECORD_HEAD.size, start + length, reason))
        return
    if head.data_length:
        layout.segments.append(Segment(start + head.data_offset, head.data_length, head.size, head))


def _cut_chunk(layout: Layout, window: _Window, at: int) -> Segment | None:
    """Return the front part of a chunk whose end is missing, if a chunk starts at `at`."""
    head = window.at(at, RECORD_HEAD.size)
    if len(head) < RECORD_HEAD.size or head[0] != records.CHUNK:
        return None
    start = at + RECORD_HEAD.size
    try:
        chunk = records.chunk_head(window.at(start, min(layout.size - start, 256)))
    except MalformedError:
        return None
    left = layout.size - start - chunk.data_offset
    length = min(left, chunk.data_length)
    return Segment(start + chunk.data_offset, length, chunk.size, chunk, cut=True) if length > 0 else None


def _indexed_chunks(layout: Layout, window: _Window) -> Iterator[int]:
    """Yield where chunks start by the summary at the end of the file, if it is still there."""
    tail = RECORD_HEAD.size + 20 + len(records.MAGIC)
    end = layout.size - tail
    if end <= 0 or window.at(layout.size - len(records.MAGIC), len(records.MAGIC)) != records.MAGIC:
        return
    opcode, length = RECORD_HEAD.unpack(window.at(end, RECORD_HEAD.size))
    if (opcode, length) != (records.FOOTER, 20):
        return
    at = records.summary_start(window.at(end + RECORD_HEAD.size, length))
    while 0 < at < end:
        opcode, length = RECORD_HEAD.unpack(window.at(at, RECORD_HEAD.size))
        if length > end - at:
            return
        if opcode == records.CHUNK_INDEX:
            try:
                yield records.chunk_index(window.at(at + RECORD_HEAD.size, length))[0]
            except MalformedError:
                return
        at += RECORD_HEAD.size + length
