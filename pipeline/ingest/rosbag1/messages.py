"""The messages of a ROS 1 bag: records of unpacked chunks, found and told apart."""

from __future__ import annotations

from array import array

import numpy as np

from pipeline.ingest.mcap_log.batches import Batch, Messages
from pipeline.ingest.mcap_log.layout import Segment
from pipeline.ingest.mcap_log.records import MalformedError
from pipeline.ingest.rosbag1 import records


class BagMessages(Messages):
    """The messages of a bag, some chunks at a time."""

    def _indexed(self, parts: list[tuple[Segment, bytes]]) -> Batch:
        """Walk over the records of the segments and list the messages."""
        data = parts[0][1] if len(parts) == 1 else b"".join([content for _, content in parts])
        length_at = records.LENGTH.unpack_from
        heads, starts = array("q"), array("q")
        begin = 0
        for segment, content in parts:
            at, end = begin, begin + len(content)
            while at + 8 <= end:
                start = at + 8 + length_at(data, at)[0]
                if start > end:
                    break
                following = start + length_at(data, start - 4)[0]
                if following > end:
                    break
                heads.append(at + 4)
                starts.append(start)
                at = following
            if at != end and not segment.cut:
                self._lose(segment, "its content ends within a record", left_out=False)
            begin = end
        return self._batch(data, np.array(heads, dtype=np.int64), np.array(starts, dtype=np.int64))

    def _batch(self, data: bytes, heads: np.ndarray, starts: np.ndarray) -> Batch:
        """Return the messages among records whose heads and data start there.

        Heads of messages mostly look alike: where the fields stand is found once for all that do.
        """
        numbers = np.frombuffer(data, np.uint8)
        found = np.zeros(heads.size, dtype=bool)
        channels, times = np.zeros(heads.size, dtype=np.uint32), np.zeros(heads.size, dtype=np.uint64)
        lengths = starts - 4 - heads
        ends = starts + _words(numbers, starts - 4)
        left = np.arange(heads.size)
        while left.size:
            first = int(left[0])
            like = _Alike(data[heads[first] : heads[first] + lengths[first]])
            same = left[lengths[left] == lengths[first]] if like.is_message else left[:1]
            if like.is_message:
                same = same[like.fits(numbers, heads[same])]
                channels[same] = _words(numbers, heads[same] + like.conn)
                seconds, rest = (_words(numbers, heads[same] + like.time + k).astype(np.uint64) for k in (0, 4))
                times[same] = seconds * np.uint64(10**9) + rest
                found[same] = True
            elif like.fields.get("op") == bytes([records.CONNECTION]):
                records.define(self.layout, like.fields, data[starts[first] : ends[first]])
            left = np.setdiff1d(left, same, assume_unique=True) if same.size < left.size else left[:0]
        return Batch(data, starts[found], ends[found], channels[found], times[found], times[found])


class _Alike:
    """Where the fields stand in the head of a record, and which bytes others must share to be like it."""

    def __init__(self, head: bytes) -> None:
        self.head = head
        try:
            self.fields = records.fields_of(head)
        except MalformedError:
            self.fields = {}
        shared = np.ones(len(head), dtype=bool)
        places = {}
        for name, length in (("conn", 4), ("time", 8)):
            place = head.find(f"{name}=".encode())
            if place >= 0 and len(self.fields.get(name, b"")) == length:
                places[name] = place + len(name) + 1
                shared[places[name] : places[name] + length] = False
        self.is_message = self.fields.get("op") == bytes([records.MESSAGE]) and len(places) == 2
        self.conn, self.time = places.get("conn", 0), places.get("time", 0)
        self.shared = np.flatnonzero(shared)

    def fits(self, numbers: np.ndarray, heads: np.ndarray) -> np.ndarray:
        """Tell which heads, of the same length, have the same fields at the same places."""
        first = np.frombuffer(self.head, np.uint8)[self.shared]
        return np.asarray((numbers[heads[:, None] + self.shared] == first).all(axis=1))


def _words(numbers: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the numbers of four bytes that stand at `at`, shape (n,)."""
    cut: np.ndarray = numbers[at[:, None] + np.arange(4)]
    return np.ascontiguousarray(cut).view("<u4").ravel().astype(np.int64)
