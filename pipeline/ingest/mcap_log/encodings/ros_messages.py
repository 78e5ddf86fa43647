"""The bytes of ROS messages as columns: CDR of ROS 2 and the serialisation of ROS 1.

Messages of one topic mostly share one layout: strings and sequences of equal length stand at equal
places. So one message is walked through, and the numbers of all that share its layout are then
gathered at once.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.ingest.mcap_log.columns import Column, Columns, Path
from pipeline.ingest.mcap_log.encodings.ros_types import Many, Primitive, Struct, Text, Type

# Encapsulation kinds of CDR (OMG DDS-XTypes 1.3, table 60): plain CDR and plain CDR2.
_CDR, _CDR2 = (0, 1), (6, 7)
# Each field takes a byte or more, but for arrays of no elements.
_MOST_EMPTY = 5000
# Beyond so many layouts in a batch (free text), looking for others of the same costs more than it saves.
_MOST_LAYOUTS = 64


class MessageError(Exception):
    """A message whose bytes are not what its definition says; the text tells why."""


@dataclass
class _Leaf:
    """Where one field stands in a message: one (offset, count) for each time that it occurs.

    `depth` counts the lists around it; `size` and `kind` are those of one number, kind ``"S"`` a text
    of `count` bytes.
    """

    kind: str
    size: int
    depth: int
    places: list[tuple[int, int]] = field(default_factory=list)


@dataclass
class _Layout:
    """The fields of one message, and the places of the length words that other messages must share.

    `order` is the byte order, `lengths` are those of the outermost lists.
    """

    order: str
    leaves: dict[Path, _Leaf] = field(default_factory=dict)
    words: list[int] = field(default_factory=list)
    lengths: dict[Path, int] = field(default_factory=dict)

    def fits(self, messages: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Tell which messages (k, size) have the layout of the message `first` (size,)."""
        if not self.words:
            return np.ones(len(messages), dtype=bool)
        at = (np.array(self.words)[:, None] + np.arange(4)).ravel()
        return np.asarray((messages[:, at] == first[at]).all(axis=1))


class _Walk:
    """Goes through one message as its type says and notes where things stand."""

    def __init__(self, message: bytes, cdr: bool) -> None:
        self.message = message
        self.origin, self.widest, order = _encapsulation(message) if cdr else (0, 1, "<")
        self.nul = 1 if cdr else 0
        self.cdr = cdr
        self.at = self.origin
        self.layout = _Layout(order)
        self.places = 0

    def align(self, size: int) -> None:
        step = min(size, self.widest)
        self.at += -(self.at - self.origin) % step

    def take(self, size: int) -> int:
        start = self.at
        if size > len(self.message) - start:
            raise MessageError(f"it ends after {len(self.message)} bytes, where its definition asks for more")
        self.at += size
        return start

    def word(self) -> int:
        self.align(4)
        start = self.take(4)
        value = struct.unpack_from(f"{self.layout.order}I", self.message, start)[0]
        self.layout.words.append(start)
        return int(value)

    def note(self, path: Path, kind: str, size: int, depth: int, start: int, count: int) -> None:
        self.places += 1
        if self.places > len(self.message) + _MOST_EMPTY:
            raise MessageError("it holds too many fields")
        leaf = self.layout.leaves.setdefault(path, _Leaf(kind, size, depth))
        leaf.places.append((start, count))

    def go(self, kind: Type, path: Path, depth: int) -> None:
        if isinstance(kind, Primitive):
            self.align(kind.size)
            self.note(path, kind.kind, kind.size, depth, self.take(kind.size), 1)
        elif isinstance(kind, Text):
            length = self.word()
            self.note(path, "S", 1, depth, self.take(length), max(0, length - self.nul))
        elif isinstance(kind, Struct):
            if not kind.members and self.cdr:
                self.take(1)  # IDL knows no empty struct: ROS 2 puts one byte into it
            for member, of in kind.members:
                self.go(of, (*path, member), depth)
        else:
            self.go_many(kind, path, depth)

    def go_many(self, kind: Many, path: Path, depth: int) -> None:
        count = self.word() if kind.length is None else kind.length
        if depth == 0:
            self.layout.lengths[path] = count
        if isinstance(kind.of, Primitive):
            if count:
                self.align(kind.of.size)
            self.note(path, kind.of.kind, kind.of.size, depth + 1, self.take(count * kind.of.size), count)
            return
        if _is_nothing(kind.of, self.cdr):
            return
        if count > len(self.message) - self.at:
            raise MessageError(f"a list says that it has {count} elements, more than the message has bytes")
        for _ in range(count):
            self.go(kind.of, path, depth + 1)


def _is_nothing(kind: Type, cdr: bool) -> bool:
    """Tell whether a type takes no bytes, so that any number of it does not."""
    if isinstance(kind, Many):
        return kind.length == 0 or (kind.length is not None and _is_nothing(kind.of, cdr))
    return not cdr and isinstance(kind, Struct) and all(_is_nothing(of, cdr) for _, of in kind.members)


def _encapsulation(message: bytes) -> tuple[int, int, str]:
    """Return where CDR's data start, its widest alignment and its byte order."""
    if len(message) < 4:
        raise MessageError(f"it has {len(message)} bytes, CDR has at least 4")
    kind = message[1]
    if message[0] or kind not in (*_CDR, *_CDR2):
        raise MessageError(f"its CDR has the representation 0x{message[0]:02x}{kind:02x}, known are plain CDR and CDR2")
    return 4, 8 if kind in _CDR else 4, "<" if kind & 1 else ">"


class RosDecoder:
    """Decodes the messages of one type; `cdr` for ROS 2, else the serialisation of ROS 1.

    `raw` names the byte sequences (images, blobs) that were left out.
    """

    def __init__(self, root: Struct, cdr: bool) -> None:
        self.root = root
        self.cdr = cdr
        self.raw: set[Path] = set()

    def decode(
        self, payloads: Sequence[bytes], wanted: Collection[Path] | None = None
    ) -> tuple[Columns, np.ndarray | None]:
        """Return the columns of the messages and, where some are malformed, which ones are not (m,)."""
        good = np.ones(len(payloads), dtype=bool)
        by_size: dict[int, list[int]] = {}
        for i, payload in enumerate(payloads):
            by_size.setdefault(len(payload), []).append(i)
        groups: list[tuple[np.ndarray, _Layout, np.ndarray]] = []
        for size, members in by_size.items():
            left = np.array(members)
            messages = np.frombuffer(b"".join([payloads[i] for i in members]), np.uint8).reshape(len(members), size)
            while left.size:
                try:
                    layout = self._walked(payloads[int(left[0])])
                except MessageError:
                    good[left[0]] = False
                    left, messages = left[1:], messages[1:]
                    continue
                if len(groups) < _MOST_LAYOUTS:
                    same = layout.fits(messages, messages[0])
                    groups.append((left[same], layout, messages[same]))
                    left, messages = left[~same], messages[~same]
                else:
                    groups.append((left[:1], layout, messages[:1]))
                    left, messages = left[1:], messages[1:]
        columns = self._gathered(groups, len(payloads), wanted)
        if good.all():
            return columns, None
        return {path: _without(column, good) for path, column in columns.items()}, good

    def _walked(self, message: bytes) -> _Layout:
        walk = _Walk(message, self.cdr)
        walk.go(self.root, (), 0)
        return walk.layout

    def _gathered(
        self, groups: list[tuple[np.ndarray, _Layout, np.ndarray]], count: int, wanted: Collection[Path] | None
    ) -> Columns:
        paths: dict[Path, None] = {}
        pieces: dict[Path, list[tuple[np.ndarray, np.ndarray, bool]]] = {}
        for members, layout, messages in groups:
            for path, leaf in layout.leaves.items():
                if wanted is not None and path not in wanted:
                    continue
                if leaf.depth and leaf.kind == "u1" and self._is_blob(path):
                    self.raw.add(path)
                    continue
                for found, values in _values(path, leaf, layout, messages):
                    paths[found] = None
                    pieces.setdefault(found, []).append((members, values, leaf.depth > 0))
        return {path: _column(pieces[path], count) for path in paths}

    def _is_blob(self, path: Path) -> bool:
        kind: Type = self.root
        for member in path:
            while isinstance(kind, Many):
                kind = kind.of
            if not isinstance(kind, Struct):
                return False
            kind = dict(kind.members)[member]
        return isinstance(kind, Many) and kind.length is None


def _values(path: Path, leaf: _Leaf, layout: _Layout, messages: np.ndarray) -> list[tuple[Path, np.ndarray]]:
    """Return the values (k, n) of a field, n = 1 for a scalar; lists in lists become several fields."""
    if leaf.kind == "S":
        columns = [_texts(messages, start, count) for start, count in leaf.places]
        joined = np.stack(columns, axis=1) if columns else np.empty((len(messages), 0), object)
        return [(path, joined)] if leaf.depth < 2 else []
    parts = [_numbers(messages, leaf, layout.order, start, count) for start, count in leaf.places]
    if leaf.depth < 2:
        return [(path, parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1))]
    outer = layout.lengths.get(_outermost(path, layout), 0)
    values = np.concatenate(parts, axis=1)
    widths = {count for _, count in leaf.places}
    if leaf.depth > 2 or outer == 0 or values.shape[1] % outer or len(widths) != 1:
        return []
    width = values.shape[1] // outer
    return [((*path, str(j)), values[:, j::width]) for j in range(width)]


def _outermost(path: Path, layout: _Layout) -> Path:
    return next((path[:n] for n in range(len(path) + 1) if path[:n] in layout.lengths), path)


def _numbers(messages: np.ndarray, leaf: _Leaf, order: str, start: int, count: int) -> np.ndarray:
    cut = np.ascontiguousarray(messages[:, start : start + count * leaf.size])
    if count == 0:
        return np.empty((len(messages), 0))
    return cut.view(f"{order}{leaf.kind}").astype(np.float64)


def _texts(messages: np.ndarray, start: int, count: int) -> np.ndarray:
    result = np.empty(len(messages), dtype=object)
    if count == 0:
        result[:] = ""
        return result
    cut = np.ascontiguousarray(messages[:, start : start + count]).view(f"S{count}").ravel()
    different, which = np.unique(cut, return_inverse=True)
    decoded = np.array([word.decode("utf-8", "replace") for word in different.tolist()], dtype=object)
    return np.asarray(decoded[which])


def _column(pieces: list[tuple[np.ndarray, np.ndarray, bool]], count: int) -> Column:
    """Join the values of groups of messages into one column of `count` messages."""
    text = any(values.dtype == object for _, values, _ in pieces)
    if not any(is_list for _, _, is_list in pieces):
        flat = np.full(count, None if text else np.nan, dtype=object if text else np.float64)
        for members, values, _ in pieces:
            flat[members] = values[:, 0]
        return Column(flat)
    lengths = np.zeros(count, dtype=np.int64)
    for members, values, _ in pieces:
        lengths[members] = values.shape[1]
    starts = np.concatenate(([0], np.cumsum(lengths)))
    flat = np.full(int(starts[-1]), None if text else np.nan, dtype=object if text else np.float64)
    for members, values, _ in pieces:
        flat[starts[members][:, None] + np.arange(values.shape[1])] = values
    return Column(flat, lengths)


def _without(column: Column, good: np.ndarray) -> Column:
    if column.lengths is None:
        return Column(column.values[good])
    return Column(column.values[np.repeat(good, column.lengths)], column.lengths[good])
