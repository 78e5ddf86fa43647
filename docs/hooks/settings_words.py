"""What a setting may be, in words, from its type and its limits."""

from __future__ import annotations

import types
import typing
from collections.abc import Iterable
from typing import Any, Literal

from pydantic import AfterValidator
from pydantic.fields import FieldInfo

from pipeline.rigs.experiment import Range

_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text", types.NoneType: "none"}
_LIMITS = (("gt", "more than {:g}"), ("ge", "{:g} or more"), ("lt", "less than {:g}"), ("le", "{:g} or less"))


def what_it_may_be(field: FieldInfo) -> str:
    """Return it in words: ``"a number, more than 0"``, ``"'fit' or a number, from -0.1 to 0.1"``."""
    return _kind(field.annotation, field.metadata)


def _kind(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    limits = list(_limits(metadata))
    origin = typing.get_origin(annotation)
    if origin is typing.Annotated:
        base, *more = typing.get_args(annotation)
        return _kind(base, [*metadata, *more])
    if origin in (typing.Union, types.UnionType):
        words = " or ".join(_kind(part) for part in typing.get_args(annotation))
    elif origin is Literal:
        words = " or ".join(f"'{part}'" if isinstance(part, str) else str(part) for part in typing.get_args(annotation))
    elif origin in (list, tuple, set, frozenset):
        parts = [part for part in typing.get_args(annotation) if part is not Ellipsis]
        words = "a list; each " + " or ".join(dict.fromkeys(_kind(part) for part in parts))
    elif origin is dict:
        key, value = typing.get_args(annotation)
        words = f"entries of {_kind(key)}: {_kind(value)}"
    else:
        words = _KINDS.get(annotation, getattr(annotation, "__name__", str(annotation)))
    return ", ".join([words, *limits])


def _limits(metadata: Iterable[Any]) -> Iterable[str]:
    for entry in metadata:
        if isinstance(entry, AfterValidator):
            owner = getattr(entry.func, "__self__", None)
            if isinstance(owner, Range):
                yield owner.told()
            continue
        for name, words in _LIMITS:
            limit = getattr(entry, name, None)
            if limit is not None:
                yield words.format(limit)
