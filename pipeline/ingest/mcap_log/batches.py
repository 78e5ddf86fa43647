"""Messages by the megabyte: unpacks chunks, bounded, and finds the messages in them.

Knows compression, check sums and record heads; not what a message says.
"""

from __future__ import annotations

import zlib
from array import array
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.mcap_log import records
from pipeline.ingest.mcap_log.layout import LARGEST_CHUNK, Layout, Segment
from pipeline.ingest.mcap_log.records import MESSAGE_HEAD, RECORD_HEAD

COMPRESSIONS = ("zstd", "lz4", "bz2", "")
# A chunk that unpacks to more times its length is a mistake or an attack.
LARGEST_RATIO = 1000
_HARMLESS = 16 << 20
_ZEROS_OF_A_POWER_CUT = 512
# Plain numbers: this loop sees every message.
_MESSAGE, _DEFINITIONS = records.MESSAGE, (records.SCHEMA, records.CHANNEL)
# Small chunks are taken together up to this; it fits the processor's cache.
_PORTION_BYTES = 1 << 20
# Files up to this size stay unpacked in memory, for the topics to share.
_KEPT_BYTES = 64 << 20


class ChunkError(Exception):
    """A chunk that cannot be used; the text tells why, as part of a sentence."""


@dataclass(frozen=True)
class Batch:
    """Messages that were read together, in file order.

    `starts` and `ends` (m,) bound the payloads in `data`; `channels` (m,) are ids; `log_times` and
    `publish_times` (m,) are ns, unsigned.
    """

    data: bytes
    starts: np.ndarray
    ends: np.ndarray
    channels: np.ndarray
    log_times: np.ndarray
    publish_times: np.ndarray

    def of(self, ids: Sequence[int]) -> np.ndarray:
        """Return the positions of the messages of these channels, shape (k,)."""
        if len(ids) == 1:
            return np.flatnonzero(self.channels == ids[0])
        return np.flatnonzero(np.isin(self.channels, ids))

    def parted(self, positions: np.ndarray, most: int) -> Iterator[np.ndarray]:
        """Yield positions (k,) in parts whose payloads have about `most` bytes, at least one message each."""
        filled = np.cumsum(self.ends[positions] - self.starts[positions])
        last = int(filled[-1]) if filled.size else 0
        for part in np.split(positions, np.unique(np.searchsorted(filled, np.arange(most, last, most)))):
            if part.size:
                yield part

    def payloads(self, positions: np.ndarray) -> list[bytes]:
        """Return the payloads of the messages at `positions`."""
        data = self.data
        bounds = zip(self.starts[positions].tolist(), self.ends[positions].tolist(), strict=True)
        return [data[start:end] for start, end in bounds]


@dataclass(frozen=True)
class Loss:
    """A chunk (`offset` in the file, times in ns) of which something could not be used.

    `left_out`: nothing of it was used.
    """

    offset: int
    start_time: int
    end_time: int
    reason: str
    left_out: bool


class Messages:
    """The messages of a file, a portion (some segments) at a time."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.losses: dict[int, Loss] = {}
        self.salvaged: dict[int, int] = {}
        self.portions = _portions(layout.segments)
        self._keep = sum(segment.size for segment in layout.segments) <= _KEPT_BYTES
        self._kept: dict[int, Batch] = {}

    @property
    def size(self) -> int:
        """Bytes of all records, unpacked, as the file declares them."""
        return sum(segment.size for segment in self.layout.segments)

    def may_hold(self, portion: int, ids: Iterable[int]) -> bool:
        """Tell whether a portion may hold messages of these channels."""
        segments = self.portions[portion]
        return any(segment.counts is None or any(i in segment.counts for i in ids) for segment in segments)

    def batch(self, portion: int, ids: Collection[int] | None = None) -> Batch:
        """Return one portion; what cannot be used is left out and told in `losses`.

        Parameters
        ----------
        portion
            Its place in `portions`.
        ids
            The channels that are asked for; others may be left out where that saves reading.

        Raises
        ------
        InputError
            If the file can no longer be read.
        """
        if portion in self._kept:
            return self._kept[portion]
        batch = self._read(portion, None if self._keep else ids)
        if self._keep:
            self._kept[portion] = batch
        return batch

    def _read(self, portion: int, ids: Collection[int] | None) -> Batch:  # noqa: ARG002  a chunk is unpacked as a whole
        parts = []
        try:
            with self.layout.path.open("rb") as file:
                for segment in self.portions[portion]:
                    file.seek(segment.offset)
                    try:
                        _refuse_if_large(segment)
                        parts.append(self._unpacked(segment, file.read(segment.length)))
                    except ChunkError as error:
                        self._lose(segment, str(error), left_out=True)
        except OSError as error:
            raise InputError(f"{self.layout.path}: cannot be read on ({error.strerror}).") from error
        return self._indexed(parts)

    def _unpacked(self, segment: Segment, data: bytes) -> tuple[Segment, bytes]:
        """Unpack a segment; of one that a power cut filled up with zeros, the part before them."""
        try:
            content = unpacked(segment, data)
        except ChunkError:
            written = data.rstrip(b"\0")
            if segment.cut or len(data) - len(written) < _ZEROS_OF_A_POWER_CUT:
                raise
            segment = replace(segment, cut=True)
            content = unpacked(segment, written)
            zeros = (
                f"the last {len(data) - len(written)} of its {len(data)} bytes are zeros, as a power cut leaves them"
            )
            self._lose(segment, f"{zeros}; {len(content)} of {segment.size} bytes could be unpacked", left_out=False)
        if segment.cut:
            self.salvaged[segment.offset] = len(content)
        return segment, content

    def _lose(self, segment: Segment, reason: str, left_out: bool) -> None:
        start, end = (segment.chunk.start_time, segment.chunk.end_time) if segment.chunk is not None else (0, 0)
        self.losses[segment.offset] = Loss(segment.offset, start, end, reason, left_out)

    def _indexed(self, parts: list[tuple[Segment, bytes]]) -> Batch:
        """Walk over the records of the segments and list the messages."""
        data = parts[0][1] if len(parts) == 1 else b"".join([content for _, content in parts])
        unpack = RECORD_HEAD.unpack_from
        starts, lengths = array("q"), array("q")  # a chunk of nothing but heads holds millions
        add_start, add_length = starts.append, lengths.append
        begin = 0
        for segment, content in parts:
            at, end = begin, begin + len(content)
            last = end - RECORD_HEAD.size
            while at <= last:
                opcode, length = unpack(data, at)
                if opcode == _MESSAGE:
                    add_start(at)
                    add_length(length)
                elif opcode in _DEFINITIONS:
                    self.layout.define(opcode, data[at + RECORD_HEAD.size : min(at + RECORD_HEAD.size + length, end)])
                elif not opcode:  # no record: zeros would be walked over nine by nine
                    break
                at += RECORD_HEAD.size + length
            if starts and starts[-1] + RECORD_HEAD.size + lengths[-1] > end:
                starts.pop()
                lengths.pop()
            if at != end and not segment.cut:
                self._lose(segment, "its content ends within a record", left_out=False)
            begin = end
        return _batch(data, np.array(starts, dtype=np.int64), np.array(lengths, dtype=np.int64))


def _batch(data: bytes, starts: np.ndarray, lengths: np.ndarray) -> Batch:
    whole = lengths >= MESSAGE_HEAD
    if not whole.all():
        starts, lengths = starts[whole], lengths[whole]
    body = starts + RECORD_HEAD.size

    def field_at(offset: int, kind: str, size: int) -> np.ndarray:
        if not starts.size:
            return np.empty(0, kind)
        # A view on numbers that start at every byte.
        overlapping: np.ndarray = np.ndarray((len(data) - size + 1,), kind, data, 0, (1,))
        return np.asarray(overlapping[body + offset])

    return Batch(
        data,
        body + MESSAGE_HEAD,
        body + lengths,
        field_at(0, "<u2", 2),
        field_at(6, "<u8", 8),
        field_at(14, "<u8", 8),
    )


def _portions(segments: Sequence[Segment]) -> list[list[Segment]]:
    portions: list[list[Segment]] = []
    filled = 0
    for segment in segments:
        if not portions or filled + segment.size > _PORTION_BYTES:
            portions.append([])
            filled = 0
        portions[-1].append(segment)
        filled += segment.size
    return portions


def _refuse_if_large(segment: Segment) -> None:
    """Raise ChunkError for a chunk that would not fit into memory."""
    if segment.chunk is not None and max(segment.chunk.size, segment.length) > LARGEST_CHUNK:
        raise ChunkError(
            f"it says that it unpacks to {segment.chunk.size} bytes; more than {LARGEST_CHUNK} are refused. Write the log anew "
            "with chunks of a few MB, as 'mcap compress' does"
        )


def unpacked(segment: Segment, data: bytes) -> bytes:
    """Return the records of a segment, of a cut chunk as many bytes as can be had.

    Raises
    ------
    ChunkError
        If the chunk is packed in an unknown way, unpacks to too much, is damaged, or fails its check sum.
    """
    chunk = segment.chunk
    if chunk is None:
        return data
    if chunk.compression not in COMPRESSIONS:
        known = ", ".join(name or "none" for name in COMPRESSIONS)
        raise ChunkError(f"it is compressed with '{chunk.compression}'; known are {known}")
    if chunk.size > _HARMLESS and chunk.size > LARGEST_RATIO * len(data):
        raise ChunkError(
            f"it says that {len(data)} bytes unpack to {chunk.size}, more than {LARGEST_RATIO} times as many; "
            "that is refused"
        )
    content = data if chunk.compression == "" else _unpack(chunk.compression, data, chunk.size, segment.cut)
    if segment.cut and not content:
        raise ChunkError(
            f"none of its {chunk.size} bytes can be had: it is packed ({chunk.compression or 'not compressed'}) in blocks "
            f"that unpack as a whole or not at all, and the first one lies across the cut; {len(data)} of the chunk's "
            f"{chunk.data_length} bytes are there"
        )
    if segment.cut:
        return content[: chunk.size]
    if len(content) != chunk.size:
        more = "more" if len(content) > chunk.size else f"{len(content)}"
        raise ChunkError(f"it says that it unpacks to {chunk.size} bytes, but {more} came out")
    if chunk.crc and zlib.crc32(content) != chunk.crc:
        raise ChunkError("its check sum (CRC) is wrong")
    return content


def _unpack(compression: str, data: bytes, size: int, cut: bool) -> bytes:
    """Unpack at most ``size + 1`` bytes."""
    if compression == "zstd":
        return _unpack_zstd(data, size, cut)
    if compression == "bz2":
        return _unpack_bz2(data, size)
    import lz4.frame

    try:
        content: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    except (RuntimeError, EOFError, ValueError) as error:
        raise ChunkError(f"its lz4 data are damaged ({error})") from error
    return content


def _unpack_bz2(data: bytes, size: int) -> bytes:
    import bz2

    try:
        return bz2.BZ2Decompressor().decompress(data, max_length=size + 1)
    except (OSError, EOFError, ValueError) as error:
        raise ChunkError(f"its bz2 data are damaged ({error})") from error


def _unpack_zstd(data: bytes, size: int, cut: bool) -> bytes:
    import zstandard

    source = zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True)
    if not cut:
        try:
            return source.read(size + 1)
        except (zstandard.ZstdError, MemoryError) as error:
            raise ChunkError(f"its zstd data are damaged ({error})") from error
    content = bytearray()
    with suppress(zstandard.ZstdError):  # the blocks before the one that is not whole are kept
        while len(content) <= size and (piece := source.read1(1 << 16)):
            content += piece
    return bytes(content)
