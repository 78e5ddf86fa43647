"""Stretches in which a channel does not change at all, for telling a stuck sensor from a quiet one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.ingest.quality.window import CONTEXT, Window, cut_off

# Shorter stretches than this many samples are never called stuck.
SHORTEST = 20
_KEPT = 16


@dataclass
class Stretch:
    """Equal samples in succession: how many, their value, from when to when (s).

    `stopped` tells whether the signal was cut off at its start (`cut_off`); None where the record
    begins with it.
    """

    length: int
    value: float
    start: float
    end: float
    stopped: bool | None


class ConstantStretches:
    """Accumulates the longest constant stretches of one channel, block by block."""

    def __init__(self) -> None:
        self.n = 0
        self.n_still = 0
        self.longest: list[Stretch] = []
        self._open: Stretch | None = None

    def add(self, window: Window) -> None:
        """Take the next window."""
        values, old = window.values, window.old
        if values.size == old:
            return
        self.n += values.size - old
        begin = max(old - 1, 0)
        if self._open is None:
            self._open = Stretch(1, float(values[0]), window.moment(0), window.moment(0), None)
        n_steps = values.size - 1 - begin
        still = np.flatnonzero(window.steps[begin:] == 0.0)
        self.n_still += still.size
        if still.size == n_steps:
            self._open.length += n_steps
            self._open.end = window.moment(values.size - 1)
            return
        first, last = _in_succession(still)
        if first.size and first[0] == 0:
            self._open.length += int(last[0]) + 1
            self._open.end = window.moment(begin + int(last[0]) + 1)
        self._close()
        long = np.flatnonzero((last - first + 2 >= SHORTEST) & (first > 0) & (last < n_steps - 1))
        if long.size > _KEPT:
            long = np.sort(long[np.argsort((last - first)[long], kind="stable")[-_KEPT:]])
        for at in long.tolist():
            self._begin(window, begin + int(first[at]), begin + int(last[at]) + 1)
            self._close()
        tail = int(first[-1]) if first.size and last[-1] == n_steps - 1 else n_steps
        self._begin(window, begin + tail, values.size - 1)

    def finish(self) -> None:
        """Close the stretch that reaches the end of the record."""
        self._close()
        self._open = None

    def _begin(self, window: Window, first: int, last: int) -> None:
        length, value = last - first + 1, float(window.values[first])
        stopped = None
        if first > 0:
            # A stretch that is still short may go on in the next block, when its start is out of sight.
            reach = CONTEXT if last == window.values.size - 1 else min(length, CONTEXT)
            stopped = length >= SHORTEST or last == window.values.size - 1
            stopped = stopped and cut_off(window.before(first, max(reach, 32)), value)
        self._open = Stretch(length, value, window.moment(first), window.moment(last), stopped)

    def _close(self) -> None:
        stretch = self._open
        if stretch is None or stretch.length < SHORTEST:
            return
        self.longest.append(stretch)
        if len(self.longest) > _KEPT:
            self.longest.sort(key=lambda one: -one.length)
            del self.longest[_KEPT:]

    def stuck(self) -> list[Stretch]:
        """Return the stretches in which a signal that otherwise moves stood still for no reason of its own.

        At least 20 samples and 2 % of the record; outside of them the signal changes from sample to
        sample more often than not, and rests nowhere for a quarter of their length. A value to which
        it returns for such a stretch is where it rests.
        """
        long_enough = max(SHORTEST, 0.02 * self.n)
        long = [one for one in self.longest if one.length >= long_enough]
        others = [one.length for one in self.longest if one.length < long_enough]
        steps_in_long = sum(one.length - 1 for one in long)
        elsewhere = self.n - 1 - steps_in_long
        if not long or len(long) == _KEPT or elsewhere <= 0:
            return []
        restless = 1.0 - (self.n_still - steps_in_long) / elsewhere
        if restless < 0.5 or 4 * max(others, default=0) > min(one.length for one in long):
            return []
        values = [one.value for one in long]
        return sorted((one for one in long if one.stopped and values.count(one.value) == 1), key=lambda one: one.start)


def _in_succession(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and the last of each succession of neighbouring rows (n,)."""
    if not rows.size:
        return rows, rows
    breaks = np.flatnonzero(np.diff(rows) > 1)
    return rows[np.concatenate(([0], breaks + 1))], rows[np.append(breaks, -1)]
