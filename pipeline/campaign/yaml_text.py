"""YAML with places: what a key or value is called and in which line it stands.

Files are people's: small, shallow, their numbers finite. What is not is refused before it is unfolded.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import CollectionEndEvent, CollectionStartEvent
from ruamel.yaml.nodes import MappingNode, SequenceNode

from pipeline.errors import InputError
from pipeline.recording.storage import whole_or_not

LARGEST = 1 << 18  # bytes
DEEPEST = 20
# What a value may be called; other tags ask for objects, and ruamel stumbles over some of them.
_PLAIN_TAGS = re.compile(r"(!|!!|tag:yaml.org,2002:)(str|int|float|bool|null|map|seq|)")
# Keys and values as written, and once every alias stands for what it repeats.
MOST_VALUES = 10_000


def load(path: Path) -> CommentedMap:
    """Read a YAML file whose top is a mapping; the lines of its keys stay known.

    Raises
    ------
    InputError
        If it is missing, is no YAML, its top is no mapping, it is larger or deeper than any recipe, or
        holds a number that is not finite; names the line.
    """
    try:
        if path.is_file() and (size := path.stat().st_size) > LARGEST:
            raise InputError(f"{path}: holds {size / 1e6:.3g} MB, which no recipe does; is it a log? Expected is YAML.")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8.") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    return loads(text, path)


def loads(text: str, path: Path | str) -> CommentedMap:
    """Read the text of a YAML file as `load` does; `path` is its place for messages."""
    try:
        _refuse_shape(text, path)
        content = YAML(typ="rt").load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f" line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{line}: not valid YAML: {error.problem or error.context}.") from error
    except (YAMLError, ValueError, RecursionError, AttributeError) as error:  # the last of what is merged into itself
        raise InputError(f"{path}: not valid YAML: {error}.") from error
    if content is None:
        content = CommentedMap()
    if not isinstance(content, CommentedMap):
        found = "a list" if isinstance(content, list) else f"only '{str(content)[:40]}'"
        raise InputError(f"{path}: expected 'key: value' lines, found {found}.")
    _refuse_unfolding(content, path)
    return content


def _refuse_shape(text: str, path: Path | str) -> None:
    """Refuse nesting and numbers of values that no recipe has; loading would recurse into them or take minutes."""
    depth = 0
    for count, event in enumerate(YAML(typ="rt").parse(text)):
        if (tag := getattr(event, "tag", None)) and not _PLAIN_TAGS.fullmatch(str(tag)):
            raise InputError(
                f"{path} line {event.start_mark.line + 1}: the tag '{tag}' is no part of a recipe; write the plain value."
            )
        if isinstance(event, CollectionStartEvent):
            depth += 1
        elif isinstance(event, CollectionEndEvent):
            depth -= 1
        if depth > DEEPEST:
            line = event.start_mark.line + 1
            raise InputError(
                f"{path} line {line}: nested deeper than {DEEPEST} levels, which no recipe is; is a bracket not closed?"
            )
        if count > MOST_VALUES:
            raise InputError(
                f"{path}: holds more than {MOST_VALUES} keys and values, which no recipe does; is it a log?"
            )


def _refuse_unfolding(content: CommentedMap, path: Path | str) -> None:
    """Refuse aliases that repeat each other into very many values, or contain themselves, and numbers like .nan."""
    count = 0
    stack: list[tuple[Any, tuple[str | int, ...]]] = [(content, ())]
    while stack:
        value, place = stack.pop()
        count += 1
        if count > MOST_VALUES or len(place) > DEEPEST:
            raise InputError(
                f"{path} line {line_of(content, place[:1])}: its aliases (*name) stand for more than {MOST_VALUES} values or "
                "for themselves; write out what is meant."
            )
        if isinstance(value, dict):
            stack += [(inner, (*place, key)) for key, inner in value.items()]
        elif isinstance(value, list | tuple | set):
            stack += [(inner, (*place, number)) for number, inner in enumerate(value)]
        elif isinstance(value, float) and not math.isfinite(value):
            key = ".".join(str(step) for step in place)
            raise InputError(
                f"{path} line {line_of(content, place)}: '{key}' is {float(value)}, which is no number to compute with; "
                "write the number, or leave the key out."
            )


def add(path: Path, key: str, name: str, value: str | None = None) -> None:
    """Add `name` to the list, or ``name: value`` to the mapping, that stands under `key` at the top of a YAML file.

    All else in the file, comments too, stays as it is; what is not there yet is made.

    Raises
    ------
    InputError
        If something else stands under `key`; names the line.
    """
    load(path)  # says what is wrong with it, if anything is
    with path.open(encoding="utf-8-sig", newline="") as file:
        text = file.read()
    end = "\r\n" if "\r\n" in text else "\n"
    entry = name if value is None else f"{name}: {json.dumps(value, ensure_ascii=False)}"
    item = f"- {entry}" if value is None else entry
    brackets = "[]" if value is None else "{}"
    top = YAML(typ="rt").compose(text)
    pairs = top.value if isinstance(top, MappingNode) else []
    found = next(((first, node) for first, node in pairs if first.value == key), None)
    if found is None:
        head = text if not text or text.endswith("\n") else text + end
        text = f"{head}{key}: {brackets[0]}{entry}{brackets[1]}{end}"
    elif isinstance(found[1], MappingNode if value is None else SequenceNode):
        expected = "a list of names" if value is None else f"'{name}: ...' lines"
        raise InputError(f"{path} line {found[0].start_mark.line + 1}: '{key}' must be {expected}.")
    elif not isinstance(found[1], MappingNode | SequenceNode):  # nothing stands there yet
        at = found[0].end_mark.index + text[found[0].end_mark.index :].index(":") + 1
        text = f"{text[:at]} {brackets[0]}{entry}{brackets[1]}{text[at:]}"
    elif found[1].flow_style:
        at = found[1].end_mark.index - 1
        comma = ", " if found[1].value else ""
        text = f"{text[:at].rstrip(' ')}{comma}{entry}{text[at:]}"
    else:
        last = found[1].value[-1]
        node = last[1] if isinstance(last, tuple) else last
        line = node.end_mark.line if node.end_mark.column else max(node.end_mark.line - 1, node.start_mark.line)
        lines = text.splitlines(keepends=True)
        if not lines[line].endswith("\n"):
            lines[line] += end
        lines.insert(line + 1, " " * found[1].start_mark.column + item + end)
        text = "".join(lines)
    with whole_or_not(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        file.write(text)


def line_of(content: Any, place: Sequence[str | int]) -> int | None:
    """Return the line (from 1) of the key or item at `place`, or of its nearest parent that is there."""
    line: int | None = None
    for step in place:
        try:
            if isinstance(content, CommentedMap):
                line = content.lc.key(step)[0] + 1
            elif isinstance(content, CommentedSeq):
                line = content.lc.item(step)[0] + 1
            else:
                break
            content = content[step]
        except (KeyError, IndexError, TypeError, AttributeError):
            break
    return line


def plain(content: Any) -> Any:
    """Return the same content made of plain dicts, lists, and scalars."""
    if isinstance(content, dict):
        return {str(key): plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [plain(value) for value in content]
    if isinstance(content, bool) or content is None:
        return content
    for kind in (int, float, str):
        if isinstance(content, kind):
            return kind(content)
    return str(content)
