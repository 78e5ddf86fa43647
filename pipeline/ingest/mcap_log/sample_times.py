"""Times of the samples in blocks: from the stamps of the messages, or from the times they carry.

A message's stamp is taken as that of its first sample, the step then comes from the next message's stamp; or, where
the recipe says so, as that of its last, the step then comes from the stamp before.
"""

from __future__ import annotations

import numpy as np

# A next message later than this many usual steps is taken as a gap, not as a slower rate.
_GAP = 1.5
_FACTORS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


class SampleClock:
    """Gives each sample its time; keeps what must be known from one batch to the next.

    `gaps` counts the messages after which samples are missing, `longest` (s) is how long a block lasts. `for_first`
    and `for_last` count neighbours of different length whose stamps are apart as if they were first or last samples'.
    """

    def __init__(self, carried_unit: str | None = None) -> None:
        self.gaps = 0
        self.longest = 0.0
        self.for_first = self.for_last = 0
        self._before = np.nan
        self._unit = carried_unit
        self._step: float | None = None
        self._origin: tuple[float, float] | None = None
        self._factor: float | None = None
        self._last_carried: float | None = None

    def from_stamps(
        self, stamps: np.ndarray, counts: np.ndarray, following: float | None, declared: float | None = None
    ) -> np.ndarray:
        """Return the times (s) of all samples, shape (sum(counts),).

        `stamps` (m,) are the messages' times in s, `counts` (m,) their samples, `following` the time
        of the next message after them, None after the last. `declared` is the step (s) that messages
        declare; it serves where no stamps tell one.
        """
        until = np.append(stamps[1:], np.nan if following is None else following)
        steps = self._steps(until - stamps, counts, declared)
        self._weigh(stamps, counts)
        place = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.asarray(np.repeat(stamps, counts) + place * np.repeat(steps, counts))

    def from_last_stamps(self, stamps: np.ndarray, counts: np.ndarray, declared: float | None = None) -> np.ndarray:
        """Return the times (s) of all samples as `from_stamps` does, where the stamps are those of the last samples."""
        since = np.append(self._before, stamps[:-1])
        self._before = float(stamps[-1]) if stamps.size else self._before
        steps = self._steps(stamps - since, counts, declared)
        to_last = np.repeat(np.cumsum(counts), counts) - 1 - np.arange(int(counts.sum()))
        return np.asarray(np.repeat(stamps, counts) - to_last * np.repeat(steps, counts))

    def _weigh(self, stamps: np.ndarray, counts: np.ndarray) -> None:
        """Count what speaks for first and for last samples' stamps: a shorter block is followed, or preceded, sooner."""
        ways, differ = np.diff(stamps), np.diff(counts) != 0
        alike = (counts[:-1] == counts[1:]) & (counts[:-1] > 0)
        if not differ.any() or not alike.any():
            return
        step = float(np.median(ways[alike] / counts[:-1][alike]))
        off_first, off_last = np.abs(ways - counts[:-1] * step), np.abs(ways - counts[1:] * step)
        self.for_first += int(np.count_nonzero(differ & (off_first < 0.5 * off_last)))
        self.for_last += int(np.count_nonzero(differ & (off_last < 0.5 * off_first)))

    def _steps(self, ways: np.ndarray, counts: np.ndarray, declared: float | None) -> np.ndarray:
        """Return the step (s) within each block from the ways (s) between stamps, NaN where there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = ways / counts
        usable = np.isfinite(steps) & (steps > 0)
        usual = float(np.median(steps[usable])) if usable.any() else self._step
        usual = declared if usual is None else usual
        if usual is None:
            usual = np.nan if counts.max(initial=0) > 1 else 0.0
        late = usable & (steps > _GAP * usual)
        self.gaps += int(np.count_nonzero(late))
        usable &= ~late
        steps = self._filled(steps, usable, usual)
        self._step = float(steps[-1]) if steps.size and np.isfinite(steps[-1]) else self._step
        self.longest = max(self.longest, float(counts.max(initial=0) * (self._step or 0.0)))
        return steps

    def _filled(self, steps: np.ndarray, usable: np.ndarray, usual: float) -> np.ndarray:
        """Put the step before in the place of every unusable one."""
        before = usual if self._step is None else self._step
        last = np.maximum.accumulate(np.where(usable, np.arange(steps.size), -1))
        return np.where(last >= 0, steps[last], before)

    def from_carried(self, stamps: np.ndarray, counts: np.ndarray, carried: np.ndarray) -> np.ndarray:
        """Return the times (s) of all samples from the times (n,) that the messages carry.

        Times that run on from message to message are anchored once, at the first message's stamp;
        times that start anew in each message count from its stamp.
        """
        if not carried.size:
            return carried
        starts = (np.cumsum(counts) - counts)[counts > 0]
        stamps = stamps[counts > 0]
        if self._factor is None:
            self._factor = _FACTORS.get(self._unit or "") or _likely_factor(stamps, carried[starts], carried)
        ends = np.append(carried[starts[1:] - 1], np.nan)[: starts.size - 1]
        runs_on = bool(np.all(carried[starts[1:]] > ends)) and starts.size + (self._origin is not None) > 1
        if runs_on and (self._last_carried is None or carried[0] > self._last_carried):
            self._last_carried = float(carried[-1])
            self._origin = self._origin or (float(stamps[0]), float(carried[0]))
            return np.asarray(self._origin[0] + (carried - self._origin[1]) * self._factor)
        first = np.repeat(carried[starts], counts[counts > 0])
        return np.asarray(np.repeat(stamps, counts[counts > 0]) + (carried - first) * self._factor)


def _likely_factor(stamps: np.ndarray, firsts: np.ndarray, carried: np.ndarray) -> float:
    """Return the factor to seconds that makes undeclared times fit the messages' stamps."""
    if stamps.size < 2 or stamps[-1] <= stamps[0]:
        return 1.0
    span = firsts[-1] - firsts[0]
    if not span > 0:  # the times start anew in each message: a block lasts as long as the way to the next
        return _nearest(float(np.median(np.diff(stamps))), float(np.ptp(carried)))
    return _nearest(float(stamps[-1] - stamps[0]), float(span))


def _nearest(seconds: float, span: float) -> float:
    return min(_FACTORS.values(), key=lambda factor: abs(np.log10(span * factor / seconds)) if span > 0 else factor)
