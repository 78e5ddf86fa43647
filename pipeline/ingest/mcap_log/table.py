"""One topic as a table of raw channels, read block by block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.mcap_log import columns as cols
from pipeline.ingest.mcap_log.batches import Messages
from pipeline.ingest.mcap_log.columns import Columns, Path, TooManyFieldsError
from pipeline.ingest.mcap_log.fields import Field, Plan, channel_name, declared_step, sample_counts, values_of
from pipeline.ingest.mcap_log.noticed import Tally, loss_notes
from pipeline.ingest.mcap_log.sample_times import SampleClock
from pipeline.ingest.mcap_log.topics import Topic
from pipeline.ingest.reader import BLOCK_ROWS, RawChannel, RawTable
from pipeline.recording import QualityFinding

Rows = dict[str, np.ndarray]
# Decoded messages take some ten times the room of their bytes; usual chunks are smaller than this.
_DECODED_BYTES = 16 << 20
_MOST_NUMBERS = 1 << 26


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
        self.block_stamp = "first" if clock and plan.has_blocks and plan.times is None else None
        self.channels = (
            *([RawChannel(self._time, "s")] if clock else []),
            *(RawChannel(field.name, topic.declared.unit(field), field.is_text) for field in plan.fields),
        )
        self._known = {path for field in plan.fields for path in field.paths} | {plan.times or ()}
        self._ignored: set[str] = {part.split(" (")[0] for part in plan.left_out}
        self._tally = Tally()
        self._sample_clock = SampleClock()
        self._told_before = frozenset(messages.losses)

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[Rows]:
        """Yield the rows in file order; see `RawTable.blocks`."""
        self._tally = Tally()
        times = self._plan.times
        unit = self._topic.declared.unit(Field("", (times,))) if times is not None else None
        self._sample_clock = SampleClock(unit)
        fields = [field for field in self._plan.fields if names is None or field.name in names]
        with_time = self._clock is not None and (names is None or self._time in names)
        yield from _in_blocks(self._rows(fields, with_time, self._wanted(fields) if names is not None else None))

    def _wanted(self, fields: Sequence[Field]) -> set[Path]:
        """Return the paths to decode, with all their beginnings; the blocks' lengths are always needed."""
        always = [field for field in self._plan.fields if field.is_sample or field is self._plan.step]
        needed = [path for field in (*fields, *always) for path in field.paths]
        needed += [self._plan.times] if self._plan.times is not None else []
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
        for stamps, payloads in self._logged():
            try:
                columns, good = decode(payloads, wanted)
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

    def _logged(self) -> Iterator[tuple[np.ndarray, list[bytes]]]:
        """Yield stamps (s, shape (m,)) and payloads of the messages, as many at once as can be decoded in little memory."""
        repeated = sum(not field.is_sample for field in self._plan.fields) if self._plan.has_blocks else 0
        most = _DECODED_BYTES // (1 + repeated // 4)  # single values are repeated for each sample of a block
        for portion in range(len(self._messages.portions)):
            if not self._messages.may_hold(portion, self._topic.ids):
                continue
            batch = self._messages.batch(portion, self._topic.ids)
            for at in batch.parted(batch.of(self._topic.ids), most):
                yield (
                    self._seconds((batch.publish_times if self._clock == "publish" else batch.log_times)[at]),
                    batch.payloads(at),
                )

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
        if counts is not None and int(counts.sum()) * len(fields) > _MOST_NUMBERS:
            raise InputError(
                f"{self._messages.layout.path}: messages of the topic '{self.name}' repeat {len(fields)} channels for each of "
                f"{int(counts.sum())} samples, more than fits into memory. Record blocks and single values as topics of their own."
            )
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
            plain = self._plan.step is not None and self._topic.declared.unit(self._plan.step) in (None, "Hz", "s")
            step = declared_step(self._plan, columns) if plain else None
            if self.block_stamp == "last":
                return self._sample_clock.from_last_stamps(stamps, counts, step)
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
        told = list(self._tally.told(self._clock is not None, self._plan.has_blocks, self._sample_clock.gaps))
        notes = [QualityFinding(level, f"topic '{self.name}': {text}") for level, text in told]
        if self.block_stamp is not None and self._sample_clock.longest > 0:
            notes.append(self._said_stamp())
        return [*notes, *loss_notes(self._messages, self._zero, self._told_before)]

    def _said_stamp(self) -> QualityFinding:
        clock, is_first = self._sample_clock, self.block_stamp == "first"
        other = "last" if is_first else "first"
        text = (
            f"topic '{self.name}': a message holds a block of samples under one stamp, taken as that of the "
            f"{self.block_stamp} sample. Were it the {other}'s, all of them would be {clock.longest:.4g} s (one block) too "
            f"{'late' if is_first else 'early'} against other topics and files; say so in the recipe then, under "
            f"'channels': `time: {{stamp: {other}}}`."
        )
        if is_first and clock.for_last > 3 * clock.for_first:
            text += f" Blocks of different length speak for that: the {other} sample's, in {clock.for_last} places."
            return QualityFinding("warning", text)
        return QualityFinding("note", text)


def _second(stamp: Field) -> Field:
    """Return the nanoseconds of a stamp as a field."""
    return Field(stamp.name, stamp.paths[1:])


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
