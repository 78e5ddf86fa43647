"""From the encoder's counter to the angle of the output shaft, its speed and its edges.

Speeds are slopes of straight lines through the angle over many counts: differences of counts are a
staircase with steps of 10 to 50 %. What the counter as logged may be wrong in is in `counter_faults`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.gearbox.record import COUNT, SPEED, Record, Signal
from pipeline.rigs.gearbox.stages.counter_faults import direction, held, mended
from pipeline.rigs.gearbox.stages.counter_losses import bridged
from pipeline.rigs.gearbox.stages.stage import Problem

# A speed is fitted over this time, so many counts and so many samples at the least.
_WINDOW, _COUNTS, _SAMPLES = 0.1, 30, 4
# Samples between two gaps that make a piece of a line.
_FEWEST = 10
# A logged speed without steps has so many different values for its samples; below this share of top speed it stands.
_ANALOGUE, _SLOW = 0.2, 0.03
# The shaft stands where no count comes for this time and so many periods of a count at top speed.
STILL, STILL_COUNTS = 0.1, 8


@dataclass(frozen=True, eq=False)
class Counts:
    """The angle of the output shaft at the counter's own update instants.

    Attributes
    ----------
    time, angle
        Shape (n,), s and rad, positive forward, without wrap-around; n differs from the log's where a
        faster logger held the counter's values or samples were dropped.
    step
        Angle of one count, rad; for a logged speed the angle of its smallest step.
    top
        98th percentile of the speed, rad/s.
    gaps
        Spans in which the counter told nothing; `angle` runs on behind them at the speed beside them.
    """

    time: np.ndarray
    angle: np.ndarray
    step: float
    top: float
    gaps: tuple[tuple[float, float], ...] = ()
    problems: tuple[Problem, ...] = ()

    @property
    def window(self) -> float:
        """Width of the line fits, s: 0.1 s and 30 counts at top speed (gearbox.md, 5.1)."""
        return max(_WINDOW, _SAMPLES * self._sampling, _COUNTS * self.step / self.top if self.top > 0 else 0.0)

    @property
    def still(self) -> float:
        """Time without a count after which the shaft stands, s."""
        return max(STILL, _SAMPLES * self._sampling, STILL_COUNTS * self.step / self.top if self.top > 0 else 0.0)

    @property
    def _sampling(self) -> float:
        return float(np.median(np.diff(self.time)))

    def speed(self, window: float | None = None) -> np.ndarray:
        """Return the slope of a straight line through the angle around every sample, shape (n,), rad/s."""
        return line_slopes(self.time, self.angle, self.window if window is None else window)

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return the angle at other times by straight lines, same shape, rad; NaN in gaps and beyond the ends."""
        # A count is the floor of the angle: on average the shaft is half a count further.
        angle = np.interp(time, self.time, self.angle + 0.5 * self.step, left=np.nan, right=np.nan)
        for start, end in self.gaps:
            angle[(time > start) & (time < end)] = np.nan
        return np.asarray(angle)

    def rate(self, start: float, end: float) -> tuple[float, float]:
        """Return the mean speed from `start` to `end` and its standard error, rad/s; NaN where counts are few.

        A straight line with one slope throughout and a level of its own between gaps: counts that were lost
        move the level and not the slope.
        """
        inside = (self.time >= start) & (self.time <= end)
        time, angle = self.time[inside], self.angle[inside]
        piece = np.searchsorted(np.array([0.5 * (a + b) for a, b in self.gaps]), time)
        kept = np.isin(piece, [k for k in np.unique(piece) if np.sum(piece == k) >= _FEWEST])
        time, angle, piece = time[kept], angle[kept], piece[kept]
        if time.size < 2 * _FEWEST:
            return math.nan, math.nan
        for k in np.unique(piece):
            own = piece == k
            time[own] -= time[own].mean()
            angle[own] -= angle[own].mean()
        spread = float(time @ time)
        slope = float(time @ angle) / spread
        rest = angle - slope * time
        pieces = np.unique(piece).size
        count = max(effective_size(rest, pieces) - 1.0 - pieces, 1.0)
        return slope, math.sqrt(float(rest @ rest) / spread / count)

    def whole(self, start: float, end: float) -> bool:
        """Tell whether the counter told the angle all the way from `start` to `end`."""
        inside = start >= self.time[0] and end <= self.time[-1]
        return inside and not any(start < gap[1] and end > gap[0] for gap in self.gaps)


def counts_of(record: Record) -> Counts:
    """Return the angle of the output shaft from counts, or from a logged speed where there are none."""
    return _of(record.encoder, record.counts_per_turn)


@lru_cache(maxsize=2)
def _of(encoder: Signal, per_turn: float) -> Counts:
    """Return the angle that a log tells; kept for the last ones: clocks, stages and numbers all ask for it."""
    time = encoder.time
    if COUNT not in encoder:
        return _of_speed(time, encoder[SPEED])
    counts, problems = mended(time, encoder[COUNT], per_turn)
    counts, turned = direction(time, counts)
    time, counts = held(time, counts)
    top = _top(time, counts)
    time, counts, gaps, lost = bridged(time, counts, per_turn)
    step = 2.0 * math.pi / per_turn
    return Counts(time, counts * step, step, top * step, tuple(gaps), (*problems, *turned, *lost))


def _of_speed(time: np.ndarray, speed: np.ndarray) -> Counts:
    """Return the angle of a logged speed: counts over a step of time, so their sum gives the counts back."""
    steps = np.diff(time, prepend=2 * time[0] - time[1])
    sign = -1.0 if np.median(speed[np.abs(speed) >= 0.5 * np.abs(speed).max()]) < 0 else 1.0
    change = np.abs(np.diff(speed))
    quantum = float(change[change > 1e-6 * max(float(np.abs(speed).max()), 1e-30)].min(initial=np.inf))
    if np.unique(speed).size > _ANALOGUE * speed.size:
        # Its noise adds up to an angle that never rests: what stays slow for a while stands.
        smooth = line_slopes(time, np.cumsum(speed * steps), _WINDOW)
        speed = np.where(np.abs(smooth) < _SLOW * np.percentile(np.abs(smooth), 98), 0.0, speed)
        quantum = math.inf
    step = quantum * float(np.median(steps)) if math.isfinite(quantum) else 0.0
    angle = np.cumsum(sign * speed * steps)
    text = "the output speed is negative throughout; it is counted as forward"
    problems = (Problem((float(time[0]), float(time[-1])), text),) if sign < 0 else ()
    return Counts(time, angle, step, _top(time, angle), (), problems)


def _top(time: np.ndarray, angle: np.ndarray) -> float:
    """Return the 98th percentile of the speed over a quarter of a second."""
    return max(float(np.percentile(line_slopes(time, angle, 0.25), 98)), 0.0)


def line_slopes(time: np.ndarray, values: np.ndarray, window: float) -> np.ndarray:
    """Return the least-squares slope of the samples within `window` (s) around every sample.

    Examples
    --------
    >>> t = np.arange(0, 1, 0.01)
    >>> bool(np.allclose(line_slopes(t, 3 * t, 0.1), 3))
    True
    """
    # Three samples at the least, and the window cut at both ends of the record.
    first = np.searchsorted(time, time - 0.5 * window * (1 + 1e-9))
    last = np.searchsorted(time, time + 0.5 * window * (1 + 1e-9), side="right")
    index = np.arange(time.size)
    first, last = np.minimum(first, np.maximum(index - 1, 0)), np.maximum(last, np.minimum(index + 2, time.size))
    t, x = time - time.mean(), values - values.mean()

    def total(of: np.ndarray) -> np.ndarray:
        sums = np.concatenate([[0.0], np.cumsum(of)])
        return np.asarray(sums[last] - sums[first])

    n, st, sx = (last - first).astype(float), total(t), total(x)
    return np.asarray((total(t * x) - st * sx / n) / np.maximum(total(t * t) - st * st / n, 1e-300))


def edges(counts: Counts) -> tuple[np.ndarray, np.ndarray]:
    """Return when the shaft first went on by a count, shape (m,), s, and the angle then reached, rad.

    A counter that dithers at an edge goes on only once. The instant is the middle between the sample
    before and the one that shows it.
    """
    reached = np.maximum.accumulate(counts.angle)
    if counts.step == 0.0:  # a speed without steps: an edge every thousandth of a turn
        reached = np.floor(reached / (0.002 * math.pi)) * 0.002 * math.pi
    moved = np.flatnonzero(np.diff(reached) > 0) + 1
    return 0.5 * (counts.time[moved - 1] + counts.time[moved]), reached[moved]
