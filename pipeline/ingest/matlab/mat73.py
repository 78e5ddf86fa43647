"""The contents of MAT files of version 7.3, which are HDF5, read with h5py.

MATLAB stores arrays column by column: what h5py gives is transposed. Structures are groups, words 16-bit letters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.ingest.ahead import refuse_fatal
from pipeline.ingest.extras import library
from pipeline.ingest.hdf5 import opened
from pipeline.ingest.matlab.values import BrokenFileError, Struct, Unread, Value
from pipeline.ingest.unpacking import is_beyond_belief

_DEEPEST = 32
_LARGEST = 4 << 30
_CLASS, _EMPTY = "MATLAB_class", "MATLAB_empty"
_ADVICE = {
    "table": "; save it as vectors, in MATLAB: s = table2struct(T, 'ToScalar', true)",
    "timetable": "; save it as vectors, in MATLAB: s = table2struct(timetable2table(TT, 'ConvertRowTimes', false), 'ToScalar', "
    "true); s.time = seconds(TT.Properties.RowTimes - TT.Properties.RowTimes(1))",
    "timeseries": "; save it as vectors, in MATLAB: s.time = ts.Time; s.data = ts.Data",
    "duration": "; save it as numbers, in MATLAB: seconds(d)",
    "datetime": "; save it as numbers, in MATLAB: posixtime(d)",
}
_NUMBERS = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}


def variables(path: Path) -> Iterator[tuple[str, Value]]:
    """Yield the variables of a file.

    Raises
    ------
    InputError
        If h5py is not installed or finds the file broken.
    BrokenFileError
        If a variable is larger than can be read, or structures lie too deep.
    """
    library("h5py", "hdf5", path, "a MATLAB 7.3 file")
    refuse_fatal(path, "MATLAB 7.3", lambda: _looked_through(path))
    with opened(path) as file:
        size, unpacked = path.stat().st_size, 0
        for name in file:
            if not name.startswith("#"):
                unpacked += _bytes_of(file[name], 0)
                if is_beyond_belief(size, unpacked):
                    raise BrokenFileError(f"it says that its {size} bytes hold {unpacked}, which is refused")
                yield name, _value(file, file[name], name, 0)


def _looked_through(path: Path) -> None:
    """Look at all that tells how a file is to be read."""
    with opened(path) as file:
        for name in file:
            _bytes_of(file[name], 0)
            _class_of(file[name])


def _bytes_of(stored: Any, depth: int) -> int:
    """Return how many bytes an array, or all those of a structure, unpack to."""
    import h5py

    if isinstance(stored, h5py.Group):
        return sum(_bytes_of(stored[name], depth + 1) for name in stored) if depth <= _DEEPEST else 0
    if not isinstance(stored, h5py.Dataset):
        return 0
    return max(math.prod(stored.chunks or (0,)), stored.size or 0) * int(stored.dtype.itemsize)


def _value(file: Any, stored: Any, name: str, depth: int) -> Value:
    import h5py

    if depth > _DEEPEST:
        raise BrokenFileError(f"structures lie more than {_DEEPEST} deep in '{name}'")
    if isinstance(stored, h5py.Group):
        kind = _class_of(stored)
        if "MATLAB_sparse" in stored.attrs:
            return Unread("a sparse matrix")
        if kind not in ("struct", ""):
            return _object(kind)
        return _struct(file, stored, name, depth)
    if not isinstance(stored, h5py.Dataset):
        return Unread("a type without values")
    kind = _class_of(stored)
    if _EMPTY in stored.attrs and int(stored.attrs[_EMPTY]):
        return "" if kind == "char" else np.empty((0, 0))
    if stored.dtype.itemsize * stored.size > _LARGEST:
        raise BrokenFileError(
            f"'{name}' takes {stored.dtype.itemsize * stored.size / 2**30:.1f} GiB, more than is read at once"
        )
    if kind == "char":
        return _text(np.asarray(stored[()]))
    if h5py.check_ref_dtype(stored.dtype) is not None:
        return Unread("a cell array" if kind == "cell" else "an array of references")
    if kind in _NUMBERS or (not kind and stored.dtype.kind in "fiub"):
        return _numbers(np.asarray(stored[()]))
    return _object(kind) if kind else Unread(f"data of type {stored.dtype}")


def _object(kind: str) -> Unread:
    """Return what is said of an object, whose layout only MATLAB knows."""
    return Unread(f"a {kind}{_ADVICE.get(kind, '')}")


def _struct(file: Any, group: Any, name: str, depth: int) -> Struct:
    """Return a structure; the members of an array of structures are references to one value each."""
    import h5py

    members = {member: group[member] for member in group}
    refers = {
        m: v
        for m, v in members.items()
        if isinstance(v, h5py.Dataset) and h5py.check_ref_dtype(v.dtype) and not _class_of(v)
    }
    if members and len(refers) == len(members) and len({v.size for v in refers.values()}) == 1:
        count = next(iter(refers.values())).size
        listed = {m: np.asarray(v[()]).reshape(-1) for m, v in refers.items()}
        elements = [
            {m: _value(file, file[listed[m][at]], f"{name}.{m}", depth + 1) for m in members} for at in range(count)
        ]
        return Struct(tuple(members), tuple(elements))
    return Struct(tuple(members), ({m: _value(file, v, f"{name}.{m}", depth + 1) for m, v in members.items()},))


def _class_of(stored: Any) -> str:
    kind = stored.attrs.get(_CLASS, b"")
    return kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)


def _text(letters: np.ndarray) -> Value:
    """Return a line of text; several lines, which are stored as columns, are joined."""
    rows = np.atleast_2d(letters.T).astype(np.uint16)
    return "\n".join(row.tobytes().decode("utf-16-le", "replace").rstrip() for row in rows)


def _numbers(values: np.ndarray) -> Value:
    if values.dtype.names is not None and {"real", "imag"} <= set(values.dtype.names):
        return np.asarray(values["real"] + 1j * values["imag"]).T
    return values.T


__all__ = ["variables"]
