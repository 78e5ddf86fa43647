"""ROS message definitions (.msg of ROS 1 and 2) as a tree of types.

What the bytes of a message mean is in `ros_messages`; the IDL form of ROS 2 is read by `idl`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.ingest.mcap_log.encodings.ros_units import UNITS

TOO_LARGE = "its types hold each other thousands of times, or deeper than any message does"


class DefinitionError(Exception):
    """A message definition that cannot be understood; the text tells why, as part of a sentence."""


@dataclass(frozen=True)
class Primitive:
    """A number of fixed size; `kind` is numpy's code without byte order."""

    kind: str

    @property
    def size(self) -> int:
        """Bytes."""
        return np.dtype(self.kind).itemsize


@dataclass(frozen=True)
class Text:
    """A string: its length, then its bytes."""


@dataclass(frozen=True)
class Many:
    """An array of `length` elements, or a sequence (None) whose length stands before it."""

    of: Type
    length: int | None


@dataclass
class Struct:
    """Named members in order; `units` are those that the definition itself declares, or states in words."""

    name: str
    members: list[tuple[str, Type]] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)


Type = Primitive | Text | Many | Struct

COMMON = {
    "bool": "?", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8", "char": "u1",
}  # fmt: skip
_FIELD = re.compile(r"^([\w/]+)(<=\d+)?(\[(?:<=)?\d*\])?\s+(\w+)(\s*=)?")
_LONGEST_ARRAY = 1 << 16
# A definition is small, but types that hold types twice each become very many.
_MOST_MEMBERS, _DEEPEST = 5000, 40


def parse_msg(name: str, text: str, ros: int) -> Struct:
    """Return the type `name` that a concatenated message definition of ROS 1 or 2 describes.

    Raises
    ------
    DefinitionError
        If a line is no field, or a type is not defined.
    """
    parts = re.split(r"^={3,}[ \t\r]*$", text, flags=re.MULTILINE)
    bodies = {_short(name): parts[0]}
    for part in parts[1:]:
        match = re.match(r"\s*MSG:\s+(\S+)[ \t\r]*$(.*)", part, flags=re.MULTILINE | re.DOTALL)
        if match:
            bodies[_short(match[1])] = match[2]
    primitives = COMMON | ({"byte": "i1"} if ros == 1 else {"byte": "u1"})
    return _Resolver(bodies, primitives, ros).struct(_short(name))


def _short(name: str) -> str:
    """``std_msgs/msg/Header`` and ``std_msgs/Header`` are the same type."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


class _Resolver:
    """Turns bodies of definitions into types, each once."""

    def __init__(self, bodies: Mapping[str, str], primitives: Mapping[str, str], ros: int) -> None:
        self.bodies = bodies
        self.primitives = primitives
        self.ros = ros
        self.open: list[str] = []
        self.count = 0

    def struct(self, name: str) -> Struct:
        if name in self.open:
            raise DefinitionError(f"the type '{name}' contains itself")
        if name not in self.bodies:
            return self.time(name)
        if len(self.open) > _DEEPEST:
            raise DefinitionError(TOO_LARGE)
        self.open.append(name)
        result = Struct(name, units=dict(UNITS.get(name, {})))
        for line in self.bodies[name].splitlines():
            line = line.split("#")[0].strip()
            if not line:
                continue
            match = _FIELD.match(line)
            if not match:
                raise DefinitionError(f"{line[:80]!r} in the type '{name}' is no field")
            kind, _, many, member, constant = match.groups()
            if not constant:
                self.count += 1
                if self.count > _MOST_MEMBERS:
                    raise DefinitionError(TOO_LARGE)
                result.members.append((member, self.member(kind, many, name.split("/")[0])))
        self.open.pop()
        return result

    def member(self, kind: str, many: str | None, package: str) -> Type:
        of = self.element(kind, package)
        if many is None:
            return of
        inside = many[1:-1]
        return Many(of, array_length(inside) if inside and not inside.startswith("<=") else None)

    def element(self, kind: str, package: str) -> Type:
        if kind in self.primitives:
            return Primitive(self.primitives[kind])
        if kind == "string":
            return Text()
        if kind == "wstring":
            raise DefinitionError("wide strings (wstring) are not supported")
        if "/" not in kind:
            standard = "std_msgs/Header" if kind == "Header" else kind
            kind = f"{package}/{kind}" if f"{package}/{kind}" in self.bodies else standard
        return self.struct(_short(kind))

    def time(self, name: str) -> Struct:
        """Return the types that need no definition."""
        kind = name.split("/")[-1]
        if self.ros == 1 and name in ("time", "duration"):
            part = Primitive("u4" if name == "time" else "i4")
            return Struct(name, [("secs", part), ("nsecs", part)])
        if self.ros == 2 and kind in ("Time", "Duration"):
            return Struct(name, [("sec", Primitive("i4")), ("nanosec", Primitive("u4"))])
        raise DefinitionError(f"the type {name[:80]!r} is not defined")


def array_length(text: str) -> int:
    """Return the length of a fixed array."""
    if len(text) > len(str(_LONGEST_ARRAY)) or int(text) > _LONGEST_ARRAY:
        raise DefinitionError(f"an array of {text[:20]} elements in every message is too long")
    return int(text)


def extent(kind: Type, known: dict[int, tuple[int, int]]) -> tuple[int, int]:
    """Return how many types a type comes to with all that it holds, and how deep they lie.

    `known` are those of structs by their identity; that of a new one is added.

    Raises
    ------
    DefinitionError
        If they are more, or deeper, than any message is.
    """
    if id(kind) in known:
        return known[id(kind)]
    inner = [of for _, of in kind.members] if isinstance(kind, Struct) else [kind.of] if isinstance(kind, Many) else []
    found = [extent(of, known) for of in inner]
    count, depth = 1 + sum(n for n, _ in found), 1 + max((deep for _, deep in found), default=0)
    if count > _MOST_MEMBERS or depth > 2 * _DEEPEST:
        raise DefinitionError(TOO_LARGE)
    if isinstance(kind, Struct):
        known[id(kind)] = (count, depth)
    return count, depth


def fixed_lengths(struct: Struct) -> dict[tuple[str, ...], int]:
    """Return the arrays of fixed length by path: those are vectors, not blocks of samples."""
    return {
        path: kind.length
        for path, kind, in_list in _visited(struct, (), False)
        if isinstance(kind, Many) and kind.length is not None and not in_list
    }


def declared_units(struct: Struct) -> dict[tuple[str, ...], str]:
    """Return the units that the definition declares, by path."""
    return {
        (*path, member): unit
        for path, kind, _ in _visited(struct, (), False)
        if isinstance(kind, Struct)
        for member, unit in kind.units.items()
    }


def _visited(kind: Type, path: tuple[str, ...], in_list: bool) -> Iterator[tuple[tuple[str, ...], Type, bool]]:
    """Yield all types within a type: path, type, whether it stands in a list."""
    yield path, kind, in_list
    if isinstance(kind, Many):
        yield from _visited(kind.of, path, True)
    elif isinstance(kind, Struct):
        for member, of in kind.members:
            yield from _visited(of, (*path, member), in_list)
