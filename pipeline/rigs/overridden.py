"""The known truth of a synthetic rig with what a recipe sets otherwise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

from pipeline.errors import InputError, listing, nearest

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Truth = TypeVar("Truth", bound="DataclassInstance")


def overridden(usual: Truth, overrides: Mapping[str, Any], rig: str) -> Truth:
    """Return `usual` with `overrides`.

    Parameters
    ----------
    usual
        A dataclass with all that the rig is made of. A field that is a number takes numbers only, one that is true
        or false takes these only; what else may be set is the rig's own to say.
    rig
        What the messages call it, as ``synthetic gearbox``.

    Raises
    ------
    InputError
        If a name is unknown (names the nearest), or a number or a truth value is none.
    """
    known = sorted(field.name for field in fields(usual))
    for name, value in overrides.items():
        if name not in known:
            raise InputError(
                f"the {rig} has no parameter '{name}'.{nearest(name, known)} It has {listing(known, len(known))}."
            )
        expected = getattr(usual, name)
        flag = isinstance(expected, bool)
        if isinstance(expected, int | float) and not _is_like(value, flag):
            raise InputError(f"'{name}' of the {rig} is {value!r}; expected {'true or false' if flag else 'a number'}.")
    return replace(usual, **dict(overrides))


def _is_like(value: Any, flag: bool) -> bool:
    if flag or isinstance(value, bool):
        return flag and isinstance(value, bool)
    return isinstance(value, int | float) and not math.isnan(value)
