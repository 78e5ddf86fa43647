"""The bytes of MAT files of version 5 to 7 (MATLAB: "MAT-File Format", Level 5).

Written for files that come from anywhere: every length is checked against the bytes that are there,
and no more is unpacked than `LARGEST`.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from math import prod
from typing import BinaryIO, Literal

import numpy as np

from pipeline.ingest.matlab.values import BrokenFileError, Struct, Unread, Value
from pipeline.ingest.unpacking import is_beyond_belief

HEADER = 128
LARGEST = 2 << 30

_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
_LETTERS = {1: "utf-8", 2: "utf-8", 16: "utf-8", 4: "utf-16", 17: "utf-16", 18: "utf-32"}
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _DOUBLE, _UINT64, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 6, 15, 16, 17
_LOGICAL, _COMPLEX = 0x0200, 0x0800
_CLASSES = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
_DEEPEST = 32
_MANY = 1 << 20


def variables(file: BinaryIO, size: int) -> Iterator[tuple[str, Value]]:
    """Yield the variables of a file that is open at its start and has `size` bytes.

    Raises
    ------
    BrokenFileError
        If a length, type or check sum is wrong, or the file unpacks to more than `LARGEST`.
    """
    mark = file.read(HEADER)[126:128]
    if mark not in (b"IM", b"MI"):
        raise BrokenFileError(f"{mark!r} stands at byte 126 where the byte order was expected")
    order: Literal["little", "big"] = "little" if mark == b"IM" else "big"
    unpacked = 0
    while tag := file.read(8):
        at = file.tell() - len(tag)
        if len(tag) < 8:
            raise BrokenFileError(f"the file ends at byte {size} within the head of a variable")
        kind, length = (int.from_bytes(tag[i : i + 4], order) for i in (0, 4))
        if kind not in (_MATRIX, _COMPRESSED):
            raise BrokenFileError(f"type {kind} stands at byte {at} where a variable was expected")
        if length > size - at - 8:
            raise BrokenFileError(
                f"the variable at byte {at} says that it has {length} bytes, but only {size - at - 8} are left"
            )
        data = file.read(length)
        if kind == _COMPRESSED:
            data = _inflated(data, order, at, LARGEST - unpacked)
        unpacked += len(data)
        try:
            name, value = _Element(data, order).matrix(0)
        except BrokenFileError as error:
            raise BrokenFileError(f"the variable at byte {at} is broken: {error}") from error
        if name:
            yield name, value


def _inflated(data: bytes, order: Literal["little", "big"], at: int, most: int) -> bytes:
    """Unpack one compressed variable and return what follows its tag."""
    unpack = zlib.decompressobj()
    try:
        tag = unpack.decompress(data, 8)
        kind, length = (int.from_bytes(tag[i : i + 4], order) for i in (0, 4))
        if len(tag) < 8 or kind != _MATRIX:
            raise BrokenFileError(f"the compressed variable at byte {at} holds type {kind}, no variable")
        if length > most:
            raise BrokenFileError(f"it unpacks to more than {LARGEST >> 30} GiB, which is refused")
        if is_beyond_belief(len(data), length):
            raise BrokenFileError(
                f"the variable at byte {at} says that {len(data)} bytes unpack to {length}, which is refused"
            )
        content = unpack.decompress(unpack.unconsumed_tail, length) if length else b""
        rest = unpack.decompress(unpack.unconsumed_tail, 1)
    except zlib.error as error:
        raise BrokenFileError(f"the compressed variable at byte {at} cannot be unpacked ({error})") from error
    if len(content) != length or rest or not unpack.eof:
        raise BrokenFileError(
            f"the compressed variable at byte {at} does not unpack to the {length} bytes that it says"
        )
    return content


class _Element:
    """Reads the elements in `data` one after the other."""

    def __init__(self, data: bytes | memoryview, order: Literal["little", "big"]) -> None:
        self.data = memoryview(data)
        self.order = order
        self.at = 0

    def number(self) -> int:
        if self.at + 4 > len(self.data):
            raise BrokenFileError("it ends within a tag")
        self.at += 4
        return int.from_bytes(self.data[self.at - 4 : self.at], self.order)

    def next(self) -> tuple[int, memoryview]:
        """Return type and bytes of the next element."""
        kind = self.number()
        if kind >> 16:  # four bytes or less stand within the tag
            kind, length, step = kind & 0xFFFF, kind >> 16, 4
            if length > 4:
                raise BrokenFileError(f"a small element says that it has {length} bytes, 4 at most are possible")
        else:
            length = self.number()
            step = length + (-length) % 8
        start = self.at
        if length > len(self.data) - start:
            raise BrokenFileError(f"an element says that it has {length} bytes, {len(self.data) - start} are left")
        self.at = min(start + step, len(self.data))
        return kind, self.data[start : start + length]

    def integers(self) -> list[int]:
        kind, data = self.next()
        if kind not in (_INT32, _UINT32) or len(data) % 4:
            raise BrokenFileError(f"type {kind} stands where whole numbers were expected")
        return [int(n) for n in np.frombuffer(data, f"{'<' if self.order == 'little' else '>'}{_NUMBERS[kind]}")]

    def name(self) -> str:
        kind, data = self.next()
        if kind not in _LETTERS:
            raise BrokenFileError(f"type {kind} stands where a name was expected")
        return bytes(data).split(b"\0")[0].decode("utf-8", "replace")

    def numbers(self, count: int) -> np.ndarray:
        """Return `count` numbers, in the type that they are stored in."""
        kind, data = self.next()
        if kind not in _NUMBERS:
            raise BrokenFileError(f"type {kind} stands where numbers were expected")
        found = np.frombuffer(
            data, f"{'<' if self.order == 'little' else '>'}{_NUMBERS[kind]}", len(data) // _size(kind)
        )
        if found.size != count:
            raise BrokenFileError(f"{found.size} numbers stand where {count} were expected")
        return found

    def matrix(self, depth: int) -> tuple[str, Value]:
        """Read the content of a matrix element: name and value."""
        if depth > _DEEPEST:
            raise BrokenFileError("structs stand within structs without end")
        flags = self.integers()
        if not flags:
            raise BrokenFileError("it lacks its flags")
        kind = flags[0] & 0xFF
        if kind in (_FUNCTION, _OPAQUE):
            return self.name() if kind == _OPAQUE else self.shape_and_name()[1], Unread(_UNREAD[kind])
        shape, name = self.shape_and_name()
        if any(n < 0 for n in shape) or len(shape) < 2:
            raise BrokenFileError(f"'{name}' has the dimensions {shape}")
        if kind in _UNREAD:
            return name, Unread(_UNREAD[kind])
        if kind == _CHAR:
            return name, self.letters(shape)
        if kind == _STRUCT:
            return name, self.struct(prod(shape), depth)
        if not _DOUBLE <= kind <= _UINT64:
            raise BrokenFileError(f"'{name}' is of class {kind}, which does not exist")
        values = self.numbers(prod(shape))
        if values.size < _MANY or flags[0] & _LOGICAL:  # MATLAB packs whole numbers into bytes; many of them stay so
            values = values.astype("?" if flags[0] & _LOGICAL else _CLASSES[kind - _DOUBLE], copy=False)
        if flags[0] & _COMPLEX:
            values = values + 1j * self.numbers(prod(shape))
        return name, values.reshape(shape, order="F")

    def shape_and_name(self) -> tuple[list[int], str]:
        shape = self.integers()
        return shape, self.name()

    def letters(self, shape: list[int]) -> Value:
        kind, data = self.next()
        if kind not in _LETTERS:
            raise BrokenFileError(f"type {kind} stands where letters were expected")
        if prod(shape) and min(shape[:2]) != 1:
            return Unread("a table of letters")
        endian = ("-le" if self.order == "little" else "-be") if _LETTERS[kind] != "utf-8" else ""
        return bytes(data).decode(_LETTERS[kind] + endian, "replace")

    def struct(self, count: int, depth: int) -> Struct:
        width = self.integers()
        _, packed = self.next()
        if len(width) != 1 or width[0] < 1:
            raise BrokenFileError("a struct does not say how long its field names are")
        raw = bytes(packed)
        names = tuple(
            raw[i : i + width[0]].split(b"\0")[0].decode("utf-8", "replace") for i in range(0, len(raw), width[0])
        )
        if count * len(names) * 8 > len(self.data) - self.at:
            raise BrokenFileError(f"a struct says that it has {count} elements, more than there are bytes for")
        elements = []
        for _ in range(count if names else 0):
            members: dict[str, Value] = {}
            for member in names:
                kind, data = self.next()
                if kind != _MATRIX:
                    raise BrokenFileError(f"type {kind} stands where the field '{member}' was expected")
                members[member] = _Element(data, self.order).matrix(depth + 1)[1] if len(data) else np.empty((0, 0))
            elements.append(members)
        return Struct(names, tuple(elements))


def _size(kind: int) -> int:
    return np.dtype(_NUMBERS[kind]).itemsize


_UNREAD = {
    _CELL: "a cell array",
    _OBJECT: "an object of a MATLAB class",
    _SPARSE: "a sparse matrix",
    _FUNCTION: "a function",
    _OPAQUE: "an object of a MATLAB class; save timeseries, tables and strings as structs, vectors and char",
}
