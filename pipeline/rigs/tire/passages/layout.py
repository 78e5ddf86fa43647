"""Where each row of the device's table stands on the grid of its samples (tire.md, 5.1).

The number of the sample tells it, else the packet counter, unwrapped with the help of time, else time alone. Values
are not read here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import InputError, counted
from pipeline.recording import Stream
from pipeline.rigs.tire.passages.clock import FRAMES, SMALL_COUNTER, bits_of, counts, frames_of, sample_rate, uneven

# A number of the sample that leaves what time tells by more than so many seconds (and this share of the jump) is wrong.
_STRAY, _STRAY_SHARE = 0.5, 0.02
# A counter that lags behind time by so many seconds stood still meanwhile: the transmitter slept.
_SLEEP = 0.05
# A packet comes late by no more than so many; a counter that leaps ahead of time by so many seconds began again.
_LATE, _LEAP = 50, 5.0
# A counter of so many bits tells the rate.
_COUNTS_TIME = 8
# Times that miss this share of the losses, of so many at least, do not know of them.
_MOSTLY, _FEW = 0.5, 4


@dataclass(frozen=True)
class Loss:
    """What the radio lost: share of the packets, longest gap (s), packets missing.

    `share` is NaN where it cannot be told (a gated log whose counter counts time).
    """

    share: float
    longest: float
    packets: int


@dataclass(frozen=True, eq=False)
class Layout:
    """Runs of consecutive samples.

    Attributes
    ----------
    rows, places
        First row of each run and its number on the grid (from 0), shape (r,) each.
    size
        Rows of the table.
    rate
        Samples per second of the device.
    begins
        When sample 0 was taken, s.
    loss
        What is missing, sleep of a gated transmitter left out where its counter tells it.
    counter_bits
        Of the packet counter as it wraps; 0 without one.
    slept
        Whether the counter stood while samples are missing.
    by
        What the grid was made from: ``sample_index``, ``packet_counter`` or ``time``.
    remarks
        What was found odd on the way, in sentences.
    untimed
        Whether a counter too short to count tells of losses that the times do not show.
    repeated
        Rows that came twice.
    """

    rows: np.ndarray
    places: np.ndarray
    size: int
    rate: float
    begins: float
    loss: Loss
    counter_bits: int
    slept: bool
    by: str
    remarks: tuple[str, ...] = ()
    untimed: bool = False
    repeated: int = 0

    @property
    def samples(self) -> int:
        """Length of the grid."""
        return int(self.places[-1]) + self.size - int(self.rows[-1])


def layout_of(stream: Stream, told: Mapping[str, float]) -> Layout:
    """Return the layout of the device's table, read in pieces.

    Parameters
    ----------
    stream
        Holds ``sample_index`` or ``packet_counter`` or neither.
    told
        Conditions as far as they are known: ``sample_rate`` (Hz), ``frames_per_packet``, ``counter_bits``, ``gated``.

    Raises
    ------
    InputError
        Where the table has fewer than two rows or its times tell no rate.
    """
    index, counter = ("sample_index" in stream.channels), ("packet_counter" in stream.channels)
    names = [name for name, there in (("sample_index", index), ("packet_counter", counter)) if there]
    grid: _Grid | None = None
    for time, columns in stream.blocks(names):
        found = dict(zip(names, columns, strict=True))
        if not time.size:
            continue
        if grid is None:
            grid = _Grid.begun(stream, time, found, told)
        grid.add(time, found.get("sample_index"), found.get("packet_counter"))
    if grid is None or grid.size < 2:
        raise InputError(
            f"stream '{stream.name}' holds {0 if grid is None else grid.size} samples of the transmitter; a run needs some "
            "turns of the wheel. Check the log."
        )
    return grid.layout()


@dataclass(eq=False)
class _Grid:
    """Takes the table block by block; keeps where runs begin."""

    rate: float
    frames: int
    bits: int
    gated: bool
    by: str
    remarks: list[str]
    size: int = 0
    _rows: list[np.ndarray] = field(default_factory=list)
    _places: list[np.ndarray] = field(default_factory=list)
    _offsets: list[float] = field(default_factory=list)
    _last: tuple[float, int] = (0.0, -1)
    _raw: float = -1.0
    _inside: int = 0
    _count: float = -1.0
    _lost: int = 0
    _longest: int = 0
    _slept: int = 0
    _strays: int = 0
    _jumps: int = 0
    _untimed: int = 0
    _strayed: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    @classmethod
    def begun(
        cls, stream: Stream, time: np.ndarray, found: Mapping[str, np.ndarray], told: Mapping[str, float]
    ) -> _Grid:
        """Look at the first block: rate, packets, counter."""
        remarks: list[str] = []
        index, counter = found.get("sample_index"), found.get("packet_counter")
        by = "sample_index" if counts(index) else "packet_counter" if counts(counter) else "time"
        if index is not None and by != "sample_index":
            remarks.append(f"sample_index does not count; the samples are placed by {by}")
        frames = FRAMES if told.get("frames_per_packet") is None else int(told["frames_per_packet"])
        bits = 0
        if counter is not None and counts(counter):
            frames = frames_of(counter, told.get("frames_per_packet"), remarks)
            bits = bits_of(counter, told.get("counter_bits"), remarks)
        number = index if by == "sample_index" else None
        if by == "packet_counter" and counter is not None and bits >= _COUNTS_TIME and uneven(time):
            half = 2.0 ** (bits - 1)
            number = frames * np.cumsum(np.mod(np.diff(counter, prepend=counter[0]) + half, 2.0 * half) - half)
        rate = sample_rate(stream, time, number, told.get("sample_rate"), remarks)
        return cls(rate, frames, bits, bool(told.get("gated", 0.0)), by, remarks)

    def add(self, time: np.ndarray, index: np.ndarray | None, counter: np.ndarray | None) -> None:
        """Place the next rows."""
        elapsed = np.diff(time, prepend=self._last[0]) * self.rate
        if counter is not None and self.bits:
            counter = _carried(counter, self._count)
        self._strayed = np.zeros(time.size, dtype=bool)
        packets = None
        if self.by == "sample_index" and index is not None:
            jump = self._by_index(elapsed, index)
        elif self.by == "packet_counter" and counter is not None:
            packets, jump = self._packets(elapsed, counter)
        else:
            jump = self._by_time(time)
        if self.size == 0:
            jump[0] = 0
        place = self._last[1] + np.cumsum(jump) if self.size else np.cumsum(jump)
        breaks = np.flatnonzero(jump != 1)
        if self.bits and counter is not None and self.by == "sample_index":
            packets = self._packets_across(counter, jump, breaks)
        elif packets is not None:
            packets = packets[breaks]
        self._rows.append(breaks + self.size)
        self._places.append(place[breaks])
        counted_on = ~self._strayed[breaks] & (breaks + self.size > 0)
        self._count_lost(jump[breaks[counted_on]] - 1, None if packets is None else packets[counted_on])
        some = slice(None, None, max(1, time.size // 1000))
        self._offsets.append(float(np.median(time[some] - place[some] / self.rate)))
        self._last = (float(time[-1]), int(place[-1]))
        self.size += time.size

    def layout(self) -> Layout:
        """Return what was found."""
        rows, places = np.concatenate(self._rows), np.concatenate(self._places)
        repeated = _repeated(rows, places, self.size)
        samples = max(self._lost + repeated, 0)
        share = samples / max(samples + self.size - repeated, 1)
        remarks = list(self.remarks)
        if self._strays:
            remarks.append(
                f"{self.by} jumps where time does not, {counted(self._strays, 'time')} (restart or wrap of the "
                "microcontroller's count): placed by time there"
            )
        return Layout(
            rows,
            places,
            self.size,
            self.rate,
            float(np.median(self._offsets)),
            Loss(
                math.nan if self.gated and not self._slept else share,
                self._longest / self.rate,
                round(samples / self.frames),
            ),
            self.bits,
            self._slept > 0,
            self.by,
            tuple(remarks),
            self.bits <= SMALL_COUNTER and self._untimed > _MOSTLY * max(self._jumps, _FEW),
            repeated,
        )

    def _by_index(self, elapsed: np.ndarray, index: np.ndarray) -> np.ndarray:
        """Return by how many samples each row is ahead of the one before; repeated numbers are those of packets.

        A packet that came late, or twice, steps back and stands where its number says.
        """
        step = np.diff(index, prepend=self._raw if self.size else index[0] - 1.0)
        self._raw = float(index[-1])
        if np.all(step == 1.0):
            return np.ones(step.size, dtype=np.int64)
        if np.any(step == 0.0):
            inside = _since(step != 0.0, self._inside)
            before = np.concatenate([[self._inside], inside[:-1]])
            self._inside = int(inside[-1])
            step = step + inside - before
        wrong = ~np.isfinite(step)
        far = np.abs(step - elapsed) > np.maximum(_STRAY * self.rate, _STRAY_SHARE * elapsed)
        if self.size == 0:
            far[0] = wrong[0] = False
        stray = wrong | far
        self._strays += int(stray.sum())
        self._strayed = stray
        return np.where(stray, np.maximum(np.round(elapsed), 1.0), step).astype(np.int64)

    def _by_time(self, time: np.ndarray) -> np.ndarray:
        begins = self._offsets[0] if self._offsets else float(time[0])
        place = np.round((time - begins) * self.rate).astype(np.int64)
        order = np.arange(time.size)
        place = np.maximum.accumulate(np.maximum(place, self._last[1] + 1 + order) - order) + order
        return np.diff(place, prepend=self._last[1])

    def _packets(self, elapsed: np.ndarray, counter: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return by how many packets, and by how many samples, each row is ahead of the one before.

        A counter that wrapped meanwhile (time tells how often) is unwrapped; one that stood while time passed (the
        transmitter slept) is placed by time.
        """
        step = np.diff(counter, prepend=self._count if self.size else counter[0] - 1.0)
        self._count = float(counter[-1])
        new = step != 0.0
        inside = _since(new, self._inside if self.size else 0)
        full = (inside > 0) & (inside % self.frames == 0)
        inside = inside % self.frames
        new = new | full
        before = np.concatenate([[self._inside if self.size else self.frames - 1], inside[:-1]])
        self._inside = int(inside[-1])
        packets, jump = np.zeros(step.size), np.ones(step.size, dtype=np.int64)
        at = np.flatnonzero(new)
        modulus = 2.0**self.bits
        ahead = np.mod(step[at], modulus)
        ahead[ahead == 0.0] = modulus
        by_time = (elapsed[at] + before[at]) / self.frames
        ahead = ahead + modulus * np.maximum(0.0, np.round((by_time - ahead) / modulus))
        # A packet that came late, or twice, steps back a little; what steps further is a count that began again.
        back = ahead - modulus
        late = (modulus > _LATE) & (np.abs(back) <= _LATE) & (np.abs(back - by_time) < np.abs(ahead - by_time))
        ahead = np.where(late, back, ahead)
        leaps = np.minimum(ahead - by_time, 0.5 * modulus + by_time - back) > _LEAP * self.rate / self.frames
        leaps |= ~late & (back < 0.0) & (modulus > 64 * _LATE) & (ahead - by_time > 0.5 * modulus)
        ahead = np.where(leaps, np.maximum(np.round(by_time), 1.0), ahead)
        self._strays += int(leaps.sum())
        self._strayed[at] = leaps
        jumps = (ahead > 1.0) & (at + self.size > 0)
        self._jumps += int(jumps.sum())
        self._untimed += int((jumps & (by_time < 1.5)).sum())
        packets[at] = ahead
        slack = 2.0 if self.gated else max(2.0, _SLEEP * self.rate / self.frames)
        behind = (by_time - ahead > slack) & ~late
        placed = np.where(behind, np.round(by_time), ahead)
        least = np.where(late, -np.inf, 1.0)
        jump[at] = np.maximum(np.round(placed * self.frames) - before[at], least).astype(np.int64)
        return packets, jump

    def _packets_across(self, counter: np.ndarray, jump: np.ndarray, breaks: np.ndarray) -> np.ndarray:
        """Return by how many packets the counter is ahead across each break that sample_index shows, wraps included."""
        before = np.where(breaks > 0, counter[breaks - 1], self._count)
        self._count = float(counter[-1])
        modulus = 2.0**self.bits
        ahead = np.mod(counter[breaks] - before, modulus)
        wraps = np.maximum(0.0, np.round((jump[breaks] / self.frames - ahead) / modulus))
        return np.asarray(ahead + modulus * wraps)

    def _count_lost(self, gap: np.ndarray, packets: np.ndarray | None) -> None:
        if not gap.size:
            return
        self._longest = max(self._longest, int(gap.max()))
        if packets is None:
            self._lost += int(gap.sum())
            return
        told = np.maximum(packets - 1.0, 0.0) * self.frames
        slept = gap - told > 1.5 * self.frames
        self._slept += int(slept.sum())
        self._lost += int(np.minimum(told, gap)[slept].sum()) + int(gap[~slept].sum())


def _carried(values: np.ndarray, before: float) -> np.ndarray:
    """Return the values with NaN as the last number ahead of it; `before` is that of the row before the first."""
    known = np.isfinite(values)
    if known.all():
        return values
    last = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    return np.where(last < 0, before, values[last])


def _since(new: np.ndarray, inside: int) -> np.ndarray:
    """Return how many rows before each the last new one stands; `inside` is that of the row before the first."""
    order = np.arange(new.size)
    last = np.maximum.accumulate(np.where(new, order, -1))
    return np.where(last < 0, order + inside + 1, order - last)


def _repeated(rows: np.ndarray, places: np.ndarray, size: int) -> int:
    """Return how many rows stand where the run of rows before them stands already: packets that came twice."""
    ends = places + np.diff(rows, append=size)
    again = (places[1:] < ends[:-1]) & (places[1:] >= places[:-1])
    return int((np.minimum(ends[1:], ends[:-1]) - places[1:])[again].sum())
