"""The fields of findings.json as tables, from its JSON Schema."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from typing import Any

SCHEMA = Path(__file__).parents[1] / "findings.schema.json"


def tables() -> str:
    """Return a table of the top level and one of each kind of entry, as Markdown with HTML."""
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    parts = ["## The file", "", *_of(schema)]
    for name, entry in schema["$defs"].items():
        parts += [f"## {name}", "", escape(entry.get("description", "")), "", *_of(entry)]
    return "\n".join(parts)


def _of(entry: Mapping[str, Any]) -> Iterable[str]:
    required = set(entry.get("required", ()))
    yield "<table>"
    yield '<thead><tr><th scope="col">Field</th><th scope="col">What it may be</th><th scope="col">What it is</th></tr></thead><tbody>'
    for name, field in entry.get("properties", {}).items():
        always = "" if name not in required else " <small>(always there)</small>"
        yield f"<tr><td><code>{name}</code>{always}</td><td>{_kind(field)}</td><td>{escape(field.get('description', ''))}</td></tr>"
    yield "</tbody></table>"
    yield ""


def _kind(field: Mapping[str, Any]) -> str:
    if "$ref" in field:
        name = field["$ref"].rsplit("/", 1)[-1]
        return f'<a href="#{name.lower()}">{name}</a>'
    if "anyOf" in field:
        return " or ".join(dict.fromkeys(_kind(part) for part in field["anyOf"]))
    if "enum" in field:
        return " or ".join(f"<code>{escape(str(word))}</code>" for word in field["enum"])
    if "const" in field:
        return f"<code>{escape(json.dumps(field['const']))}</code>"
    if field.get("type") == "array":
        inner = field.get("items") or {}
        return f"list of {_kind(inner)}" if inner else "list"
    if field.get("type") == "object":
        inner = field.get("additionalProperties")
        return f"names and {_kind(inner)}" if isinstance(inner, dict) and inner else "names and values"
    return {"string": "text", "boolean": "true or false", "integer": "whole number"}.get(
        field.get("type", ""), field.get("type", "anything")
    )
