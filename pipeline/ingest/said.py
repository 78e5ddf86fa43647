"""What logs say of a run beside its samples: entries of headers, metadata records, columns of one constant value.

It settles which entry holds where several give one condition, and asks back where a name is nearly that of a
condition. What the values mean in SI, and the other places that give conditions, are the campaign's.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.naming import plain
from pipeline.ingest.reader import Entry, RawChannel, RawLog, RawTable
from pipeline.recording import QualityFinding
from pipeline.recording.units import quantity

_UNIT_BEHIND = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*)\s*[\])]\s*$")
_SHORTEST_MISSPELT = 6


class ConditionLike(Protocol):
    """What is asked of a condition's declaration, see `pipeline.rigs.experiment.ConditionSpec`."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def unit(self) -> str: ...  # noqa: D102


@dataclass(frozen=True)
class Said:
    """Entries by key, of each condition only the one that holds, and what is to be said of the others.

    `varying` tells by condition of columns that bear its name but hold several values: they give no condition.
    """

    metadata: Mapping[str, str]
    notes: tuple[QualityFinding, ...] = ()
    varying: Mapping[str, str] = field(default_factory=dict)


def said_by(logs: Sequence[RawLog], specs: Sequence[ConditionLike], channels: Collection[str] = ()) -> Said:
    """Gather what the logs of one run say.

    Parameters
    ----------
    specs
        The conditions that the experiment declares.
    channels
        Names of the channels that it declares, and of the log's columns that the recipe takes: a column of such
        a name is no condition, however constant.

    Notes
    -----
    Entries hold in this order: those of a file's header or metadata, from top to bottom, then its columns; then those
    of the next file.
    """
    notes: list[QualityFinding] = []
    by_condition: dict[str, list[Entry]] = {}
    metadata: dict[str, str] = {}
    known = {plain(spec.name): spec for spec in specs}
    passed_by = {plain(name) for name in channels} | {"time"}
    varying: dict[str, str] = {}
    for entry, is_column in _entries(logs, known, passed_by):
        name = _name(entry.key)
        if is_column and not entry.value:
            if name in known:
                varying.setdefault(known[name].name, entry.place)
            continue
        if name in known:
            by_condition.setdefault(name, []).append(entry)
            continue
        if name not in passed_by:
            notes += _asked_back(entry, known)
        if not is_column:
            metadata.setdefault(entry.key, entry.value)
    for name, entries in by_condition.items():
        holding, contradictions = _settled(known[name], entries)
        metadata[holding.key] = holding.value
        notes += contradictions
    return Said(metadata, tuple(notes), varying)


def _entries(
    logs: Sequence[RawLog], known: Mapping[str, ConditionLike], passed_by: Collection[str]
) -> Iterator[tuple[Entry, bool]]:
    """Yield all entries in the order in which they hold, and whether each is a column; one that varies has no value."""
    for log in logs:
        where = f" of {log.path.name}" if len(logs) > 1 else ""
        for entry in log.entries or [Entry(key, str(text), "the log's metadata") for key, text in log.metadata.items()]:
            if entry.value.strip():
                yield replace(entry, place=entry.place + where), False
        for table in log.tables:
            within = f" of '{table.name}'" if len(log.tables) > 1 else ""
            for channel in table.channels:
                if _may_be_condition(channel, known, passed_by):
                    yield from ((entry, True) for entry in _constant(table, channel, within + where))


def _may_be_condition(channel: RawChannel, known: Mapping[str, ConditionLike], passed_by: Collection[str]) -> bool:
    name = _name(channel.name)
    if channel.is_text or name in passed_by or plain(channel.name) in passed_by:
        return False
    return name in known or _misspelt(name, known) is not None


def _constant(table: RawTable, channel: RawChannel, where: str) -> list[Entry]:
    """Return the one value of a column; an entry without value where it has several, at the second of which reading ends."""
    value: float | None = None
    place, unit = f"the column '{channel.name}'{where}", channel.unit or ""
    for block in table.blocks([channel.name]):
        numbers = block[channel.name]
        present = numbers[np.isfinite(numbers)]
        first = float(present[0]) if value is None and present.size else value
        others = present[present != first]
        if others.size:
            values = f"first {first:.6g}, then {float(others[0]):.6g} {unit}".strip()
            return [Entry(channel.name, "", f"{place} holds several values ({values})")]
        value = first
    return [] if value is None else [Entry(channel.name, f"{value!r} {unit}".strip(), place)]


def _settled(spec: ConditionLike, entries: Sequence[Entry]) -> tuple[Entry, list[QualityFinding]]:
    """Return the entry that holds, the first that can be read, and a warning for each that contradicts it."""
    values = [_value(spec, entry) for entry in entries]
    at = next((place for place, value in enumerate(values) if value is not None), 0)
    notes = []
    for entry, value in zip(entries, values, strict=True):
        if entry is entries[at] or (value is not None and _same(values[at], value)):
            continue
        notes.append(
            QualityFinding(
                "warning",
                f"{spec.name} is '{entries[at].value}' by {entries[at].place} but '{entry.value}' by {entry.place}; "
                f"{entries[at].place} is used. Delete the wrong one, or give the right value in runs.csv.",
            )
        )
    return entries[at], notes


def _value(spec: ConditionLike, entry: Entry) -> float | str | None:
    if spec.unit == "":
        return entry.value.strip().casefold()
    match = _UNIT_BEHIND.match(entry.key)
    bare = re.fullmatch(r"[-+]?[\d.,]+(?:[eE][-+]?\d+)?", entry.value.strip())
    try:
        return quantity(f"{entry.value} {match[2]}" if match and bare else entry.value, spec.unit)
    except InputError:
        return None


def _same(one: float | str | None, other: float | str) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return abs(one - other) <= 1e-6 * max(abs(one), abs(other))
    return one == other


def _name(key: str) -> str:
    """Return the name in a key: without unit in brackets and without the path before its last dot."""
    match = _UNIT_BEHIND.match(key)
    return plain((match[1] if match else key).rsplit(".", 1)[-1])


def _asked_back(entry: Entry, known: Mapping[str, ConditionLike]) -> list[QualityFinding]:
    meant = _misspelt(_name(entry.key), known)
    if meant is None:
        return []
    return [
        QualityFinding(
            "warning",
            f"{entry.place} gives '{entry.key}' ({entry.value}), which is no condition of this experiment and is not "
            f"used. Did you mean '{meant}'?",
        )
    ]


def _misspelt(name: str, known: Mapping[str, ConditionLike]) -> str | None:
    """Return the condition that a name is a slip of the pen away from, one for each five letters; else None."""
    for right, spec in known.items():
        is_other = name != right and name.rstrip("0123456789_") != right and abs(len(name) - len(right)) <= 2
        if len(right) >= _SHORTEST_MISSPELT and is_other and _slips(name, right) <= min(2, len(right) // 5):
            return spec.name
    return None


def _slips(one: str, other: str) -> int:
    """Return how many letters must be put in, left out, changed or swapped with the next to make one word the other."""
    before, last = [0] * (len(other) + 1), list(range(len(other) + 1))
    for i, letter in enumerate(one, 1):
        row = [i]
        for j, wanted in enumerate(other, 1):
            cost = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (letter != wanted))
            if i > 1 and j > 1 and letter == other[j - 2] and one[i - 2] == wanted:
                cost = min(cost, before[j - 2] + 1)
            row.append(cost)
        before, last = last, row
    return last[-1]
