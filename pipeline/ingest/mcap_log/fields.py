"""Which channels a topic has, and how their values are taken from the columns of its messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import listing
from pipeline.ingest.mcap_log import arrays
from pipeline.ingest.mcap_log.arrays import LONGEST_VECTOR, Lists
from pipeline.ingest.mcap_log.columns import Column, Columns, Path, are_texts
from pipeline.ingest.mcap_log.records import printable

_STAMPS = ({"sec", "nanosec"}, {"sec", "nsec"}, {"secs", "nsecs"}, {"seconds", "nanos"})


@dataclass(frozen=True)
class Field:
    """A channel of a topic: where its values stand in a message.

    `paths` is one, or two for a stamp (seconds, nanoseconds). `element` is the place in a vector;
    `is_sample` marks a list that gives a row a value; neither means one value a message.
    """

    name: str
    paths: tuple[Path, ...]
    is_text: bool = False
    element: int | None = None
    is_sample: bool = False

    @property
    def is_stamp(self) -> bool:
        """Tell whether this is a point in time in seconds."""
        return len(self.paths) == 2


@dataclass(frozen=True)
class Plan:
    """The fields of a topic.

    Of blocks, `times` is the list of times that they carry, `step` the scalar that declares their
    rate or step. `remarks` tell how lists were understood, `left_out` what cannot be a channel.
    """

    fields: tuple[Field, ...]
    times: Path | None = None
    step: Field | None = None
    remarks: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @property
    def has_blocks(self) -> bool:
        """Tell whether a message gives several rows."""
        return any(field.is_sample for field in self.fields)


def channel_name(path: Path) -> str:
    """Return the dotted name of a path; a message that is a bare number is called ``value``."""
    return printable(".".join(path)) or "value"


def plan(samples: Sequence[tuple[int, Columns]], fixed: Mapping[Path, int]) -> Plan:
    """Decide on the fields of a topic from surveyed messages.

    Parameters
    ----------
    samples
        Number of messages and their columns, by batch.
    fixed
        The list lengths that the schema fixes, by path.
    """
    scalars, lists = _seen(samples)
    stamps = _stamps([path for path, is_text in scalars.items() if not is_text])
    in_blocks, times = arrays.sampled(list(lists.values()), fixed)
    fields: list[Field] = []
    left_out: list[str] = []
    for path in dict.fromkeys(path for _, columns in samples for path in columns):
        name = channel_name(path)
        if path in stamps:
            if path == stamps[path][0]:
                fields.append(Field(channel_name(path[:-1]) if path[:-1] else "stamp", stamps[path]))
        elif path in scalars:
            fields.append(Field(name, (path,), scalars[path]))
        elif path == times and len(in_blocks) > 1 and arrays.start_anew(lists[path]):
            continue  # the rows' times hold all that these say
        elif path in in_blocks:
            fields.append(Field(name, (path,), lists[path].is_text, is_sample=True))
        elif path in lists:
            width = int(lists[path].lengths.max())
            if width > LONGEST_VECTOR:
                left_out.append(f"{name} (lists of up to {width} that fit neither a block nor a vector)")
            else:
                fields += [Field(f"{name}.{j}", (path,), lists[path].is_text, element=j) for j in range(width)]
    unique = {field.name: field for field in reversed(fields)}
    left_out += [f"{field.name} (the name occurs twice)" for field in fields if unique[field.name] is not field]
    kept = tuple(field for field in fields if unique[field.name] is field)
    step = next((f for f in kept if not f.is_text and f.paths[0] in scalars and _tells_step(f)), None)
    return Plan(kept, times, step, _remarks(lists, in_blocks), tuple(left_out))


def _tells_step(field: Field) -> bool:
    return arrays.declares_rate(field.paths[0]) or arrays.declares_step(field.paths[0])


def _seen(samples: Sequence[tuple[int, Columns]]) -> tuple[dict[Path, bool], dict[Path, Lists]]:
    """Join each field over the samples: the scalars with whether they are texts, and the lists.

    A scalar where other messages have a list is a list of one. Lists that are always empty are no fields.
    """
    scalars: dict[Path, bool] = {}
    lists: dict[Path, Lists] = {}
    for path in dict.fromkeys(path for _, columns in samples for path in columns):
        columns = [(count, found.get(path)) for count, found in samples]
        values = np.concatenate([column.values for _, column in columns if column is not None])
        is_text = are_texts(values)
        if all(column is None or column.lengths is None for _, column in columns):
            scalars[path] = is_text
        elif values.size:
            lengths = [np.zeros(count, np.int64) if column is None else _lengths(column) for count, column in columns]
            present = [_listed(column) for _, column in columns if column is not None]
            lists[path] = Lists(path, np.concatenate(present), np.concatenate(lengths), is_text)
    return scalars, lists


def _stamps(scalars: Sequence[Path]) -> dict[Path, tuple[Path, Path]]:
    """Return the pairs of seconds and nanoseconds, under the path of each."""
    children: dict[Path, list[Path]] = {}
    for path in scalars:
        if path:
            children.setdefault(path[:-1], []).append(path)
    found = {}
    for paths in children.values():
        if {path[-1] for path in paths} in _STAMPS:
            pair = (paths[0], paths[1]) if paths[0][-1].startswith("sec") else (paths[1], paths[0])
            found.update(dict.fromkeys(paths, pair))
    return found


def _remarks(lists: Mapping[Path, Lists], in_blocks: set[Path]) -> tuple[str, ...]:
    remarks = []
    if in_blocks:
        lengths = np.concatenate([lists[path].lengths for path in in_blocks])
        low, high = int(lengths[lengths > 0].min()), int(lengths.max())
        many = f"{low}" if low == high else f"{low} to {high}"
        names = listing(channel_name(path) for path in lists if path in in_blocks)
        remarks.append(f"{names}: blocks of {many} samples, the first at the message's stamp")
    vectors = [f"{channel_name(path)} ({lists[path].lengths.max()})" for path in lists if path not in in_blocks]
    if vectors:
        remarks.append(f"{listing(vectors)}: vectors, one channel a member")
    return tuple(remarks)


def values_of(field: Field, columns: Columns, counts: np.ndarray | None, messages: int) -> np.ndarray:
    """Return the raw values of a field, one a message or, for samples, `counts` (m,) a message.

    NaN stands where a message lacks the field.
    """
    column = columns.get(field.paths[0])
    if column is None:
        return np.full(messages if counts is None or not field.is_sample else int(counts.sum()), np.nan)
    if field.is_sample and counts is not None:
        return _padded(column, counts)
    return _member(column, field.element or 0, only=field.element is None)


def sample_counts(plan: Plan, columns: Columns, messages: int) -> np.ndarray:
    """Return how many rows each message gives, shape (m,): the length of its longest block."""
    counts = np.zeros(messages, dtype=np.int64)
    for field in plan.fields:
        column = columns.get(field.paths[0]) if field.is_sample else None
        if column is not None:
            counts = np.maximum(counts, _lengths(column))
    return counts


def declared_step(plan: Plan, columns: Columns) -> float | None:
    """Return the step (s) that the last message declares for its samples, if there is such a field."""
    column = columns.get(plan.step.paths[0]) if plan.step is not None else None
    if plan.step is None or column is None or column.values.dtype == object or not column.values.size:
        return None
    value = float(column.values[-1])
    if not value > 0:
        return None
    return 1.0 / value if arrays.declares_rate(plan.step.paths[0]) else value


def _member(column: Column, element: int, only: bool) -> np.ndarray:
    """Return one member of each list, NaN where there is none (`only`: or more than this one)."""
    if column.lengths is None:
        return column.values if element == 0 else np.full(column.values.shape, np.nan)
    has = column.lengths == 1 if only else column.lengths > element
    starts = np.cumsum(column.lengths) - column.lengths
    result = np.full(column.lengths.shape, np.nan, dtype=column.values.dtype)
    result[has] = column.values[starts[has] + element]
    return result


def _padded(column: Column, counts: np.ndarray) -> np.ndarray:
    """Return the lists of all messages, each filled up with NaN to its count."""
    lengths, values = _lengths(column), _listed(column)
    if np.array_equal(lengths, counts):
        return values
    result = np.full(int(counts.sum()), np.nan, dtype=values.dtype)
    owner = np.repeat(np.arange(counts.size), lengths)
    place = np.arange(owner.size) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    result[(np.cumsum(counts) - counts)[owner] + place] = values
    return result


def _lengths(column: Column) -> np.ndarray:
    """Return the lengths of a column's lists; a scalar is a list of one, a missing one of none."""
    if column.lengths is not None:
        return column.lengths
    if column.values.dtype == object:
        return np.array([value is not None for value in column.values], dtype=np.int64)
    return np.asarray(~np.isnan(column.values), dtype=np.int64)


def _listed(column: Column) -> np.ndarray:
    """Return the values of a column as those of lists, see `_lengths`."""
    return column.values if column.lengths is not None else column.values[_lengths(column) > 0]
