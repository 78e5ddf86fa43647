"""YAML with places: what a key or value is called and in which line it stands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from pipeline.errors import InputError


def load(path: Path) -> CommentedMap:
    """Read a YAML file whose top is a mapping; the lines of its keys stay known.

    Raises
    ------
    InputError
        If it is missing, is no YAML, or its top is no mapping; names the line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8.") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    try:
        content = YAML(typ="rt").load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f" line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{line}: not valid YAML: {error.problem or error.context}.") from error
    except (YAMLError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid YAML: {error}.") from error
    if content is None:
        content = CommentedMap()
    if not isinstance(content, CommentedMap):
        raise InputError(f"{path}: expected 'key: value' lines, found {type(content).__name__.lower()}.")
    return content


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
