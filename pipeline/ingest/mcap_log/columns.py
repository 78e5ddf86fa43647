"""Messages turned into columns: values by field, whatever the encoding of the messages was.

A field is named by its path from the message's top: ``("wrench", "force", "x")``. Lists of one
message stay together (`Column.lengths`); what they mean is decided in `arrays`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np

Path = tuple[str, ...]

# Deeper or wider messages are data used as keys, or an attack.
_DEEPEST = 32
MOST_FIELDS = 2000
_NO_NUMBER_TEXTS = {"NaN", "nan", "null", "", "None"}
_INFINITE_TEXTS = {"Infinity": np.inf, "-Infinity": -np.inf, "inf": np.inf, "-inf": -np.inf}
_NUMBERS = {float, int, bool, type(None)}


class TooManyFieldsError(Exception):
    """Messages whose keys are data."""


@dataclass(frozen=True)
class Column:
    """One field of m messages.

    Without `lengths`, `values` has shape (m,); with `lengths` (m,) it holds the lists of all
    messages one after the other. `values` is float64 (NaN where a message lacks the field), or
    objects where any is no number.
    """

    values: np.ndarray
    lengths: np.ndarray | None = None


Columns = dict[Path, Column]


def columns_of(objects: Sequence[Any], wanted: Collection[Path] | None = None) -> Columns:
    """Return the columns of decoded messages (nested dicts, lists, numbers, texts).

    `wanted` restricts them to these paths; a path in it must come with all its beginnings.

    Raises
    ------
    TooManyFieldsError
        If the messages have more than `MOST_FIELDS` fields between them.
    """
    found: Columns = {}
    _collect(objects, (), found, wanted)
    return found


def _collect(objects: Sequence[Any], path: Path, found: Columns, wanted: Collection[Path] | None) -> None:
    if wanted is not None and path not in wanted:
        return
    if len(path) > _DEEPEST or len(found) > MOST_FIELDS:
        raise TooManyFieldsError
    types = set(map(type, objects))
    if dict in types:
        members = objects if types == {dict} else [o if type(o) is dict else {} for o in objects]
        for key, values in _members(members):
            _collect(values, (*path, str(key)), found, wanted)
        types -= {dict}
        if types <= {type(None)}:
            return
        objects = [None if type(o) is dict else o for o in objects]
    if list in types:
        _collect_lists(objects, path, found, wanted)
    else:
        found[path] = Column(as_array(objects))


def _members(dicts: Sequence[dict[str, Any]]) -> list[tuple[str, Sequence[Any]]]:
    first = dicts[0]
    if set(map(len, dicts)) == {len(first)}:
        try:
            return [(key, list(map(itemgetter(key), dicts))) for key in first]
        except KeyError:
            pass  # as many keys, but not the same ones
    keys = dict.fromkeys(chain.from_iterable(dicts))
    if len(keys) > MOST_FIELDS:
        raise TooManyFieldsError
    return [(key, [members.get(key) for members in dicts]) for key in keys]


def _collect_lists(objects: Sequence[Any], path: Path, found: Columns, wanted: Collection[Path] | None) -> None:
    # A single value among lists is a list of one: writers such as MATLAB's jsonencode unwrap those.
    lists = [o if type(o) is list else [] if o is None else [o] for o in objects]
    lengths = np.fromiter(map(len, lists), np.int64, len(lists))
    inner: Columns = {}
    _collect(list(chain.from_iterable(lists)), path, inner, wanted)
    for inner_path, column in inner.items():
        if column.lengths is None:
            found[inner_path] = Column(column.values, lengths)
        elif column.lengths.size and (column.lengths == column.lengths[0]).all():
            width = int(column.lengths[0])
            if len(found) + width > MOST_FIELDS:
                raise TooManyFieldsError
            for j in range(width):
                found[(*inner_path, str(j))] = Column(column.values[j::width], lengths)
        else:
            found[inner_path] = Column(np.full(int(lengths.sum()), np.nan), lengths)


def as_array(values: Sequence[Any]) -> np.ndarray:
    """Return float64 where all values are numbers, truth values or None, else objects."""
    if set(map(type, values)) <= _NUMBERS:
        try:
            return np.array(values, dtype=np.float64)
        except OverflowError:
            return np.array([_number(value) for value in values], dtype=np.float64)
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


def _number(value: Any) -> float:
    if value is None:
        return np.nan
    try:
        return float(value)
    except OverflowError:
        return np.inf if value > 0 else -np.inf


def numbers(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Return `values` as float64 and how many of them were no numbers (NaN in their place)."""
    if values.dtype != object:
        return values, 0
    result = np.full(values.shape, np.nan)
    misfits = 0
    for i, value in enumerate(values):
        if isinstance(value, int | float) or value is None:
            result[i] = _number(value)
        elif value in _INFINITE_TEXTS:
            result[i] = _INFINITE_TEXTS[value]
        elif value not in _NO_NUMBER_TEXTS:
            misfits += 1
    return result, misfits


def texts(values: np.ndarray) -> np.ndarray:
    """Return `values` as texts, None where there is none."""
    result = np.empty(values.shape, dtype=object)
    if values.dtype == object:
        result[:] = [None if value is None or value != value else str(value) for value in values]
    else:
        result[:] = [None if np.isnan(value) else f"{value:g}" for value in values]
    return result


def are_texts(values: np.ndarray) -> bool:
    """Tell whether most of `values` are texts; a few that stand for no number (``"NaN"``, ``""``) do not count."""
    if values.dtype != object:
        return False
    numbers = sum(isinstance(value, int | float) for value in values)
    words = [value for value in values if isinstance(value, str)]
    meant = sum(word not in _NO_NUMBER_TEXTS and word not in _INFINITE_TEXTS for word in words)
    return meant > numbers or (numbers == 0 and "" in words)
