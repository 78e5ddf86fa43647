"""One recording that was dropped twice, under whatever name, format or label: found by its samples.

Files of the same bytes are only one case. Recordings of one campaign are held against each other; whether runs that
differ agree is the experiment's to say.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.campaign.conditions import DEFAULT, same, shown
from pipeline.errors import listing
from pipeline.recording import Condition, Recording
from pipeline.rigs.experiment import Experiment

# As many rows are held against each other first; fewer do not tell two recordings from one.
_HEAD = 20
# Samples that differ by less, of the largest, differ by how their numbers were written.
_ALIKE = 1e-6


@dataclass(frozen=True)
class Repeat:
    """A run whose samples are those of another, `of`, or their beginning; `message` says so of `run`.

    `contradicted` says it of `of` where the labels of the two differ, so that neither can be used; else ''.
    """

    run: str
    of: str
    message: str
    contradicted: str = ""


@dataclass(frozen=True)
class _Entry:
    """What is kept of a recording: its labels, and of its channels of numbers the first rows."""

    place: int
    run: str
    files: str
    labels: Mapping[str, Condition]
    heads: Mapping[str, np.ndarray]
    rows: int


def repeated(recordings: Sequence[Recording], experiment: Experiment) -> list[Repeat]:
    """Return the runs whose samples stand in another run from its first row on.

    Of several the longest is the one that the others repeat, then the one with the most labels, then the first.
    A recording is read whole only where its first rows are those of another.
    """
    entries = [_entry(place, recording) for place, recording in enumerate(recordings)]
    entries = [entry for entry in entries if entry.rows >= _HEAD]
    entries.sort(key=lambda entry: (-entry.rows, -len(entry.labels), entry.place))
    found: dict[int, Repeat] = {}
    for whole, part in _alike(entries):
        if whole.place in found or part.place in found:
            continue
        if _holds(recordings[whole.place], recordings[part.place]):
            found[part.place] = _told(whole, part, experiment)
    return [found[place] for place in sorted(found)]


def _entry(place: int, recording: Recording) -> _Entry:
    heads: dict[str, np.ndarray] = {}
    rows = 0
    for stream in recording.streams.values():
        rows = max(rows, stream.size)
        if stream.size < _HEAD:
            continue
        names = list(stream.channels)
        _, columns = next(iter(stream.blocks(names)), (None, []))
        heads.update({name: c[:_HEAD] for name, c in zip(names, columns, strict=False) if c.dtype.kind == "f"})
    sources = recording.provenance.condition_sources
    labels = {name: value for name, value in recording.conditions.items() if sources.get(name) != DEFAULT}
    files = listing(source.path for source in recording.provenance.files)
    return _Entry(place, recording.run, files, labels, heads, rows)


def _alike(entries: Sequence[_Entry]) -> Iterator[tuple[_Entry, _Entry]]:
    """Yield pairs, the longer one first, that have the same channels and begin with the same rows."""
    groups: dict[tuple[str, ...], list[_Entry]] = {}
    for entry in entries:
        if entry.heads:
            groups.setdefault(tuple(sorted(entry.heads)), []).append(entry)
    for names, group in groups.items():
        first = np.array([np.concatenate([entry.heads[name] for name in names]) for entry in group])
        largest = np.nanmax(np.abs(first), axis=1, initial=0.0)
        for at, whole in enumerate(group):
            close = np.abs(first[at + 1 :] - first[at]) <= _ALIKE * largest[at]
            close |= np.isnan(first[at + 1 :]) & np.isnan(first[at])
            for other in np.flatnonzero(close.all(axis=1)):
                yield whole, group[at + 1 + int(other)]


def _holds(whole: Recording, part: Recording) -> bool:
    """Tell whether all channels of `part` are those of `whole` from its first row on, and one of them is no set value."""
    moves = False
    for channel in part:
        values = channel.values
        if values.dtype.kind != "f":
            continue
        others = whole.values(channel.name)[: values.size]
        if others.size < values.size:
            return False
        close = np.abs(values - others) <= _ALIKE * np.nanmax(np.abs(values), initial=0.0)
        if not (close | (np.isnan(values) & np.isnan(others))).all():
            return False
        moves = moves or np.unique(values[np.isfinite(values)]).size >= _HEAD // 2
    return moves


def _told(whole: _Entry, part: _Entry, experiment: Experiment) -> Repeat:
    extent = "the same samples as" if part.rows == whole.rows else f"only the first {part.rows} samples of"
    differ = [name for name in part.labels if name in whole.labels and not same(part.labels[name], whole.labels[name])]
    if not differ:
        message = (
            f"{part.files} holds {extent} run '{whole.run}' ({whole.files}); it is counted once, as '{whole.run}'."
        )
        return Repeat(part.run, whole.run, message)
    units = {spec.name: spec.unit for spec in experiment.conditions}
    told = "; ".join(
        f"{name} is {shown(part.labels[name], units.get(name, ''))} by run '{part.run}' and "
        f"{shown(whole.labels[name], units.get(name, ''))} by run '{whole.run}'"
        for name in differ
    )
    contradiction = (
        f"but their labels contradict each other: {told}. Neither is used, as nothing tells which label is right; "
        "mend the wrong label, or take that run out with 'exclude' in the recipe."
    )
    other = f"{whole.files} holds the samples of run '{part.run}' ({part.files}), {contradiction}"
    return Repeat(
        part.run, whole.run, f"{part.files} holds {extent} run '{whole.run}' ({whole.files}), {contradiction}", other
    )
