"""Stretches in which a channel does not change at all, for telling a stuck sensor from a quiet one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.ingest.quality.window import CONTEXT, Window, cut_off

# Shorter stretches than this many samples are never called stuck.
SHORTEST = 20
_KEPT = 16
# A signal that goes on unseen is so many of its largest steps away when it is seen again.
_JUMPS = 4.0


@dataclass
class Stretch:
    """Equal samples in succession: how many, their value, from when to when (s).

    `stopped` tells whether the signal was cut off at its start (`cut_off`); None where the record
    begins with it. `fastest` is the largest step before it, `jump` the step that ends it.
    """

    length: int
    value: float
    start: float
    end: float
    stopped: bool | None
    fastest: float = 0.0
    jump: float = 0.0

    @property
    def is_freeze(self) -> bool:
        """Tell whether it began or ended as no quantity of nature does."""
        return bool(self.stopped) or self.jump > _JUMPS * self.fastest > 0.0


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
        head = int(last[0]) + 1 if first.size and first[0] == 0 else 0
        if head:
            self._open.length += head
            self._open.end = window.moment(begin + head)
        self._close(float(window.sizes[begin + head]))
        long = np.flatnonzero((last - first + 2 >= SHORTEST) & (first > 0) & (last < n_steps - 1))
        if long.size > _KEPT:
            long = np.sort(long[np.argsort((last - first)[long], kind="stable")[-_KEPT:]])
        for at in long.tolist():
            end = begin + int(last[at]) + 1
            self._begin(window, begin + int(first[at]), end)
            self._close(float(window.sizes[end]))
        tail = int(first[-1]) if first.size and last[-1] == n_steps - 1 else n_steps
        self._begin(window, begin + tail, values.size - 1)

    def finish(self) -> None:
        """Close the stretch that reaches the end of the record."""
        self._close(0.0)
        self._open = None

    def _begin(self, window: Window, first: int, last: int) -> None:
        length, value = last - first + 1, float(window.values[first])
        stretch = Stretch(length, value, window.moment(first), window.moment(last), None)
        if first > 0:
            # A stretch that is still short may go on in the next block, when its start is out of sight.
            reach = CONTEXT if last == window.values.size - 1 else min(length, CONTEXT)
            before = window.before(first, max(reach, 32))
            stretch.stopped = cut_off(before, value)
            stretch.fastest = float(np.abs(np.diff(before)).max(initial=0.0))
        self._open = stretch

    def _close(self, jump: float) -> None:
        """Keep the open stretch if it is long; `jump` is the step that ends it."""
        stretch = self._open
        if stretch is None or stretch.length < SHORTEST:
            return
        stretch.jump = jump
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
        return sorted(
            (one for one in long if one.is_freeze and values.count(one.value) == 1), key=lambda one: one.start
        )


def _in_succession(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and the last of each succession of neighbouring rows (n,)."""
    if not rows.size:
        return rows, rows
    breaks = np.flatnonzero(np.diff(rows) > 1)
    return rows[np.concatenate(([0], breaks + 1))], rows[np.append(breaks, -1)]
