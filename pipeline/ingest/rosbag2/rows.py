"""The messages of a ROS 2 bag in SQLite: rows of its table, by ranges of their numbers.

The file is only read; nothing is written beside it, unless a recorder that was not closed left rows in its ``-wal`` file.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, suppress
from pathlib import Path
from urllib.parse import quote

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.mcap_log.batches import Batch, Messages
from pipeline.ingest.mcap_log.layout import LARGEST_CHUNK, Layout, Segment

# Rows are surveyed in ranges of about so many bytes; those with larger messages are halved.
_RANGE_BYTES = 1 << 17
_LARGEST_RANGE = 1 << 22
_MOST_ROWS = 1 << 14
_ZSTD = b"\x28\xb5\x2f\xfd"
_SOUND = "typeof(data) = 'blob' AND typeof(timestamp) = 'integer' AND timestamp >= 0 AND typeof(topic_id) = 'integer'"


def connected(path: Path) -> sqlite3.Connection:
    """Open a bag for reading, also one that was cut off."""
    how = "mode=ro" if has_waiting(path) else "immutable=1"
    base = sqlite3.connect(f"file:{quote(str(path.resolve()))}?{how}", uri=True)
    base.text_factory = lambda text: text.decode("utf-8", "replace")
    base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_CHUNK)
    base.execute("PRAGMA trusted_schema = OFF")
    base.execute("PRAGMA writable_schema = ON")  # else SQLite refuses a file that is shorter than it was
    return base


def has_waiting(path: Path) -> int:
    """Return how many bytes a recorder that was not closed left beside its bag."""
    beside = path.with_name(f"{path.name}-wal")
    return beside.stat().st_size if beside.is_file() else 0


def broken(path: Path, error: sqlite3.Error) -> InputError:
    """Return what is said of a bag that SQLite stumbles over."""
    return InputError(
        f"{path}: this ROS 2 bag (SQLite) is broken or was cut off ({error}). Copy it again, with its -wal file if there is "
        f"one beside it; or save what is left with: sqlite3 {path.name} .recover"
    )


def survey_rows(layout: Layout, base: sqlite3.Connection) -> list[tuple[int, int]]:
    """Note in the layout which ranges of rows hold how many messages of which topics; return those that are unreadable.

    A range is its first row and the one behind its last.
    """
    layout.has_footer = True
    bounds = _first_and_last(base)
    if bounds is None:
        return []
    first, last, whole = bounds
    lost = [] if whole else [(last + 1, last + 1)]
    per_range = max(1, _RANGE_BYTES * (last + 1 - first) // layout.size)
    for start in range(first, last + 1, per_range):
        for segment in _ranges(base, start, min(start + per_range, last + 1)):
            if segment.counts is None:
                lost.append((segment.offset, segment.offset + segment.length))
            elif segment.counts:
                layout.segments.append(segment)
    if lost and not layout.segments:
        raise sqlite3.DatabaseError("none of its messages can be read")
    return _joined(sorted(lost))


def _first_and_last(base: sqlite3.Connection) -> tuple[int, int, bool] | None:
    """Return the numbers of the first and last row, and whether the last one is the last that was written."""
    with suppress(sqlite3.DatabaseError):
        first, last = base.execute("SELECT min(id), max(id) FROM messages").fetchone()
        return None if first is None else (int(first), int(last), True)
    first = last = None
    try:
        for (row,) in base.execute("SELECT id FROM messages NOT INDEXED"):
            first, last = row if first is None else first, row
    except sqlite3.DatabaseError:
        if first is None or last is None:
            raise
    return None if first is None or last is None else (int(first), int(last), False)


def _ranges(base: sqlite3.Connection, start: int, stop: int) -> Iterator[Segment]:
    """Yield a range of rows with its messages by topic, in pieces where they are large; without counts if unreadable."""
    counts: dict[int, int] = {}
    size = 0
    try:
        found = base.execute(
            "SELECT topic_id, count(*), sum(length(data)) FROM messages NOT INDEXED "
            f"WHERE id >= ? AND id < ? AND {_SOUND} GROUP BY topic_id",
            (start, stop),
        )
        for topic, count, length in found:
            counts[int(topic)] = int(count)
            size += int(length)
    except sqlite3.DatabaseError:
        yield Segment(start, stop - start, 0)
        return
    if stop - start > 1 and (size > _LARGEST_RANGE or sum(counts.values()) > _MOST_ROWS):
        middle = (start + stop) // 2
        yield from _ranges(base, start, middle)
        yield from _ranges(base, middle, stop)
    else:
        yield Segment(start, stop - start, size, counts=counts)


def _joined(ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    joined: list[tuple[int, int]] = []
    for start, stop in ranges:
        if joined and joined[-1][1] >= start:
            joined[-1] = (joined[-1][0], max(stop, joined[-1][1]))
        else:
            joined.append((start, stop))
    return joined


class RowMessages(Messages):
    """The messages of a bag, some ranges of rows at a time; those of other topics than asked for are not read."""

    def _read(self, portion: int, ids: Collection[int] | None) -> Batch:
        of_topics = "" if ids is None else f"AND topic_id IN ({', '.join(str(int(i)) for i in ids)})"
        rows: list[tuple[int, int, bytes]] = []
        try:
            with closing(connected(self.layout.path)) as base:
                for segment in self.portions[portion]:
                    rows += base.execute(
                        "SELECT topic_id, timestamp, data FROM messages NOT INDEXED "
                        f"WHERE id >= ? AND id < ? AND {_SOUND} {of_topics} ORDER BY id",
                        (segment.offset, segment.offset + segment.length),
                    ).fetchall()
        except sqlite3.Error as error:
            raise broken(self.layout.path, error) from error
        payloads = [_unpacked(data) for _, _, data in rows]
        ends = np.cumsum([len(payload) for payload in payloads], dtype=np.int64)
        times = np.array([time for _, time, _ in rows], dtype=np.uint64)
        topics = np.array([topic for topic, _, _ in rows], dtype=np.int64)
        starts = np.append(0, ends[:-1]) if ends.size else ends
        return Batch(b"".join(payloads), starts, ends, topics, times, times)


def _unpacked(message: bytes) -> bytes:
    """Return a message, unpacked where the recorder packed each by itself; CDR never begins with zstd's mark."""
    if not message.startswith(_ZSTD):
        return message
    import zstandard

    with suppress(zstandard.ZstdError):
        if 0 <= zstandard.frame_content_size(message) <= LARGEST_CHUNK:
            return zstandard.ZstdDecompressor().decompress(message)
    return message
