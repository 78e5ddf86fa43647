"""The reader of MATLAB files (MAT v4, v5 and, with h5py, v7.3): vectors are channels, scalars conditions.

Vectors of one length share a table, with the time vector of that length; structs give dotted names.
MAT files give no units. They are read whole, up to version 7 with a parser of our own: scipy's ends the process on some
damaged files, and is slow to import.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from pipeline.errors import InputError, listing
from pipeline.ingest.hdf5 import MARK
from pipeline.ingest.matlab import mat4, mat5, mat73
from pipeline.ingest.matlab.values import BrokenFileError, Struct, Unread, Value
from pipeline.ingest.reader import BLOCK_ROWS, RawChannel, RawLog, RawTable, Reader
from pipeline.recording import QualityFinding

_MOST_COLUMNS = 64
_MOST_ELEMENTS = 64
_MOST_VARIABLES = 5000
# Shorter vectors beside longer ones are parameters, not signals.
_SHORTEST_SIGNAL = 8
_TIMES = re.compile(
    r"^(t|time|times|tout|tsim|t_?(s|sec|ms)|time_?(s|sec|ms|stamp|vector)|timestamps?|zeit|temps|tiempo)$"
)


@dataclass
class _Contents:
    """What the variables of a file come to: vectors by dotted name, scalars and words, what was left out."""

    vectors: dict[str, np.ndarray] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


class MatlabTable(RawTable):
    """Vectors of one length; `columns` keep the numbers as the file has them."""

    def __init__(self, name: str, columns: Mapping[str, np.ndarray], time: str | None) -> None:
        self.name = name
        self._columns = columns
        self.channels = [RawChannel(column) for column in columns]
        self.time_channel = time

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
        """Yield the rows; see `RawTable.blocks`."""
        wanted = [name for name in self._columns if names is None or name in names]
        rows = next(iter(self._columns.values())).size
        for start in range(0, rows if wanted else 0, BLOCK_ROWS):
            cut = slice(start, start + BLOCK_ROWS)
            yield {name: self._columns[name][cut].astype(np.float64) for name in wanted}


class MatlabReader(Reader):
    """Reads MAT files of version 4 to 7.3."""

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
            If it is empty, broken, no MAT file, or holds no vector of numbers.
        """
        try:
            head = _checked_head(path)
            variables = _load(path, head)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error}).") from error
        contents = _Contents()
        for name, value in variables.items():
            _sort(contents, name, value)
        tables = _tables(contents)
        if not tables:
            found = listing([*contents.metadata, *contents.left_out]) if variables else "nothing"
            raise InputError(f"{path}: this MAT file holds no vector of numbers to read as a channel; it has {found}.")
        notes = [QualityFinding("note", text) for text in contents.notes]
        notes += [QualityFinding("note", f"a variable was left out: {text}.") for text in contents.left_out]
        details = {
            "version": "7.3" if _is_73(head) else "5" if head.startswith(b"MATLAB 5") else "4",
            "variables": listing(variables),
        }
        return RawLog(path, "MATLAB", tables, contents.metadata, details, tuple(notes))


def _checked_head(path: Path) -> bytes:
    with path.open("rb") as file:
        head = file.read(1024)
    if not head:
        raise InputError(f"{path}: the file is empty (0 bytes). Save it again.")
    if head.startswith((b"# Created by Octave", b"Octave-1")):
        raise InputError(f"{path}: this is a file in Octave's own format. Save it in Octave with: save -v7 {path.name}")
    return head


def _is_73(head: bytes) -> bool:
    return head.startswith((b"MATLAB 7.3", MARK)) or head[512 : 512 + len(MARK)] == MARK


def _load(path: Path, head: bytes) -> dict[str, Value]:
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(0)
        try:
            if _is_73(head):
                return _few(mat73.variables(path))
            if head.startswith(b"MATLAB 5") or head[124:128] in (b"\0\x01IM", b"\x01\0MI"):
                return _few(mat5.variables(file, size))
            if mat4.is_mat4(head):
                return _few(mat4.variables(file, size))
        except BrokenFileError as error:
            raise InputError(
                f"{path}: this MAT file is broken or was cut off: {error}. Copy it again, or save it in MATLAB with "
                f"save('{path.name}', '-v7')."
            ) from error
    raise InputError(
        f"{path}: this is no MAT file: it begins with {head[:8]!r}. If it holds another kind of log, give it that "
        "kind's suffix (.csv, .mcap)."
    )


def _few(variables: Iterator[tuple[str, Value]]) -> dict[str, Value]:
    """Return the variables of a file, which are not as many as rows."""
    found = dict(islice(variables, _MOST_VARIABLES + 1))
    if len(found) > _MOST_VARIABLES:
        raise BrokenFileError(f"it holds more than {_MOST_VARIABLES} variables, where a vector is one")
    return found


def _sort(contents: _Contents, name: str, value: Value) -> None:
    """Put one variable, or field of a struct, where it belongs."""
    if isinstance(value, Unread):
        contents.left_out.append(f"{name} ({value.kind})")
    elif isinstance(value, str):
        contents.metadata[name] = value
    elif isinstance(value, np.ndarray):
        _sort_numbers(contents, name, value)
    elif len(value.elements) == 1:
        _sort_struct(contents, name, value.elements[0])
    elif value.elements and all(_is_scalar(content) for members in value.elements for content in members.values()):
        for member in value.names:
            column = [float(np.asarray(members[member]).item()) for members in value.elements]
            _sort_numbers(contents, f"{name}.{member}", np.array(column))
    elif 0 < len(value.elements) <= _MOST_ELEMENTS:
        for i, members in enumerate(value.elements, start=1):
            _sort_struct(contents, f"{name}.{i}", members)
    else:
        contents.left_out.append(f"{name} (an array of {len(value.elements)} structs)")


def _is_scalar(value: Value) -> bool:
    return isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind != "c"


def _sort_struct(contents: _Contents, name: str, members: Mapping[str, Value]) -> None:
    """Sort the fields of a struct; Simulink's "Structure with time" names its signals by their labels."""
    signals = members.get("signals")
    for member, content in members.items():
        if content is not signals or "time" not in members or not isinstance(signals, Struct):
            _sort(contents, f"{name}.{member}", content)
            continue
        for i, signal in enumerate(signals.elements, start=1):
            label = signal.get("label")
            place = "signals" if len(signals.elements) == 1 else f"signals.{i}"
            called = label.strip() if isinstance(label, str) else ""
            _sort(contents, f"{name}.{called or place}", signal.get("values", Unread("a signal without values")))


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
        name = "" if len(groups) == 1 else scope.rstrip(".") or time or f"{length} rows"
        name = name if name not in tables else f"{name} {length}"
        tables[name] = MatlabTable(name, columns, time)
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


READER = MatlabReader()
