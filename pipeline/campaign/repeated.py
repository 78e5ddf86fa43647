"""One recording that was dropped twice, under whatever name, format or label: found by its samples.

Files of the same bytes are only one case. Recordings of one campaign are held against each other; whether runs that
differ agree is the experiment's to say.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from pipeline.campaign.conditions import DEFAULT, same, shown
from pipeline.errors import listing
from pipeline.recording import Condition, Recording
from pipeline.rigs.experiment import Experiment

# As many rows are held against each other first; fewer do not tell two recordings from one. Rigs that start from rest
# begin alike, so some later rows of the first block are too.
_HEAD = 20
_PLACES = np.array([*range(_HEAD), *(1 << k for k in range(5, 18))])
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
class Head:
    """What tells one recording from another without reading it: its labels, and of its channels of numbers some rows.

    Those are the first rows, and as many of the later `_PLACES` as there are.
    """

    run: str
    files: str
    labels: Mapping[str, Condition]
    first: Mapping[str, np.ndarray]
    rows: int

    @classmethod
    def of(cls, recording: Recording) -> Head:
        """Return the head of a recording; of its samples only the first block is read."""
        first: dict[str, np.ndarray] = {}
        rows = 0
        for stream in recording.streams.values():
            rows = max(rows, stream.size)
            if stream.size < _HEAD:
                continue
            names = list(stream.channels)
            _, columns = next(iter(stream.blocks(names)), (None, []))
            numbers = {name: c for name, c in zip(names, columns, strict=False) if c.dtype.kind == "f"}
            first.update({name: c[_PLACES[c.size > _PLACES]] for name, c in numbers.items()})
        sources = recording.provenance.condition_sources
        labels = {name: value for name, value in recording.conditions.items() if sources.get(name) != DEFAULT}
        return cls(recording.run, listing(source.path for source in recording.provenance.files), labels, first, rows)

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON can hold it, numbers to the last bit; `from_json` reads that."""
        return {**asdict(self), "first": {name: values.tobytes().hex() for name, values in self.first.items()}}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Head | None:
        """Return the head that `as_json` told, None where it did not."""
        try:
            first = {name: np.frombuffer(bytes.fromhex(values)) for name, values in content["first"].items()}
            head = cls(**{**content, "first": first})
        except (TypeError, ValueError, KeyError, AttributeError):
            return None
        if any(values.size > _PLACES.size for values in first.values()):
            return None
        sound = isinstance(head.run, str) and isinstance(head.files, str) and isinstance(head.rows, int)
        labels = isinstance(head.labels, dict) and all(
            isinstance(v, bool | int | float | str) for v in head.labels.values()
        )
        return head if sound and labels else None


def repeated(heads: Sequence[Head], recordings: Sequence[Recording], experiment: Experiment) -> list[Repeat]:
    """Return the runs whose samples stand in another run from its first row on.

    Of several the longest is the one that the others repeat, then the one with the most labels, then the first.
    A recording is read only where its first rows, which are among `heads` in the same order, are those of another.
    """
    entries = [(place, head) for place, head in enumerate(heads) if head.rows >= _HEAD]
    entries.sort(key=lambda entry: (-entry[1].rows, -len(entry[1].labels), entry[0]))
    found: dict[int, Repeat] = {}
    for (whole_at, whole), (part_at, part) in _alike(entries):
        if whole_at in found or part_at in found:
            continue
        if _holds(recordings[whole_at], recordings[part_at]):
            found[part_at] = _told(whole, part, experiment)
    return [found[place] for place in sorted(found)]


_Placed = tuple[int, Head]


def _alike(entries: Sequence[_Placed]) -> Iterator[tuple[_Placed, _Placed]]:
    """Yield pairs, the longer one first, that have the same channels and begin with the same rows."""
    groups: dict[tuple[str, ...], list[_Placed]] = {}
    for entry in entries:
        if entry[1].first:
            groups.setdefault(tuple(sorted(entry[1].first)), []).append(entry)
    for names, group in groups.items():
        rows = np.array([[_padded(head.first[name]) for name in names] for _, head in group])  # run, channel, place
        begins, rows = rows[..., :_HEAD].reshape(len(group), -1), rows.reshape(len(group), -1)
        margin = _ALIKE * np.nanmax(np.abs(rows), axis=1, initial=0.0)
        # Of ten thousand runs only those are held against each other that are alike in what differs most.
        telling = np.nan_to_num(begins[:, np.argmax([np.unique(column).size for column in begins.T])])
        order = np.argsort(telling, kind="stable")
        low = np.searchsorted(telling[order], telling - margin, "left")
        high = np.searchsorted(telling[order], telling + margin, "right")
        for at, whole in enumerate(group):
            near = np.sort(order[low[at] : high[at]])
            near = near[near > at]
            close = (np.abs(rows[near] - rows[at]) <= margin[at]) | np.isnan(rows[near])
            for other in near[close.all(axis=1)]:
                yield whole, group[int(other)]


def _padded(values: np.ndarray) -> np.ndarray:
    """Return a head's rows with NaN for those that a shorter recording does not have."""
    return np.pad(values, (0, _PLACES.size - values.size), constant_values=np.nan)


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


def _told(whole: Head, part: Head, experiment: Experiment) -> Repeat:
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
