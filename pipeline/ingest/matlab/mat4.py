"""The bytes of MAT files of version 4: a list of matrices, without any mark at the front."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from pipeline.ingest.matlab.values import BrokenFileError, Unread, Value

_HEAD = 20
_KINDS = ("f8", "f4", "i4", "i2", "u2", "u1")
_NUMERIC, _TEXT = 0, 1
_LONGEST_NAME = 256


def is_mat4(head: bytes) -> bool:
    """Tell whether `head` can be the first matrix of such a file."""
    return len(head) >= _HEAD and _order(head) is not None


def _order(head: bytes) -> str | None:
    """Return the byte order in which the numbers of a matrix's head make sense, None for none."""
    for order, digit in (("<", 0), (">", 1)):
        kind, rows, columns, imaginary, name_length = struct.unpack_from(f"{order}5i", head)
        machine, reserved, number, matrix = kind // 1000, kind // 100 % 10, kind // 10 % 10, kind % 10
        sensible = machine == digit and reserved == 0 and number < len(_KINDS) and matrix <= 2
        if sensible and rows >= 0 and columns >= 0 and imaginary in (0, 1) and 1 < name_length <= _LONGEST_NAME:
            return order
    return None


def variables(file: BinaryIO, size: int) -> Iterator[tuple[str, Value]]:
    """Yield the variables of a file that is open at its start and has `size` bytes.

    Raises
    ------
    BrokenFileError
        If a matrix's head makes no sense or its data are longer than the file.
    """
    while head := file.read(_HEAD):
        at = file.tell() - len(head)
        order = _order(head) if len(head) == _HEAD else None
        if order is None:
            raise BrokenFileError(f"no matrix starts at byte {at} of {size}")
        code, rows, columns, imaginary, name_length = struct.unpack(f"{order}5i", head)
        kind = np.dtype(order + _KINDS[code // 10 % 10])
        count = rows * columns
        length = count * kind.itemsize * (1 + imaginary)
        if name_length + length > size - at - _HEAD:
            raise BrokenFileError(f"the matrix at byte {at} says that it has {length} bytes, more than are left")
        name = file.read(name_length).split(b"\0")[0].decode("latin-1")
        values = np.frombuffer(file.read(length), kind)
        if code % 10 == _TEXT and rows == 1:
            yield name, "".join(chr(int(letter)) for letter in values[:count] if 0 <= letter < 0xD800)
        elif code % 10 != _NUMERIC:
            yield name, Unread("a table of letters" if code % 10 == _TEXT else "a sparse matrix")
        else:
            whole = values[:count] + 1j * values[count:] if imaginary else values
            yield name, whole.reshape((rows, columns), order="F")
