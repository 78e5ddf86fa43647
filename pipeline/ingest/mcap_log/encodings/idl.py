"""Message definitions in IDL, as ROS 2 keeps some (``ros2idl``) and DDS all (``omgidl``).

Only what describes data is read: modules, structs, typedefs, enums, sequences, arrays; constants
count as array lengths, of the annotations only ``@unit``.
"""

from __future__ import annotations

import re

from pipeline.ingest.mcap_log.encodings.ros_types import (
    DefinitionError,
    Many,
    Primitive,
    Struct,
    Text,
    Type,
    array_length,
    extent,
)
from pipeline.ingest.mcap_log.encodings.ros_units import UNITS

_PRIMITIVES = {
    "boolean": "?", "octet": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float": "f4", "double": "f8", "short": "i2",
    "long": "i4", "long long": "i8", "unsigned short": "u2", "unsigned long": "u4", "unsigned long long": "u8",
}  # fmt: skip
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*+"?|\'[^\']*\'|[A-Za-z_]\w*|-?\d[\w.+-]*|::|[{}()\[\]<>;:,=@|&*/+-]')
_COMMENT = re.compile(r"//[^\n]*|/\*")


def parse_idl(name: str, text: str) -> Struct:
    """Return the struct `name` (``pkg/msg/Name`` or ``pkg::msg::Name``) that `text` defines.

    Raises
    ------
    DefinitionError
        If the text cannot be understood or lacks the struct.
    """
    lines = [line for line in text.splitlines() if not re.match(r"^(={3,}|IDL:.*|#.*)\s*$", line)]
    parser = _Parser(_TOKEN.findall(_without_comments("\n".join(lines))))
    parser.definitions(())
    wanted = tuple(part for part in re.split(r"/|::", name) if part)
    for scope in (wanted, (wanted[0], "msg", wanted[-1])):
        found = parser.types.get(scope)
        if isinstance(found, Struct):
            return found
    raise DefinitionError(f"the struct '{name}' is not defined in its IDL")


def _without_comments(text: str) -> str:
    """Return IDL without its comments; one that does not end goes to the end. A regex would look for that end again and again."""
    kept, at = [], 0
    while match := _COMMENT.search(text, at):
        kept.append(text[at : match.start()])
        end = match.end() if match[0] != "/*" else text.find("*/", match.end()) + 2
        at = len(text) if end < match.end() else end
    return " ".join([*kept, text[at:]])


class _Parser:
    """Reads tokens from front to back; types are kept under their full names."""

    def __init__(self, tokens: list[str]) -> None:
        self.tokens = tokens
        self.at = 0
        self.types: dict[tuple[str, ...], Type] = {}
        self.constants: dict[str, str] = {}
        self.extents: dict[int, tuple[int, int]] = {}

    def next(self) -> str:
        if self.at >= len(self.tokens):
            raise DefinitionError("its IDL ends too early")
        self.at += 1
        return self.tokens[self.at - 1]

    def peek(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def expect(self, token: str) -> None:
        found = self.next()
        if found != token:
            raise DefinitionError(f"its IDL has {found[:40]!r} where '{token}' was expected")

    def annotations(self) -> str | None:
        """Skip annotations; return the value of ``@unit`` if there is one."""
        unit = None
        while self.peek() == "@":
            self.next()
            name = self.next()
            while self.peek() == "::":
                self.next()
                name = self.next()
            if self.peek() == "(":
                said = self.parenthesised()
                if name == "unit":
                    unit = next((word[1:-1] for word in said if word.startswith('"')), None)
        return unit

    def parenthesised(self) -> list[str]:
        self.expect("(")
        said, depth = [], 1
        while depth:
            token = self.next()
            depth += (token == "(") - (token == ")")
            said.append(token)
        return said[:-1]

    def definitions(self, scope: tuple[str, ...]) -> None:
        while self.peek() not in ("", "}"):
            self.annotations()
            token = self.next()
            if token == "module":
                inner = (*scope, self.next())
                self.expect("{")
                self.definitions(inner)
                self.expect("}")
            elif token == "struct":
                self.struct(scope)
            elif token == "typedef":
                kind = self.type(scope)
                name, kind = self.declarator(kind)
                extent(kind, self.extents)
                self.types[(*scope, name)] = kind
            elif token == "enum":
                self.types[(*scope, self.next())] = Primitive("u4")
                self.skip_braces()
            elif token == "const":
                self.constant(scope)
            elif token != ";":
                raise DefinitionError(f"its IDL has {token[:40]!r}, which is not supported")

    def skip_braces(self) -> None:
        self.expect("{")
        while self.next() != "}":
            pass

    def constant(self, scope: tuple[str, ...]) -> None:
        self.type(scope)
        name = self.next()
        self.expect("=")
        self.constants[name] = self.peek()
        while self.next() != ";":
            pass

    def struct(self, scope: tuple[str, ...]) -> None:
        name = self.next()
        result = Struct("/".join((*scope, name)), units=dict(UNITS.get(f"{scope[0]}/{name}" if scope else name, {})))
        if self.peek() == ":":
            self.next()
            base = self.named(scope)
            if not isinstance(base, Struct):
                raise DefinitionError(f"the base of the struct '{name}' is no struct")
            result.members.extend(base.members)
            extent(result, {**self.extents})
        if self.peek() == ";":
            return  # declared here, defined later
        self.expect("{")
        while self.peek() != "}":
            unit = self.annotations()
            kind = self.type(scope)
            while True:
                member, whole = self.declarator(kind)
                result.members.append((member, whole))
                if unit is not None:
                    result.units[member] = unit
                if self.next() == ";":
                    break
        self.expect("}")
        extent(result, self.extents)
        self.types[(*scope, name)] = result

    def declarator(self, kind: Type) -> tuple[str, Type]:
        name = self.next()
        lengths = []
        while self.peek() == "[":
            self.next()
            lengths.append(self.length(self.next()))
            self.expect("]")
        for length in reversed(lengths):
            kind = Many(kind, length)
        return name, kind

    def length(self, token: str) -> int:
        text = self.constants.get(token, token)
        if not text.isdigit():
            raise DefinitionError(f"its IDL has {token[:40]!r} where a length was expected")
        return array_length(text)

    def type(self, scope: tuple[str, ...]) -> Type:
        token = self.peek()
        if token == "sequence":
            self.next()
            self.expect("<")
            kind = self.type(scope)
            if self.next() == ",":
                self.next()
                self.expect(">")
            return Many(kind, None)
        if token in ("string", "wstring"):
            self.next()
            if token == "wstring":
                raise DefinitionError("wide strings (wstring) are not supported")
            if self.peek() == "<":
                while self.next() != ">":
                    pass
            return Text()
        if token in _PRIMITIVES or token in ("unsigned", "long"):
            words = [self.next()]
            while self.peek() in ("long", "short", "double") and words[0] in ("unsigned", "long"):
                words.append(self.next())
            if " ".join(words) not in _PRIMITIVES:
                raise DefinitionError(f"the type '{' '.join(words)}' is not supported")
            return Primitive(_PRIMITIVES[" ".join(words)])
        return self.named(scope)

    def named(self, scope: tuple[str, ...]) -> Type:
        parts = [self.next()]
        if parts == ["::"]:
            parts, scope = [self.next()], ()
        while self.peek() == "::":
            self.next()
            parts.append(self.next())
        for n in range(len(scope), -1, -1):
            found = self.types.get((*scope[:n], *parts))
            if found is not None:
                return found
        if parts[-1] in ("Time", "Duration"):
            return Struct("/".join(parts), [("sec", Primitive("i4")), ("nanosec", Primitive("u4"))])
        raise DefinitionError(f"the type {'::'.join(parts)[:80]!r} is not defined before its use")
