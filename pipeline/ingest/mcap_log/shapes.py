"""Which fields a topic has, and what a list of numbers in a message means.

The rule, in this order, for every field that holds a list:

1. A list that comes with a list of times of the same length is a block of samples.
2. A list whose length the schema fixes (``float64[9]``, ``minItems`` = ``maxItems``), or that comes
   with a list of names (as in a JointState), or is called a covariance, is a vector.
3. A list whose length changes, or is 8 or more, is a block of samples.
4. A list of 4 to 7 numbers is a block if its numbers run on from message to message as a sampled
   signal does; else, and with fewer numbers, it is a vector.

A block gives one row a sample, scalars are repeated; blocks of one message have the same length,
those of another length are taken as vectors. Lists of texts follow the numbers beside them. A vector
``p`` gives the channels ``p.0``, ``p.1``, ...
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import listing
from pipeline.ingest.mcap_log.columns import Column, Columns, Path, count_texts

_LONGEST_VECTOR = 256
_SURELY_SAMPLES = 8
_MAYBE_SAMPLES = 4
_TIME_NAMES = {"t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "sampletime", "sampletimes"}
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
    """The fields of a topic; `times` is the list of times that blocks carry; `remarks` tell the rule's use."""

    fields: tuple[Field, ...]
    times: Path | None = None
    remarks: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @property
    def has_blocks(self) -> bool:
        """Tell whether a message gives several rows."""
        return any(field.is_sample for field in self.fields)


@dataclass(frozen=True)
class _Seen:
    """All values of one field in the surveyed messages; `lengths` as in Column."""

    path: Path
    values: np.ndarray
    lengths: np.ndarray | None
    is_text: bool

    @property
    def name(self) -> str:
        return channel_name(self.path)

    @property
    def constant_length(self) -> int | None:
        """The length that all messages share that have the list at all."""
        present = self.lengths[self.lengths > 0] if self.lengths is not None else np.empty(0)
        return int(present[0]) if present.size and (present == present[0]).all() else None


def channel_name(path: Path) -> str:
    """Return the dotted name of a path; a message that is a bare number is called ``value``."""
    return ".".join(path) or "value"


def plan(samples: Sequence[tuple[int, Columns]], fixed: Mapping[Path, int]) -> Plan:
    """Decide on the fields of a topic from surveyed messages.

    Parameters
    ----------
    samples
        Number of messages and their columns, by batch.
    fixed
        The lengths that the schema fixes, by path; they hold for all fields below that path.
    """
    seen = [_seen(path, samples) for path in dict.fromkeys(path for _, columns in samples for path in columns)]
    seen = [field for field in seen if field.lengths is None or field.values.size]
    stamps = _stamps([field for field in seen if field.lengths is None])
    sampled, times = _sampled([field for field in seen if field.lengths is not None], fixed)
    fields: list[Field] = []
    vectors: dict[str, int] = {}
    left_out: list[str] = []
    for field in seen:
        if field.path in stamps:
            sec, nanosec = stamps[field.path]
            if field.path == sec:
                fields.append(Field(channel_name(sec[:-1]) if len(sec) > 1 else "stamp", (sec, nanosec)))
        elif field.lengths is None or field.path in sampled:
            fields.append(Field(field.name, (field.path,), field.is_text, is_sample=field.lengths is not None))
        else:
            width = int(field.lengths.max())
            if width > _LONGEST_VECTOR:
                left_out.append(f"{field.name} (lists of up to {width} that fit neither a block nor a vector)")
                continue
            vectors[field.name] = width
            fields += [Field(f"{field.name}.{j}", (field.path,), field.is_text, element=j) for j in range(width)]
    fields, repeated = _unique(fields)
    left_out += [f"{name} (the name occurs twice)" for name in repeated]
    return Plan(tuple(fields), times, _remarks([f for f in seen if f.path in sampled], vectors), tuple(left_out))


def _unique(fields: Sequence[Field]) -> tuple[list[Field], list[str]]:
    by_name: dict[str, Field] = {}
    repeated = []
    for field in fields:
        if by_name.setdefault(field.name, field) is not field:
            repeated.append(field.name)
    return list(by_name.values()), repeated


def _seen(path: Path, samples: Sequence[tuple[int, Columns]]) -> _Seen:
    """Join one field over the samples; a scalar among lists is a list of one."""
    columns = [(count, columns.get(path)) for count, columns in samples]
    is_list = any(column is not None and column.lengths is not None for _, column in columns)
    values, lengths = [], []
    for count, column in columns:
        if column is None:
            values.append(np.empty(0) if is_list else np.full(count, np.nan))
            lengths.append(np.zeros(count, np.int64))
        else:
            values.append(column.values)
            lengths.append(np.ones(count, np.int64) if column.lengths is None else column.lengths)
    joined = np.concatenate(values)
    found_numbers, found_texts = count_texts(joined)
    return _Seen(path, joined, np.concatenate(lengths) if is_list else None, found_texts > found_numbers)


def _stamps(scalars: Sequence[_Seen]) -> dict[Path, tuple[Path, Path]]:
    """Return the pairs of seconds and nanoseconds, under the path of each."""
    children: dict[Path, list[Path]] = {}
    for field in scalars:
        if field.path and not field.is_text:
            children.setdefault(field.path[:-1], []).append(field.path)
    found = {}
    for paths in children.values():
        if {path[-1] for path in paths} in _STAMPS:
            pair = (paths[0], paths[1]) if paths[0][-1].startswith("sec") else (paths[1], paths[0])
            found.update(dict.fromkeys(paths, pair))
    return found


def _sampled(lists: Sequence[_Seen], fixed: Mapping[Path, int]) -> tuple[set[Path], Path | None]:
    """Return the lists that are blocks of samples, and the one among them that holds their times."""
    names = [field for field in lists if field.is_text and _are_names(field)]
    times = next((field for field in lists if _are_times(field)), None)
    if times is not None:
        candidates = [field for field in lists if _share_length(field, times)]
        return {field.path for field in candidates}, times.path
    candidates = [field for field in lists if not field.is_text and not _is_vector(field, fixed, names)]
    if not candidates:
        return set(), None
    candidates += [field for field in lists if field.is_text and field not in names]

    def company(field: _Seen) -> tuple[int, int]:
        return sum(_share_length(other, field) for other in candidates), field.values.size

    leader = max(candidates, key=company)
    return {field.path for field in candidates if _share_length(field, leader)}, None


def _share_length(field: _Seen, leader: _Seen) -> bool:
    """Tell whether two lists mostly have the same length, where a message has both."""
    assert field.lengths is not None
    assert leader.lengths is not None
    both = (field.lengths > 0) & (leader.lengths > 0)
    same = np.count_nonzero(field.lengths[both] == leader.lengths[both])
    return bool(same >= 0.9 * np.count_nonzero(both)) and bool(both.any())


def _are_times(field: _Seen) -> bool:
    if field.is_text or field.lengths is None or field.values.dtype == object:
        return False
    word = re.sub(r"[^a-z]", "", field.path[-1].lower()) if field.path else ""
    if word not in _TIME_NAMES or field.lengths.max(initial=0) < 2:
        return False
    owner = np.repeat(np.arange(field.lengths.size), field.lengths)
    within = owner[1:] == owner[:-1]
    return bool(np.all(np.diff(field.values)[within] > 0))


def _are_names(field: _Seen) -> bool:
    """Tell whether each message repeats the same list of different words."""
    width = field.constant_length
    if width is None or width > _LONGEST_VECTOR:
        return False
    rows = field.values.reshape(-1, width)
    return bool((rows == rows[0]).all()) and len(set(rows[0].tolist())) == width


def _is_vector(field: _Seen, fixed: Mapping[Path, int], names: Sequence[_Seen]) -> bool:
    if any(field.path[:n] in fixed for n in range(len(field.path) + 1)) or "covariance" in field.name.lower():
        return True
    if any(_share_length(field, other) for other in names):
        return True
    width = field.constant_length
    if width is None or width >= _SURELY_SAMPLES:
        return False
    return width < _MAYBE_SAMPLES or not _runs_on(field.values, width)


def _runs_on(values: np.ndarray, width: int) -> bool:
    """Tell whether short lists are one signal cut into pieces.

    Neighbours in the signal then differ less than samples `width` apart, also across the cut. The
    members of a vector do not: the same member of successive messages differs least.
    """
    if values.dtype == object or values.size < 4 * width:
        return False
    rows = values.reshape(-1, width)
    within = np.nanmean(np.abs(np.diff(rows, axis=1)))
    across = np.nanmean(np.abs(rows[1:, 0] - rows[:-1, -1]))
    apart = np.nanmean(np.abs(np.diff(rows, axis=0)))
    return bool(apart > 2.0 * within and across < 2.0 * within)


def _remarks(sampled: Sequence[_Seen], vectors: Mapping[str, int]) -> tuple[str, ...]:
    remarks = []
    if sampled:
        lengths = np.concatenate([field.lengths for field in sampled if field.lengths is not None])
        low, high = int(lengths[lengths > 0].min()), int(lengths.max())
        many = f"{low}" if low == high else f"{low} to {high}"
        remarks.append(f"{listing(field.name for field in sampled)}: blocks of {many} samples a message")
    if vectors:
        told = listing(f"{name} ({width})" for name, width in vectors.items())
        remarks.append(f"{told}: vectors, one channel a member")
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
    lengths = _lengths(column)
    if np.array_equal(lengths, counts):
        return column.values
    values = column.values if column.lengths is not None else column.values[lengths > 0]
    result = np.full(int(counts.sum()), np.nan, dtype=column.values.dtype)
    owner = np.repeat(np.arange(counts.size), lengths)
    place = np.arange(owner.size) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    result[(np.cumsum(counts) - counts)[owner] + place] = values
    return result


def sample_counts(plan: Plan, columns: Columns, messages: int) -> np.ndarray:
    """Return how many rows each message gives, shape (m,): the length of its longest block."""
    counts = np.zeros(messages, dtype=np.int64)
    for field in plan.fields:
        column = columns.get(field.paths[0]) if field.is_sample else None
        if column is not None:
            counts = np.maximum(counts, _lengths(column))
    return counts


def _lengths(column: Column) -> np.ndarray:
    """Return the lengths of a column's lists; a scalar is a list of one, a missing one of none."""
    if column.lengths is not None:
        return column.lengths
    if column.values.dtype == object:
        return np.ones(column.values.shape, np.int64)
    return np.asarray(~np.isnan(column.values), dtype=np.int64)
