"""The reader of MATLAB files up to version 7 (MAT v5, v4): vectors are channels, scalars conditions.

Vectors of one length share a table, with the time vector of that length; structs give dotted names.
Files of version 7.3 are HDF5 and are refused. The file gives no units. It is read whole, as MATLAB does.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.ingest.reader import BLOCK_ROWS, RawChannel, RawLog, RawTable, Reader
from pipeline.recording import QualityFinding

_HDF5 = b"\x89HDF\r\n\x1a\n"
_HEADER = 128
_COMPRESSED = 15
# Deflate packs at most 1032 to 1, so a smaller file than this limit / 1032 cannot burst memory.
_LARGEST = 2 << 30
_LARGEST_RATIO = 1032
_MOST_COLUMNS = 64
_MOST_ELEMENTS = 64
# Shorter vectors beside longer ones are parameters, not signals.
_SHORTEST_SIGNAL = 8
_DEEPEST = 16
_TIMES = re.compile(
    r"^(t|time|times|tout|tsim|t_?(s|sec|ms)|time_?(s|sec|ms|stamp|vector)|timestamps?|zeit|temps|tiempo)$"
)
_STEPS = {"ts", "dt", "t_s", "deltat", "sampletime", "tsample"}
_RATES = {"fs", "f_s", "samplerate", "fsample", "samplingrate", "samplingfrequency"}


@dataclass
class _Contents:
    """What the variables of a file come to: vectors by dotted name, scalars and words, what was left out."""

    vectors: dict[str, np.ndarray] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


class MatlabTable(RawTable):
    """Vectors of one length; `columns` keep the numbers as the file has them."""

    def __init__(self, name: str, columns: Mapping[str, np.ndarray], time: str | None, step: float | None) -> None:
        self.name = name
        self._columns = dict(columns)
        self.channels = [RawChannel(column) for column in columns]
        self.time_channel = time
        self._step = step
        if step is not None:
            self.time_channel = "time" if "time" not in columns else "row_time"
            self.channels.insert(0, RawChannel(self.time_channel, "s"))
            self._columns[self.time_channel] = np.arange(next(iter(columns.values())).size) * step

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
        """Yield the rows; see `RawTable.blocks`."""
        wanted = [channel.name for channel in self.channels if names is None or channel.name in names]
        rows = next(iter(self._columns.values())).size
        for start in range(0, rows if wanted else 0, BLOCK_ROWS):
            cut = slice(start, start + BLOCK_ROWS)
            yield {name: self._columns[name][cut].astype(np.float64) for name in wanted}

    def notes(self) -> Sequence[QualityFinding]:
        """Return what was noticed; see `RawTable.notes`."""
        if self._step is None:
            return ()
        text = f"no vector tells the time; '{self.time_channel}' counts the rows in steps of {self._step:.9g} s."
        return [QualityFinding("note", text)]


class MatlabReader(Reader):
    """Reads MAT files of version 4 to 7."""

    name = "matlab"
    version = 1
    suffixes = (".mat",)

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by the text header; a file named .mat is taken too, to say what is wrong with it."""
        return head.startswith(b"MATLAB ") or suffix in self.suffixes

    def open(self, path: Path) -> RawLog:
        """Load the file and sort its variables into tables and metadata.

        Raises
        ------
        InputError
            If it is empty, broken, of version 7.3, no MAT file, or holds no vector of numbers.
        """
        try:
            head = _checked_head(path)
            _check_unpacked_size(path)
            variables = _load(path)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error}).") from error
        contents = _Contents()
        for name, value in variables.items():
            _sort(contents, name, value, 0)
        tables = _tables(contents)
        if not tables:
            found = listing([*contents.metadata, *contents.left_out]) if variables else "nothing"
            raise InputError(f"{path}: this MAT file holds no vector of numbers to read as a channel; it has {found}.")
        notes = [QualityFinding("note", text) for text in contents.notes]
        notes += [QualityFinding("note", f"a variable was left out: {text}.") for text in contents.left_out]
        details = {"version": "5" if head.startswith(b"MATLAB 5") else "4", "variables": listing(variables)}
        if head.startswith(b"MATLAB "):
            details["header"] = head[:116].decode("latin-1").strip(" \0")
        return RawLog(path, "MATLAB", tables, contents.metadata, details, tuple(notes))


def _checked_head(path: Path) -> bytes:
    with path.open("rb") as file:
        head = file.read(_HEADER + 512 + len(_HDF5))
    if not head:
        raise InputError(f"{path}: the file is empty (0 bytes). Save it again.")
    if head.startswith((b"MATLAB 7.3", _HDF5)) or _HDF5 in (head[512 : 512 + len(_HDF5)],):
        raise InputError(
            f"{path}: this is a MAT file of version 7.3 (HDF5). Reading those takes the optional extra 'hdf5' "
            "(h5py), which this version of rigfit does not have yet. Load the file in MATLAB and save it with "
            f"save('{path.name}', '-v7')."
        )
    if head.startswith((b"# Created by Octave", b"Octave-1")):
        raise InputError(f"{path}: this is a file in Octave's own format. Save it in Octave with: save -v7 {path.name}")
    return head


def _check_unpacked_size(path: Path) -> None:
    """Refuse a file that unpacks to more than fits in memory, without keeping what comes out."""
    if path.stat().st_size * _LARGEST_RATIO <= _LARGEST:
        return
    total = 0
    with path.open("rb") as file:
        header = file.read(_HEADER)
        if not header.startswith(b"MATLAB 5"):
            return
        order = "big" if header[126:128] == b"MI" else "little"
        while len(tag := file.read(8)) == 8:
            kind = int.from_bytes(tag[:4], order)  # type: ignore[arg-type]
            length = int.from_bytes(tag[4:], order)  # type: ignore[arg-type]
            if kind != _COMPRESSED:
                total += length
                file.seek(length, 1)
                continue
            unpack = zlib.decompressobj()
            while length > 0 and total <= _LARGEST and (piece := file.read(min(length, 1 << 16))):
                length -= len(piece)
                while piece and total <= _LARGEST:
                    try:
                        total += len(unpack.decompress(piece, 1 << 24))
                    except zlib.error:
                        return  # loading will tell
                    piece = unpack.unconsumed_tail
            if total > _LARGEST:
                raise InputError(
                    f"{path}: its {path.stat().st_size} bytes unpack to more than {_LARGEST >> 30} GiB, which is "
                    "refused. Save fewer variables, or export the signals as CSV."
                )


def _load(path: Path) -> dict[str, Any]:
    import warnings

    import scipy.io

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = scipy.io.loadmat(path, struct_as_record=False, squeeze_me=False, appendmat=False)
        except OSError:
            raise
        except Exception as error:  # scipy's parser raises whatever it stumbles over in a broken file
            why = " ".join(str(error).split()) or type(error).__name__
            raise InputError(
                f"{path}: this is no MAT file, or it is broken or cut off ({why}). Copy it again, or save it in "
                f"MATLAB with save('{path.name}', '-v7')."
            ) from error
    return {name: value for name, value in found.items() if not name.startswith("__")}


def _sort(contents: _Contents, name: str, value: Any, depth: int) -> None:
    """Put one variable, or field of a struct, where it belongs."""
    if depth > _DEEPEST:
        contents.left_out.append(f"{name} (structs within structs without end)")
    elif hasattr(value, "_fieldnames"):
        _sort_struct(contents, name, value, depth)
    elif not isinstance(value, np.ndarray):
        contents.left_out.append(f"{name} (a sparse matrix)" if hasattr(value, "nnz") else f"{name} (not data)")
    elif type(value).__name__ in ("MatlabOpaque", "MatlabFunction", "MatlabObject"):
        contents.left_out.append(
            f"{name} (an object of a MATLAB class; save timeseries and tables as structs or plain vectors)"
        )
    elif value.dtype.kind in "US":
        _sort_text(contents, name, value)
    elif value.dtype == object:
        _sort_objects(contents, name, value, depth)
    elif value.dtype.kind in "biufc":
        _sort_numbers(contents, name, value)
    else:
        contents.left_out.append(f"{name} (of the kind {value.dtype})")


def _sort_text(contents: _Contents, name: str, value: np.ndarray) -> None:
    if value.size == 1:
        contents.metadata[name] = str(value.flat[0])
    elif value.size:
        contents.left_out.append(f"{name} (a table of letters)")


def _sort_objects(contents: _Contents, name: str, value: np.ndarray, depth: int) -> None:
    """Sort a struct array, or leave out a cell array."""
    items = list(value.flat)
    if not items or not all(hasattr(item, "_fieldnames") for item in items):
        contents.left_out.append(f"{name} (a cell array)")
    elif len(items) == 1:
        _sort(contents, name, items[0], depth + 1)
    elif all(
        np.size(getattr(item, f)) == 1 and _is_number(getattr(item, f)) for item in items for f in items[0]._fieldnames
    ):
        for member in items[0]._fieldnames:
            _sort_numbers(contents, f"{name}.{member}", np.array([getattr(i, member).flat[0] for i in items]))
    elif len(items) > _MOST_ELEMENTS:
        contents.left_out.append(f"{name} (an array of {len(items)} structs)")
    else:
        for i, item in enumerate(items, start=1):
            _sort(contents, f"{name}.{i}", item, depth + 1)


def _is_number(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "biuf"


def _sort_struct(contents: _Contents, name: str, value: Any, depth: int) -> None:
    members = {member: getattr(value, member) for member in value._fieldnames}
    if {"time", "signals"} <= set(members):
        _sort(contents, f"{name}.time", members.pop("time"), depth + 1)
        signals = members.pop("signals")
        items = [item for item in signals.flat if hasattr(item, "_fieldnames")] if np.size(signals) else []
        for i, item in enumerate(items, start=1):
            label = getattr(item, "label", np.empty(0))
            words = str(label.flat[0]).strip() if np.size(label) == 1 and label.dtype.kind == "U" else ""
            place = "signals" if len(items) == 1 else f"signals.{i}"
            _sort(contents, f"{name}.{words or place}", getattr(item, "values", np.empty(0)), depth + 1)
    for member, content in members.items():
        _sort(contents, f"{name}.{member}", content, depth + 1)


def _sort_numbers(contents: _Contents, name: str, value: np.ndarray) -> None:
    value = np.squeeze(value)
    if value.size == 0:
        contents.left_out.append(f"{name} (empty)")
    elif value.ndim == 0:
        contents.metadata[name] = repr(value.item())
    elif np.iscomplexobj(value):
        contents.notes.append(f"'{name}' is complex; its parts are read as '{name}.real' and '{name}.imag'.")
        _sort_numbers(contents, f"{name}.real", value.real)
        _sort_numbers(contents, f"{name}.imag", value.imag)
    elif value.ndim == 1:
        contents.vectors[name] = value
    elif value.ndim == 2 and min(value.shape) <= _MOST_COLUMNS:
        samples_down = value if value.shape[0] >= value.shape[1] else value.T
        for j in range(samples_down.shape[1]):
            contents.vectors[f"{name}_{j + 1}"] = samples_down[:, j]
    else:
        contents.left_out.append(f"{name} (an array of {' x '.join(map(str, value.shape))})")


def _tables(contents: _Contents) -> list[MatlabTable]:
    """Group the vectors by length and, where structs bring their own time vectors, by struct."""
    longest = max((vector.size for vector in contents.vectors.values()), default=0)
    if longest >= _SHORTEST_SIGNAL:
        for name in [name for name, vector in contents.vectors.items() if vector.size < _SHORTEST_SIGNAL]:
            contents.metadata[name] = " ".join(f"{value:g}" for value in contents.vectors.pop(name))
    clocks = [name for name, vector in contents.vectors.items() if _is_called_time(name) and _rises(vector)]
    groups: dict[tuple[int, str], dict[str, np.ndarray]] = {}
    for name, vector in contents.vectors.items():
        scopes = [_scope(clock) for clock in clocks if contents.vectors[clock].size == vector.size]
        scope = max((s for s in scopes if name.startswith(s)), key=len, default="")
        groups.setdefault((vector.size, scope), {})[name] = vector
    tables: dict[str, MatlabTable] = {}
    for (length, scope), columns in groups.items():
        time = next((name for name in columns if name in clocks and _scope(name) == scope), None)
        has_time = time is not None or any(_is_called_time(column) for column in columns)
        step = None if has_time else _step(contents.metadata, scope)
        name = "" if len(groups) == 1 else scope.rstrip(".") or time or f"{length} rows"
        name = name if name not in tables else f"{name} {length}"
        tables[name] = MatlabTable(name, columns, time, step)
    return list(tables.values())


def _scope(name: str) -> str:
    """Return the struct that a dotted name lies in, with its dot."""
    return name[: name.rfind(".") + 1]


def _is_called_time(name: str) -> bool:
    return bool(_TIMES.match(name[name.rfind(".") + 1 :].lower()))


def _rises(vector: np.ndarray) -> bool:
    """Tell whether a vector mostly rises: a few repeated or backward stamps do not make it less of a time."""
    steps = np.diff(vector.astype(np.float64))
    return bool(steps.size) and bool(np.count_nonzero(steps > 0) >= 0.9 * steps.size)


def _step(metadata: Mapping[str, str], scope: str) -> float | None:
    """Return the step (s) from a scalar such as Ts, dt or fs in the struct or beside it."""
    for name, text in metadata.items():
        word = name[name.rfind(".") + 1 :].lower()
        if _scope(name) not in (scope, "") or word not in _STEPS | _RATES:
            continue
        try:
            value = float(text)
        except ValueError:
            continue
        if value > 0 and np.isfinite(value):
            return 1.0 / value if word in _RATES else value
    return None


READER = MatlabReader()
