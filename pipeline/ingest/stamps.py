"""Repair of time stamps that do not increase: out of order, repeated, coarse, backward, wrapped, started again.

Works on stamps that are held at once: those of a short log, or a part of a long one (`stamp_windows`). Sound logs, which
are most, never come here. Every change is a finding that goes into the provenance.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from pipeline.errors import InputError, counted
from pipeline.ingest.row_order import Rows, sorted_rows
from pipeline.ingest.stamp_changes import Change, CoarseSpread, Other, RepeatsDropped, RowsDropped, RowsSorted
from pipeline.recording import QualityFinding

# At most this part of the steps may lead backward, and at most this part of the rows may be lost to that.
_FEW = 0.01
# From this part of repeated stamps on they are coarse, not disturbed: 1 ms stamps from 1.1 kHz on.
_COARSE = 0.1
# Fewer rows than this do not tell coarse stamps from disturbed ones.
_SEVERAL = 20
# What counters of loggers wrap at: 16, 24, 31 and 32 bit.
_WRAPS = tuple(float(1 << bits) for bits in (16, 24, 31, 32))
_SHARED = re.compile(r"time stamps are coarse, ([0-9.e+]+) rows share one")


@dataclass
class Repair:
    """The stamps of all rows, shape (n,), in the log's unit: strictly increasing, NaN for rows to drop.

    `order` (n,) are the rows of the file in the order in which these stamps are theirs; None for that of the file.
    `changes` are what `findings` say.
    """

    stamps: Rows
    order: Rows | None = None
    findings: list[QualityFinding] = field(default_factory=list)
    changes: list[Change] = field(default_factory=list)


Place = Callable[[int], str]


def row_number(row: int) -> str:
    """Name a row by its number from 1, where nothing better is known."""
    return f"row {row + 1}"


def repair(stamps: np.ndarray, copies: np.ndarray | None, where: str, place: Place = row_number) -> Repair:
    """Make stamps strictly increasing.

    Parameters
    ----------
    stamps
        As logged, shape (n,), NaN where a row has none.
    copies
        For the first rows, whether a row repeats all values of the row before it, shape (m,).
    where
        File and channel, for messages.
    place
        Names the place of a row in the file, for messages.

    Raises
    ------
    InputError
        If time stands still, runs backward, or starts again so often that no longest part stands out.
    """
    rows = np.flatnonzero(np.isfinite(stamps))
    time = stamps[rows]
    changes: list[Change] = []
    time = _unwrapped(time, rows, where, place, changes)
    steps = np.diff(time)
    if time.size > 1 and not steps.any():
        raise InputError(
            f"{where}: time stands still at {time[0]:g} in all {time.size} rows. Name another channel as time in the "
            "recipe, or give the rate: `time: {rate: 5 kHz}`."
        )
    backward = np.flatnonzero(steps < 0)
    order = None
    if backward.size and (by_time := sorted_rows(time)) is not None:
        changes.append(_rows_sorted(time, by_time, backward, rows, place))
        order = np.arange(stamps.size)
        order[rows] = rows[by_time]
        time, copies = time[by_time], None
    elif backward.size:
        _refuse_if_mostly_backward(time, backward, rows, where, place)
        stay = _increasing(time)
        changes.append(_rows_dropped(time, stay, backward, rows, where, place))
        time, rows = time[stay], rows[stay]
    repeated = np.diff(time) == 0
    if repeated.any():
        part = float(repeated.mean())
        if part < _COARSE or time.size < _SEVERAL or _are_copies(rows, repeated, copies):
            changes.append(_repeats_dropped(time, repeated, rows, place))
            stay = np.append(True, ~repeated)
            time, rows = time[stay], rows[stay]
        else:
            changes.append(CoarseSpread(int(repeated.sum()), repeated.size))
            time = _spread(time)
    mended = np.full(stamps.size, np.nan)
    mended[rows] = time
    return Repair(mended, order, [change.told(where) for change in changes], changes)


def rows_per_stamp(quality: Iterable[QualityFinding]) -> float:
    """Return how many rows shared a stamp in the coarsest table of a run, 1 where none did, from what was said on repair."""
    shared = [float(found[1]) for finding in quality if (found := _SHARED.search(finding.message))]
    return max(shared, default=1.0)


def _repeats_dropped(time: np.ndarray, repeated: np.ndarray, rows: np.ndarray, place: Place) -> RepeatsDropped:
    first = int(np.argmax(repeated))
    return RepeatsDropped(int(repeated.sum()), repeated.size, float(time[first]), place(int(rows[first + 1])))


def _rows_sorted(
    time: np.ndarray, order: np.ndarray, backward: np.ndarray, rows: np.ndarray, place: Place
) -> RowsSorted:
    moved = np.flatnonzero(order != np.arange(order.size))
    furthest = int(np.abs(order - np.arange(order.size)).max())
    late = float((np.maximum.accumulate(time) - time).max())
    at = int(backward[0])
    return RowsSorted(moved.size, furthest, late, (float(time[at]), float(time[at + 1])), place(int(rows[at + 1])))


def _unwrapped(time: np.ndarray, rows: np.ndarray, where: str, place: Place, changes: list[Change]) -> np.ndarray:
    """Add what a counter of a fixed number of bits lost when it wrapped."""
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if not back.size or time.min() < 0 or not np.array_equal(time[back], np.round(time[back])):
        return time
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    for wrap in _WRAPS:
        if time.max() < wrap and (np.abs(steps[back] + wrap - usual) <= max(2 * usual, 2.0)).all():
            added = np.zeros(time.size)
            added[back + 1] = wrap
            message = (
                f"{where}: the time counter wrapped {counted(back.size, 'time')} at {wrap:.0f}, first in "
                f"{place(int(rows[back[0] + 1]))}; the time is continued."
            )
            changes.append(Other(QualityFinding("note", message)))
            unwrapped: np.ndarray = time + np.cumsum(added)
            return unwrapped
    return time


def _refuse_if_mostly_backward(
    time: np.ndarray, backward: np.ndarray, rows: np.ndarray, where: str, place: Place
) -> None:
    part = backward.size / (time.size - 1)
    if backward.size <= max(_FEW * time.size, 1) and part < 0.5:
        return
    at = int(backward[0])
    raise InputError(
        f"{where}: time runs backward in {backward.size} of {time.size - 1} steps ({100 * part:.3g} %), first from "
        f"{time[at]:.9g} to {time[at + 1]:.9g} in {place(int(rows[at + 1]))}. Sort the log by time, or name in the "
        "recipe the channel that is time."
    )


def _increasing(time: np.ndarray) -> np.ndarray:
    """Return which rows stay so that time never falls.

    At a fall that costs few rows, on the one side or the other, these give way; so do rows that bear once more
    the very times of rows in the middle of the log: a block was written twice. At any other that costs many
    the clock started again: what lies between such falls is never joined, the longest part stays.
    """
    falls = np.flatnonzero(np.diff(time) < 0) + 1
    bounds = np.concatenate(([0], falls, [time.size])).tolist()
    many = max(_FEW * time.size, 1)
    parts: list[list[tuple[int, int]]] = [[]]
    for start, stop in pairwise(bounds):
        kept = parts[-1]
        if not kept:
            kept.append((start, stop))
            continue
        last = time[kept[-1][1] - 1]
        ahead = int(np.searchsorted(time[start:stop], last, side="left"))
        behind, whole, cut = _rows_after(time, kept, time[start], limit=ahead)
        again = min(ahead, behind) > many and _written_before(time, kept, start, start + ahead)
        if min(ahead, behind) > many and not again:
            parts.append([(start, stop)])
        elif behind < ahead and not again:
            del kept[whole:]
            kept += [*cut, (start, stop)]
        elif start + ahead < stop:
            kept.append((start + ahead, stop))
    stay = np.zeros(time.size, dtype=bool)
    for start, stop in max(parts, key=lambda part: sum(stop - start for start, stop in part)):
        stay[start:stop] = True
    return stay


def _written_before(time: np.ndarray, kept: list[tuple[int, int]], start: int, stop: int) -> bool:
    """Tell whether rows bear times of kept rows, from later than the first on: a clock that starts again begins there."""
    before = np.concatenate([time[slice(*rows)] for rows in kept])
    return bool(time[start] > before[0] and np.isin(time[start:stop], before).all())


def _rows_after(
    time: np.ndarray, kept: list[tuple[int, int]], moment: float, limit: int
) -> tuple[int, int, list[tuple[int, int]]]:
    """Count the kept rows later than `moment`, up to `limit`; how many parts stay whole, and what stays of the next."""
    count, whole = 0, len(kept)
    while whole and count < limit:
        start, stop = kept[whole - 1]
        stays = int(np.searchsorted(time[start:stop], moment, side="right"))
        count += stop - start - stays
        whole -= 1
        if stays:
            return count, whole, [(start, start + stays)]
    return count, whole, []


def _rows_dropped(
    time: np.ndarray, stay: np.ndarray, backward: np.ndarray, rows: np.ndarray, where: str, place: Place
) -> Change:
    """Return what was dropped; refuse where that is most of the log."""
    lost = int((~stay).sum())
    part = lost / time.size
    at = int(backward[0])
    again = bool(time[~stay].min() > time[stay][0] and np.isin(time[~stay], time[stay]).all())
    dropped = RowsDropped(backward.size, lost, (float(time[at]), float(time[at + 1])), place(int(rows[at + 1])), again)
    if part <= _FEW or lost <= 1 or again:
        return dropped
    if part > 0.5:
        raise InputError(
            f"{where}: time starts again {dropped.step}; no part of the log holds half of its rows. It looks like "
            "several runs in one file: split it there, one file a run."
        )
    left = np.flatnonzero(stay)
    message = (
        f"{where}: time starts again {dropped.step}. The longest increasing part is kept ("
        f"{place(int(rows[left[0]]))} to {place(int(rows[left[-1]]))}); {lost} of {time.size} rows ({100 * part:.3g} %) are dropped. "
        "If the log holds two runs, split it."
    )
    return Other(QualityFinding("warning", message))


def _are_copies(rows: np.ndarray, repeated: np.ndarray, copies: np.ndarray | None) -> bool:
    """Tell whether rows with a repeated stamp repeat all values too: logged twice, not sampled twice."""
    if copies is None:
        return False
    later = rows[1:][repeated]
    later = later[later < copies.size]
    return later.size > 0 and float(copies[later].mean()) > 0.9


def _spread(time: np.ndarray) -> np.ndarray:
    """Return strictly increasing times for non-decreasing coarse ones.

    Between gaps a steady clock is assumed: first stamp kept, slope by regression over the stamps. Where
    that misses a stamp by more than two of their steps, rows are spread between neighbouring stamps.
    """
    starts = np.concatenate(([0], np.flatnonzero(np.diff(time)) + 1))
    stamps = time[starts]
    counts = np.diff(np.append(starts, time.size))
    lengths = np.diff(stamps)
    usual = float(np.median(lengths))
    per_row = float(np.median(lengths / counts[:-1]))
    spread = _between_stamps(time.size, starts, stamps, counts, per_row)
    gaps = np.flatnonzero(lengths > 1.5 * np.maximum(counts[:-1] * per_row, usual) + usual) + 1
    bounds = np.concatenate(([0], gaps, [stamps.size]))
    steady = spread.copy()
    for begin, end in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        if end - begin < 3:
            continue
        row = (starts[begin:end] - starts[begin]).astype(float)
        stamp = stamps[begin:end] - stamps[begin]
        slope = float(np.dot(row - row.mean(), stamp) / np.dot(row - row.mean(), row - row.mean()))
        if np.abs(row * slope - stamp).max() <= 2 * max(usual, float(lengths[begin : end - 1].max())):
            stop = int(starts[end]) if end < stamps.size else time.size
            steady[starts[begin] : stop] = stamps[begin] + slope * np.arange(stop - starts[begin])
    return steady if (np.diff(steady) > 0).all() else spread


def _between_stamps(n: int, starts: np.ndarray, stamps: np.ndarray, counts: np.ndarray, per_row: float) -> np.ndarray:
    end = stamps[-1] + counts[-1] * per_row
    between: np.ndarray = np.interp(np.arange(n), np.append(starts, n), np.append(stamps, end))
    return between
