"""One table on its way to SI: blocks of raw rows -> strictly increasing seconds and canonical channels.

Sound stamps pass in one reading. Where they do not increase, the stamps alone are read first and
repaired (`pipeline.ingest.stamps`), then the table is read again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from typing import Protocol

import numpy as np

from pipeline.errors import InputError, counted
from pipeline.ingest.blocks import Block, rebatched, rows_of
from pipeline.ingest.clock import Clock, TimeSource
from pipeline.ingest.clock_drift import ClockDrift, other_clock
from pipeline.ingest.entries import listed
from pipeline.ingest.mapping import Selection
from pipeline.ingest.quality.sampling import Sampling
from pipeline.ingest.row_order import reordered
from pipeline.ingest.sentinels import SentinelWatch
from pipeline.ingest.stamp_windows import repair_long
from pipeline.ingest.stamps import Repair
from pipeline.ingest.timebase import stated_rate
from pipeline.recording import QualityFinding

# Larger numbers measure nothing: they are a logger's way to write "no value".
_INFINITE = 1e100
# As many stamps tell the usual step between them.
_SEVERAL = 1000
# A stated rate is rounded; stamps may be off from it by so much.
_RATE_TOLERANCE = 1e-3
# Steps (s) as large as this are rather milliseconds of a logger of up to 20 kHz, or a count, where no unit is given.
_SLOW = 0.05


class Sink(Protocol):
    """What takes the blocks of a stream."""

    def add(self, time: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        """Take time (n,), s, and channels (n,) in SI by canonical name."""

    def restart(self) -> None:
        """Forget all blocks: they come again, with mended times."""


class _DisorderError(Exception):
    """The stamps do not increase."""


class StreamInSI:
    """One stream of a run, from its table to SI.

    Attributes
    ----------
    time, clock
        Where its time comes from; `pipeline.ingest.clock.align` may shift it before `pass_to`.
    repairs
        What was changed, complete after `pass_to`.
    beyond
        By channel, the largest finite magnitude (SI) that was taken as missing.
    """

    def __init__(self, selection: Selection, time: TimeSource, several: bool = False) -> None:
        """`several`: the run has other tables too, of which a rate in the header may be."""
        self.selection = selection
        self._several = several or len(selection.source.log.tables) > 1
        self.clock = Clock(selection.source, time)
        self.repairs: list[QualityFinding] = []
        self.beyond: dict[str, float] = {}
        self.time = time
        self._other_clock = other_clock(selection.source, time)
        self._drift = ClockDrift()
        names = [
            *([self._other_clock] if self._other_clock is not None else []),
            *([time.channel] if time.channel is not None else []),
            *(c.raw.name for c in selection.channels),
        ]
        self._names = list(dict.fromkeys(names))
        self._sentinels = {c.name: SentinelWatch() for c in selection.channels if c.unit and not c.raw.is_text}
        self._blocks = self._again()
        self._first = next(self._blocks, None)
        if self._first is not None:
            self._seconds(self._first, 0, None, _Tally())  # starts the clock

    def pass_to(self, sink: Sink) -> None:
        """Give all rows to a sink.

        Raises
        ------
        InputError
            If there are no rows, or time is beyond repair.
        """
        blocks: Iterator[Block] = chain([] if self._first is None else [self._first], self._blocks)
        self._first = None
        mended: Repair | None = None
        while True:
            try:
                rows = self._pass(blocks, sink, mended)
            except _DisorderError:
                mended = self._mended()
            else:
                if not self._new_sentinels():
                    break
            sink.restart()
            self.repairs = []
            blocks = self._again()
            if mended is not None and mended.order is not None:
                blocks = reordered(blocks, mended.order)
        self.repairs += mended.findings if mended is not None else []
        if not rows:
            raise InputError(
                f"{self.clock.where}: holds no rows with a time; export or record the log again, with its samples."
            )

    def notes(self, sampling: Sampling) -> list[QualityFinding]:
        """Return what is to be said of table, mapping and time after `pass_to`; `sampling` saw its times."""
        step = sampling.step
        said = [*self.selection.source.table.notes(), *self.selection.notes, *self.clock.notes, *self.repairs]
        if self.time.channel is not None and not self.time.stated and self.clock.begins is None:
            message = (
                f"{self.clock.where}: '{self.time.channel}' has no unit and is taken as seconds, which makes "
                f"{1.0 / step:.5g} samples a second."
            )
            if slow := step >= _SLOW:
                message += (
                    " Frequencies and speeds are wrong if it is not: say in the recipe "
                    f'`time: {{channel: "{self.time.channel}", unit: ms}}` or `unit: s` in it, and `rate: 5 kHz` in it '
                    "where samples are counted."
                )
            said.append(QualityFinding("warning" if slow else "note", message))
        if self._other_clock is not None and self.time.channel is not None:
            said += self._drift.findings(self.clock.where, self.time.channel, self._other_clock)
        return said + self._said_stated_rate(sampling)

    def _said_stated_rate(self, sampling: Sampling) -> list[QualityFinding]:
        """Say where the log states another rate than its stamps have, by more than both can be off."""
        if self._several or self.time.channel is None or not np.isfinite(sampling.mean_rate):
            return []
        stated = stated_rate(self.selection.source, but=self.time.channel)
        if stated is None:
            return []
        hertz, place = stated
        off = sampling.mean_rate / hertz - 1.0
        if abs(off) <= _RATE_TOLERANCE + 2.0 * sampling.step / sampling.duration:
            return []
        message = (
            f"{self.clock.where}: the stamps of '{self.time.channel}' make {sampling.mean_rate:.6g} samples a second, "
            f"{place} gives {hertz:.6g} Hz ({100 * off:+.2g} %); the stamps are used. Frequencies and speeds are wrong "
            "by as much if they are not right; `time: {rate: ...}` in the recipe counts samples instead."
        )
        return [QualityFinding("warning", message)]

    def _new_sentinels(self) -> bool:
        """Tell whether channels turned out to hold numbers that stand for no value; they are taken so from then on."""
        new = False
        for watch in self._sentinels.values():
            if not watch.masked and (found := watch.found()):
                watch.masked, new = found, True
        return new

    def _again(self) -> Iterator[Block]:
        return rebatched(self.selection.source.table.blocks(self._names))

    def _pass(self, blocks: Iterator[Block], sink: Sink, mended: Repair | None) -> int:
        """Pass blocks on and return the number of rows; `_DisorderError` where they are not in order."""
        self._drift = ClockDrift()
        timeless = _Tally()
        infinite = {channel.name: _Tally() for channel in self.selection.channels}
        no_value = {channel.name: _Tally() for channel in self.selection.channels}
        self.beyond = {}
        row, passed, last = 0, 0, -np.inf
        for block in blocks:
            time, keep = self._seconds(block, row, mended, timeless)
            row += rows_of(block)
            if not time.size:
                continue
            if time[0] <= last or (np.diff(time) <= 0).any():
                if mended is not None:
                    raise InputError(f"{self.clock.where}: the time stamps are too fine to be told apart as numbers.")
                raise _DisorderError
            last = time[-1]
            if self._other_clock is not None:
                other = np.asarray(block[self._other_clock], dtype=np.float64)
                self._drift.add(time, other if keep is None else other[keep])
            passed += time.size
            sink.add(time, self._channels(block, keep, time, infinite, no_value))
        self._say(timeless, infinite, no_value)
        return passed

    def _seconds(
        self, block: Block, row: int, mended: Repair | None, timeless: _Tally
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the times of a block that begins at `row`, and which of its rows have one (None: all)."""
        if self.time.channel is None:
            assert self.time.rate is not None  # a time source has one of them at least
            return np.arange(row, row + rows_of(block)) / self.time.rate, None
        logged = np.asarray(block[self.time.channel], dtype=np.float64)
        stamps = logged if mended is None else mended.stamps[row : row + logged.size]
        keep = None
        if not np.isfinite(stamps.sum()):
            keep = np.isfinite(stamps)
            stamps = stamps[keep]
            timeless.count(~np.isfinite(logged), row)
        if stamps.size:
            self.clock.start(
                float(stamps[0]), float(np.median(np.diff(stamps[:_SEVERAL]))) if stamps.size > 1 else np.nan
            )
        return self.clock.seconds(stamps), keep

    def _channels(
        self,
        block: Block,
        keep: np.ndarray | None,
        time: np.ndarray,
        infinite: Mapping[str, _Tally],
        no_value: Mapping[str, _Tally],
    ) -> Block:
        columns: Block = {}
        for channel in self.selection.channels:
            raw = block[channel.raw.name]
            raw = raw if keep is None else raw[keep]
            if (watch := self._sentinels.get(channel.name)) is not None:
                raw, gone = watch.look(raw)
                if gone is not None:
                    no_value[channel.name].count(gone, 0, time)
            with np.errstate(over="ignore", invalid="ignore"):
                values = channel.si(raw)
                suspect = channel.unit != "" and not abs(values.sum()) < _INFINITE
            if suspect and (wrong := np.abs(values) > _INFINITE).any():
                finite = np.abs(values[wrong & np.isfinite(values)])
                if finite.size:
                    self.beyond[channel.name] = max(self.beyond.get(channel.name, 0.0), float(finite.max()))
                values = np.where(wrong, np.nan, values)
                infinite[channel.name].count(wrong, 0, time)
            columns[channel.name] = values
        return columns

    def _mended(self) -> Repair:
        """Read the stamps alone, and what tells rows logged twice from rows with coarse stamps."""
        table, name = self.selection.source.table, self.time.channel
        assert name is not None  # counted samples are in order
        where = f"{self.clock.where}, channel '{name}'"

        def again() -> Iterator[np.ndarray]:
            return (np.asarray(block[name], dtype=np.float64) for block in table.blocks([name]))

        if any(channel.lists_entries for channel in self.selection.channels):
            return listed(np.concatenate(list(again())), self.clock.seconds_per_unit, where)
        first = next(self._again(), {})
        others = [first[other] for other in self._names if other != name and other in first]
        copies = None
        if others:
            same = np.logical_and.reduce([_same_as_before(values) for values in others])
            copies = np.concatenate(([False], same))
        return repair_long(again, copies, where, table.place_of)

    def _say(self, timeless: _Tally, infinite: Mapping[str, _Tally], no_value: Mapping[str, _Tally]) -> None:
        where = self.clock.where
        if timeless.n:
            message = (
                f"{where}: {counted(timeless.n, 'row')} without a time dropped, "
                f"first {self.selection.source.table.place_of(timeless.first_row)}."
            )
            self.repairs.append(QualityFinding("note" if timeless.n <= 2 else "warning", message))
        for channel in self.selection.channels:
            tally = no_value[channel.name]
            if tally.n:
                numbers = " and ".join(f"{value:.10g}" for value in sorted(self._sentinels[channel.name].masked))
                message = (
                    f"{channel.name}: {counted(tally.n, 'value')} logged as exactly {numbers}, far from all others: what "
                    f"loggers write for 'no value'. First at {tally.first_time:.6g} s, taken as missing."
                )
                self.repairs.append(QualityFinding("warning", message, channel=channel.name))
        for name, tally in infinite.items():
            if tally.n:
                told = counted(tally.n, "infinite value")
                if name in self.beyond:
                    told = (
                        f"{counted(tally.n, 'value')} infinite or beyond {_INFINITE:g}, up to {self.beyond[name]:.3g}"
                    )
                message = f"{name}: {told}, first at {tally.first_time:.6g} s, taken as missing."
                self.repairs.append(QualityFinding("warning", message, channel=name))


class _Tally:
    """Counts rows of a kind and keeps the place of the first."""

    def __init__(self) -> None:
        self.n = 0
        self.first_row = -1
        self.first_time = float("nan")

    def count(self, which: np.ndarray, row: int, time: np.ndarray | None = None) -> None:
        """Count rows `which` (n,) of a block that begins at `row`."""
        found = int(np.count_nonzero(which))
        if found and not self.n:
            at = int(np.argmax(which))
            self.first_row = row + at
            self.first_time = float("nan") if time is None else float(time[at])
        self.n += found


def _same_as_before(values: np.ndarray) -> np.ndarray:
    same: np.ndarray = values[1:] == values[:-1]
    if values.dtype.kind == "f":
        same |= np.isnan(values[1:]) & np.isnan(values[:-1])
    return same
