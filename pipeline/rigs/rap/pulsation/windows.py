"""Windows of time cut out of a channel, stacked so that all of them are computed at once. No physics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

# Samples (windows times their length) that are held at a time: a design matrix of 9 columns stays below 20 MB.
_HELD = 1 << 18


@dataclass(frozen=True, eq=False)
class Windows:
    """Stretches of time on the clock of one source: `start` and `end`, s, shape (w,)."""

    start: np.ndarray
    end: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        """Middle of each window, s, shape (w,)."""
        return np.asarray(0.5 * (self.start + self.end))

    @property
    def size(self) -> int:
        """Number of windows."""
        return int(self.start.size)

    def of(self, kept: np.ndarray) -> Windows:
        """Return the windows at `kept`, a mask or indices."""
        return Windows(self.start[kept], self.end[kept])


def cut(first: float, last: float, length: float, step: float | None = None) -> Windows:
    """Return the whole windows of `length` s between `first` and `last`, `step` s apart (by default side by side)."""
    step = length if step is None else step
    count = int(np.floor((last - first - length) / step + 1e-6)) + 1 if last - first >= length * (1 - 1e-6) else 0
    start = first + step * np.arange(max(count, 0))
    return Windows(start, start + length)


def joined(parts: list[Windows]) -> Windows:
    """Return the windows of several stretches one after the other."""
    if not parts:
        return Windows(np.empty(0), np.empty(0))
    return Windows(np.concatenate([p.start for p in parts]), np.concatenate([p.end for p in parts]))


def sampling_rate(time: np.ndarray) -> float:
    """Return samples a second, from the median step of two or more stamps, Hz."""
    return 1.0 / float(np.median(np.diff(time)))


@dataclass(frozen=True, eq=False)
class Stack:
    """Samples of some windows: `rows` of the windows, `offset` (s from the centre), `values`, `weight` 1 or 0; shape (w, n)."""

    rows: slice
    offset: np.ndarray
    values: np.ndarray
    weight: np.ndarray


def stacks(time: np.ndarray, values: np.ndarray, windows: Windows) -> Iterator[Stack]:
    """Yield the samples of the windows, some windows at a time; short windows are filled with weight 0.

    `time` (n,) is increasing; samples that are NaN weigh nothing.
    """
    first = np.searchsorted(time, windows.start - 1e-9)
    last = np.searchsorted(time, windows.end - 1e-9)
    longest = int(max((last - first).max(initial=0), 1))
    at_once = max(_HELD // longest, 1)
    centre = windows.centre
    for begin in range(0, windows.size, at_once):
        rows = slice(begin, min(begin + at_once, windows.size))
        index = first[rows, None] + np.arange(longest)
        inside = index < last[rows, None]
        index = np.minimum(index, time.size - 1)
        taken = values[index]
        inside &= np.isfinite(taken)
        offset = np.where(inside, time[index] - centre[rows, None], 0.0)
        yield Stack(rows, offset, np.where(inside, taken, 0.0), inside.astype(float))
