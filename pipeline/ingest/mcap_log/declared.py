"""What a topic declares of its fields beside the messages: units and fixed lengths.

Units come from the ``unit`` entry of a field's JSON Schema property, from ``@unit`` in IDL, else from
the channel's metadata (``unit.<field>``). A vector's members have the vector's unit.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pipeline.ingest.mcap_log.columns import Path
from pipeline.ingest.mcap_log.fields import Field, channel_name

_UNIT_PREFIX = "unit."
# Schemas may refer to themselves; level by level, so many nodes are looked at.
_MOST_NODES = 5000
_MOST_WAITING = 100_000
_LONGEST_CHAIN = 32


@dataclass
class Declared:
    """Units and fixed list lengths by path, and the units that the channel's metadata give by name."""

    units: dict[Path, str] = field(default_factory=dict)
    lengths: dict[Path, int] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)

    def unit(self, of: Field) -> str | None:
        """Return the unit of a field: its own, else that of the field it is part of."""
        if of.is_text:
            return None
        if of.is_stamp:
            return "s"
        path = of.paths[0]
        for n in range(len(path), -1, -1):
            if path[:n] in self.units:
                return self.units[path[:n]]
        names = [of.name] + [channel_name(path[:n]) for n in range(len(path), 0, -1)]
        return next((self.metadata[_UNIT_PREFIX + n] for n in names if _UNIT_PREFIX + n in self.metadata), None)


def is_unit_key(key: str) -> bool:
    """Tell whether a key of a channel's metadata declares a unit."""
    return key.startswith(_UNIT_PREFIX)


def from_json_schema(text: bytes, metadata: Mapping[str, str]) -> Declared:
    """Return what a JSON Schema declares; a schema that is no JSON declares nothing."""
    declared = Declared(metadata=metadata)
    try:
        schema = json.loads(text)
    except (ValueError, RecursionError):
        return declared
    waiting: deque[tuple[Any, Path, bool]] = deque([(schema, (), False)])
    visited = 0
    while waiting and visited < _MOST_NODES:
        visited += 1
        node, path, in_list = waiting.popleft()
        node = _resolved(_mapping(node), _mapping(schema))
        unit = node.get("unit", node.get("units"))
        if isinstance(unit, str):
            declared.units.setdefault(path, unit)
        low, high = node.get("minItems"), node.get("maxItems")
        if isinstance(low, int) and low == high and not in_list:
            declared.lengths.setdefault(path, low)
        members = _mapping(node.get("properties"))
        if len(waiting) + len(members) > _MOST_WAITING:
            break
        waiting.extend((member, (*path, key), in_list) for key, member in members.items())
        if "items" in node:
            waiting.append((node["items"], path, True))
        for choice in ("anyOf", "oneOf", "allOf"):
            others = node.get(choice)
            waiting.extend(
                (other, path, in_list) for other in (others if isinstance(others, list) else [])[:_MOST_NODES]
            )
    return declared


def _resolved(node: dict[str, Any], root: dict[str, Any]) -> dict[str, Any]:
    """Follow ``$ref`` within the schema; what stands beside it counts too."""
    for _ in range(_LONGEST_CHAIN):
        reference = node.get("$ref")
        if not isinstance(reference, str) or not reference.startswith("#"):
            return node
        target: Any = root
        for part in reference[1:].split("/")[1:]:
            target = _mapping(target).get(part.replace("~1", "/").replace("~0", "~"))
        node = {**_mapping(target), **{key: value for key, value in node.items() if key != "$ref"}}
    return {}


def _mapping(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}
