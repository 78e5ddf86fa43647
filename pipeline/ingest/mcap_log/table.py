"""One topic as a table of raw channels, read block by block."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import counted
from pipeline.ingest.mcap_log import columns as cols
from pipeline.ingest.mcap_log.batches import Messages
from pipeline.ingest.mcap_log.columns import Columns, Path, TooManyFieldsError
from pipeline.ingest.mcap_log.fields import Field, Plan, channel_name, declared_step, sample_counts, values_of
from pipeline.ingest.mcap_log.sample_times import SampleClock
from pipeline.ingest.mcap_log.topics import Topic
from pipeline.ingest.reader import BLOCK_ROWS, RawChannel, RawTable
from pipeline.recording import Level, QualityFinding

Rows = dict[str, np.ndarray]


@dataclass
class _Tally:
    """What was noticed in one pass over a topic; times in s, from the start of the log."""

    messages: int = 0
    malformed: int = 0
    first_malformed: float | None = None
    backward: int = 0
    misfits: dict[str, int] = field(default_factory=dict)
    unknown: dict[str, float] = field(default_factory=dict)
    ragged: int = 0
    too_wide: float | None = None


class TopicTable(RawTable):
    """The messages of one topic: a row a message, or a row a sample where messages hold blocks.

    `zero` (ns) is second zero of the log. `clock` names the stamp that is used, ``log`` or ``publish``;
    None where neither tells the rows' times, then the table has no time of its own.
    """

    def __init__(self, messages: Messages, topic: Topic, plan: Plan, zero: int, clock: str | None) -> None:
        self.name = topic.name
        self._messages = messages
        self._topic = topic
        self._plan = plan
        self._zero = zero
        self._clock = clock
        taken = {field.name for field in plan.fields}
        self._time = next(name for name in ("log_time", "mcap.log_time", "mcap..log_time") if name not in taken)
        self.time_channel = self._time if clock else None
        self.channels = (
            *([RawChannel(self._time, "s")] if clock else []),
            *(RawChannel(field.name, topic.declared.unit(field), field.is_text) for field in plan.fields),
        )
        self._known = {path for field in plan.fields for path in field.paths} | {plan.times or ()}
        self._ignored: set[str] = {part.split(" (")[0] for part in plan.left_out}
        self._tally = _Tally()
        self._sample_clock = SampleClock()
        self._told_before = frozenset(messages.losses)

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[Rows]:
        """Yield the rows in file order; see `RawTable.blocks`."""
        self._tally = _Tally()
        times = self._plan.times
        unit = self._topic.declared.unit(Field("", (times,))) if times is not None else None
        self._sample_clock = SampleClock(unit)
        fields = [field for field in self._plan.fields if names is None or field.name in names]
        with_time = self._clock is not None and (names is None or self._time in names)
        yield from _in_blocks(self._rows(fields, with_time, self._wanted(fields) if names is not None else None))

    def _wanted(self, fields: Sequence[Field]) -> set[Path]:
        """Return the paths to decode, with all their beginnings; the blocks' lengths are always needed."""
        needed = [path for field in fields for path in field.paths]
        needed += [
            path for field in self._plan.fields if field.is_sample or field is self._plan.step for path in field.paths
        ]
        return {path[:n] for path in needed for n in range(len(path) + 1)} | {()}

    def _rows(self, fields: Sequence[Field], with_time: bool, wanted: set[Path] | None) -> Iterator[Rows]:
        """Yield the rows of each batch; the last message of a batch needs the stamp of the next one."""
        held: tuple[np.ndarray, Columns] | None = None
        for stamps, columns in self._decoded(wanted):
            if held is not None:
                yield self._assembled(fields, with_time, *held, float(stamps[0]))
            held = stamps, columns
        if held is not None:
            yield self._assembled(fields, with_time, *held, None)

    def _decoded(self, wanted: set[Path] | None) -> Iterator[tuple[np.ndarray, Columns]]:
        """Yield stamps (s, shape (m,)) and columns of the well-formed messages of each batch."""
        tally, decode = self._tally, self._topic.decode
        assert decode is not None
        latest = -np.inf
        for portion in range(len(self._messages.portions)):
            if not self._messages.may_hold(portion, self._topic.ids):
                continue
            batch = self._messages.batch(portion)
            at = batch.of(self._topic.ids)
            if not at.size:
                continue
            stamps = self._seconds((batch.publish_times if self._clock == "publish" else batch.log_times)[at])
            try:
                columns, good = decode(batch.payloads(at), wanted)
            except TooManyFieldsError:
                tally.too_wide = tally.too_wide if tally.too_wide is not None else float(stamps[0])
                continue
            if good is not None:
                if tally.first_malformed is None:
                    tally.first_malformed = float(stamps[~good][0])
                tally.malformed += int(np.count_nonzero(~good))
                stamps = stamps[good]
            if not stamps.size:
                continue
            tally.messages += stamps.size
            tally.backward += int(np.count_nonzero(np.diff(stamps, prepend=max(latest, stamps[0])) < 0))
            latest = float(stamps[-1])
            if wanted is None:
                self._note_unknown(columns, stamps)
            yield stamps, columns

    def _seconds(self, times: np.ndarray) -> np.ndarray:
        # The difference is taken in integers: a float64 of an epoch in ns is 256 ns coarse.
        return (times - np.uint64(self._zero)).astype(np.int64) / 1e9

    def _note_unknown(self, columns: Columns, stamps: np.ndarray) -> None:
        for path, column in columns.items():
            if path in self._known or channel_name(path) in self._ignored:
                continue
            has_any = column.values.size and (column.values.dtype == object or not np.isnan(column.values).all())
            if has_any and not any(known[: len(path)] == path for known in self._known):
                self._tally.unknown.setdefault(channel_name(path), float(stamps[0]))

    def _assembled(
        self, fields: Sequence[Field], with_time: bool, stamps: np.ndarray, columns: Columns, following: float | None
    ) -> Rows:
        """Turn the columns of a batch into rows."""
        messages = stamps.size
        counts = sample_counts(self._plan, columns, messages) if self._plan.has_blocks else None
        rows: Rows = {}
        if with_time:
            rows[self._time] = self._times(stamps, columns, counts, following)
        for wanted in fields:
            values = self._typed(wanted, values_of(wanted, columns, counts, messages))
            if wanted.is_stamp:
                values = values + self._typed(wanted, values_of(_second(wanted), columns, counts, messages)) * 1e-9
            if counts is not None and not wanted.is_sample:
                values = np.repeat(values, counts)
            rows[wanted.name] = values
        if counts is not None:
            self._note_ragged(columns, counts)
        return rows

    def _times(
        self, stamps: np.ndarray, columns: Columns, counts: np.ndarray | None, following: float | None
    ) -> np.ndarray:
        if counts is None:
            return stamps
        if self._plan.times is None:
            step = declared_step(self._plan, columns)
            return self._sample_clock.from_stamps(stamps, counts, following, step)
        carried = Field(channel_name(self._plan.times), (self._plan.times,), is_sample=True)
        values, _ = cols.numbers(values_of(carried, columns, counts, stamps.size))
        return self._sample_clock.from_carried(stamps, counts, values)

    def _typed(self, field: Field, values: np.ndarray) -> np.ndarray:
        if field.is_text:
            return cols.texts(values)
        result, misfits = cols.numbers(values)
        if misfits:
            self._tally.misfits[field.name] = self._tally.misfits.get(field.name, 0) + misfits
        return result

    def _note_ragged(self, columns: Columns, counts: np.ndarray) -> None:
        for sampled in (f for f in self._plan.fields if f.is_sample):
            column = columns.get(sampled.paths[0])
            if column is not None and column.lengths is not None:
                self._tally.ragged += int(np.count_nonzero((column.lengths != counts) & (column.lengths > 0)))

    def notes(self) -> Sequence[QualityFinding]:
        """Return what was noticed in the last pass; see `RawTable.notes`."""
        told = [QualityFinding(level, f"topic '{self.name}': {text}") for level, text in self._told()]
        return [*told, *loss_notes(self._messages, self._zero, self._told_before)]

    def _told(self) -> Iterator[tuple[Level, str]]:
        tally = self._tally
        if tally.malformed:
            told = counted(tally.messages + tally.malformed, "message")
            first = f"{tally.first_malformed:.6g} s" if tally.first_malformed is not None else "the start"
            yield "warning", f"{tally.malformed} of {told} malformed and left out, the first at {first}."
        for name, count in tally.misfits.items():
            told = counted(count, "value")
            yield "warning", f"'{name}' is a number in most messages but not in {told}, which became NaN."
        for name, time in tally.unknown.items():
            told = f"the field '{name}' turned up at about {time:.6g} s only"
            yield "warning", f"{told}, was in none of the messages looked at before, and was left out."
        if tally.too_wide is not None:
            yield "warning", f"messages from {tally.too_wide:.6g} s on have thousands of fields and were left out."
        if tally.ragged:
            told = counted(tally.ragged, "list")
            yield "warning", f"{told} shorter than others of the same message, filled up with NaN."
        if tally.backward:
            told = counted(tally.backward, "message")
            yield "note", f"{told} logged after a later one; the rows are in the order of the file."
        if self._sample_clock.gaps:
            told = counted(self._sample_clock.gaps, "block")
            yield "note", f"{told} of samples followed by a gap, timed with the step of the block before."
        if self._clock is None and self._plan.has_blocks and tally.messages == 1:
            yield "note", "one message alone holds a block of samples, and nothing in it tells their rate."
        elif self._clock is None:
            yield "note", "all messages bear the same time stamp, so it cannot serve as the time."


def _second(stamp: Field) -> Field:
    """Return the nanoseconds of a stamp as a field."""
    return Field(stamp.name, stamp.paths[1:])


def loss_notes(messages: Messages, zero: int, told_before: Collection[int] = ()) -> list[QualityFinding]:
    """Return what could not be used of chunks; `zero` (ns) is second zero, `told_before` are offsets."""
    notes = []
    for loss in messages.losses.values():
        if loss.offset in told_before:
            continue
        span = ((loss.start_time - zero) / 1e9, (loss.end_time - zero) / 1e9) if loss.start_time >= zero else None
        when = f" ({span[0]:.6g} s to {span[1]:.6g} s)" if span else ""
        how = "left out" if loss.left_out else "read in part"
        text = f"a chunk at byte {loss.offset}{when} was {how}: {loss.reason}."
        notes.append(QualityFinding("warning", text, span=span))
    return notes


def _in_blocks(parts: Iterator[Rows]) -> Iterator[Rows]:
    """Join and cut parts to blocks of `BLOCK_ROWS` rows; the last one is what is left."""
    waiting: list[Rows] = []
    count = 0
    for part in parts:
        waiting.append(part)
        count += len(next(iter(part.values()), ()))
        if count >= BLOCK_ROWS:
            joined = _joined(waiting)
            whole = count - count % BLOCK_ROWS
            for start in range(0, whole, BLOCK_ROWS):
                yield {name: values[start : start + BLOCK_ROWS] for name, values in joined.items()}
            waiting = [{name: values[whole:] for name, values in joined.items()}]
            count -= whole
    if count:
        yield _joined(waiting)


def _joined(parts: Sequence[Rows]) -> Rows:
    if len(parts) == 1:
        return dict(parts[0])
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
