"""Repair of the time stamps of a long log part by part, so that memory does not follow its length.

A log is cut where stamps stand in order, and each part is repaired by itself (`stamps`). What concerns the whole of it, a
clock that starts again or a counter that wraps, is not seen in parts: such a log is repaired at once, with all its stamps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.stamp_changes import CoarseSpread, Other, RepeatsDropped
from pipeline.ingest.stamps import Place, Repair, repair

# Rows of one part; repair takes some 80 bytes of each.
PART_ROWS = 1 << 21
# A cut is looked for in the last rows of a part, with so many rows behind it that tell whether all before it are earlier.
_LOOKED, _BEHIND = 1 << 16, 2048
# Parts of coarse stamps may run into the next one by so many of their steps, as the clock between stamps is only known so well.
_COARSE_STEPS = 2.0


class _WholeOnlyError(Exception):
    """The log cannot be repaired in parts."""


class OnDisk:
    """Numbers of the rows of a log in a temporary file, written one part after the other and read a slice at a time."""

    def __init__(self, dtype: type[np.generic]) -> None:
        self._file = TemporaryFile()  # noqa: SIM115  it lasts as long as the object
        self._dtype = np.dtype(dtype)
        self.size = 0

    def append(self, values: np.ndarray) -> None:
        """Write the next numbers (n,)."""
        self._file.seek(self.size * self._dtype.itemsize)
        self._file.write(np.ascontiguousarray(values, self._dtype).tobytes())
        self.size += values.size

    def __getitem__(self, rows: slice, /) -> np.ndarray:
        """Return the numbers of some rows in succession."""
        start, stop, _ = rows.indices(self.size)
        self._file.seek(start * self._dtype.itemsize)
        data = self._file.read(max(stop - start, 0) * self._dtype.itemsize)
        return np.frombuffer(data, self._dtype)


def repair_long(
    again: Callable[[], Iterator[np.ndarray]], copies: np.ndarray | None, where: str, place: Place
) -> Repair:
    """Make the stamps of a log strictly increasing, whatever its length; see `repair`.

    Parameters
    ----------
    again
        Yields the stamps as logged, block by block, each time from the first on.
    """
    parts = _parts(again())
    try:
        first, second = next(parts), next(parts, None)
        if second is None:
            return repair(first, copies, where, place)
        return _in_parts(chain((first, second), parts), copies, where, place)
    except _WholeOnlyError:
        return repair(np.concatenate(list(again())), copies, where, place)


def _parts(blocks: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
    """Yield stamps in parts that end where all before are earlier than all behind."""
    held: list[np.ndarray] = []
    rows = 0
    for block in blocks:
        held.append(block)
        rows += block.size
        if rows >= PART_ROWS + _LOOKED + _BEHIND:
            joined = np.concatenate(held)
            cut = _cut(joined)
            yield joined[:cut]
            held, rows = [joined[cut:]], joined.size - cut
    yield np.concatenate(held) if held else np.empty(0)


def _cut(stamps: np.ndarray) -> int:
    """Return the last row near the end, but not at it, before which all stamps are earlier than from it on."""
    first = stamps.size - _LOOKED - _BEHIND
    latest = np.fmax(np.fmax.accumulate(stamps[first - 1 :]), np.fmax.reduce(stamps[:first]))
    earliest = np.fmin.accumulate(stamps[first:][::-1])[::-1]
    places = np.flatnonzero((latest[:-1] < earliest)[:_LOOKED])
    if not places.size:
        raise _WholeOnlyError
    return first + int(places[-1])


def _in_parts(parts: Iterator[np.ndarray], copies: np.ndarray | None, where: str, place: Place) -> Repair:
    stamps = OnDisk(np.float64)
    order: OnDisk | None = None
    changes: dict[type, Any] = {}
    last, kept = -np.inf, 0
    for part in parts:
        begin = stamps.size
        mended = _mended(part, copies if begin == 0 else None, where, partial(_place_behind, place, begin), last)
        stamps.append(mended.stamps[:])
        last = float(np.fmax.reduce(mended.stamps[:], initial=last))
        if mended.order is not None and order is None:
            order = OnDisk(np.int64)
            order.append(np.arange(begin))
        if order is not None:
            order.append(begin + (np.arange(part.size) if mended.order is None else mended.order[:]))
        for change in mended.changes:
            before = changes.get(type(change))
            changes[type(change)] = change if before is None else before.joined(change)
        kept += int(np.count_nonzero(np.isfinite(mended.stamps[:])))
        kept += sum(change.rows for change in mended.changes if isinstance(change, RepeatsDropped))
    # Steps of parts without repeated stamps count too.
    told = [change for change in changes.values() if not isinstance(change, RepeatsDropped | CoarseSpread)]
    told += [replace(changes[kind], steps=kept - 1) for kind in (RepeatsDropped, CoarseSpread) if kind in changes]
    return Repair(stamps, order, [change.told(where) for change in told], told)


def _place_behind(place: Place, begin: int, row: int) -> str:
    return place(begin + row)


def _mended(part: np.ndarray, copies: np.ndarray | None, where: str, place: Place, last: float) -> Repair:
    """Repair the stamps of one part, which come after `last`."""
    present = part[np.isfinite(part)]
    if present.size and present[0] > last and (np.diff(present) > 0).all():
        return Repair(np.where(np.isfinite(part), part, np.nan))
    try:
        mended = repair(part, copies, where, place)
    except InputError as error:
        raise _WholeOnlyError from error
    if any(isinstance(change, Other) for change in mended.changes):
        raise _WholeOnlyError
    times = mended.stamps[:]
    known = times[np.isfinite(times)]
    late = last - float(known[0]) if known.size else -np.inf
    if late >= 0:
        steps = np.diff(present)
        if CoarseSpread not in map(type, mended.changes) or late > _COARSE_STEPS * float(np.median(steps[steps > 0])):
            raise _WholeOnlyError
        return replace(mended, stamps=times + late + float(np.median(np.diff(known))))
    return mended
