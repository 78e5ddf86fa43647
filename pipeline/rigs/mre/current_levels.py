"""Where the measured coil current is held: levels of any size and length, told from ramps and steps between.

Works on the samples alone, no labels and no set-point. What force or field do meanwhile is not its business.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_WINDOW = 0.25  # s on either side of a sample whose means are compared
_SURE = 6.0  # standard errors by which they must differ
_LEAST_CHANGE = 0.004  # of the range of the current
_SMALLEST = 5e-3  # A, levels closer than this are one
_STILL_SHARE = 0.05  # of the samples that differ from the one before: a set-point has fewer
_FEWEST = 3
_WINDOWS = (0.25, 0.5, 1.0, 2.0)  # s
_BRIEF, _MOVING = (
    0.1,
    3.0,
)  # of the usual length: what is shorter is a halt in a ramp; what moves must be that much longer
HOLD_DRIFT = 0.15  # A, a hold whose current changes more is a part of a ramp


@dataclass(frozen=True)
class Hold:
    """A stretch from `start` to `stop` (s) with the mean current `level` (A), known to `level_error`.

    `drift` is how much the current changes from its start to its end, A; 0 where that is not sure.
    """

    start: float
    stop: float
    level: float
    level_error: float
    drift: float

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.stop - self.start


@dataclass(frozen=True)
class Staircase:
    """Holds in the order of time, the noise of the current (A, 1 sigma), and whether it looks like a set-point.

    A set-point does not vary within a hold and changes from one sample to the next.
    """

    holds: tuple[Hold, ...]
    noise: float
    is_set_point: bool
    step: float


def holds_of(time: np.ndarray, current: np.ndarray, window: float = _WINDOW) -> Staircase:
    """Find the stretches in which the current stands still.

    Parameters
    ----------
    time, current
        Stamps (s, increasing) and samples (A), shape (n,); NaN are passed over.
    window
        Seconds before and after a sample whose means are compared; holds shorter than twice that are not found.

    Examples
    --------
    >>> t = np.arange(0, 30, 0.1)
    >>> noise = 0.01 * np.random.default_rng(1).standard_normal(t.size)
    >>> found = holds_of(t, np.floor(t / 10) * 0.5 + noise)
    >>> [abs(round(hold.level, 1)) for hold in found.holds]
    [0.0, 0.5, 1.0]
    """
    valid = np.isfinite(current)
    t, x = time[valid], current[valid]
    if t.size < 2 * _FEWEST:
        return Staircase((), math.nan, False, math.nan)
    step = float(np.median(np.diff(t)))
    noise, set_point = _noise(x)
    calm = _median_of_five(x)
    m = int(np.clip(round(window / step), _FEWEST, max(t.size // 8, _FEWEST)))
    rows = np.arange(t.size + 1)
    total = np.r_[0.0, np.cumsum(calm)]
    first, last = np.maximum(rows - m, 0), np.minimum(rows + m, t.size)
    before, after = np.maximum(rows - first, 1), np.maximum(last - rows, 1)
    change = (total[last] - total[rows]) / after - (total[rows] - total[first]) / before
    limit = np.maximum(_SURE * noise * np.sqrt(1 / before + 1 / after), _LEAST_CHANGE * float(np.ptp(calm)))
    moves = np.abs(change) > np.maximum(limit, _SMALLEST)
    moves[[0, -1]] = False
    edges = np.flatnonzero(np.diff(np.r_[False, ~moves, False].astype(int)))
    cores = [(a, min(b, t.size)) for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)]
    cores = [(a, b) for a, b in cores if b - a >= _FEWEST]
    spans = _grown(calm, cores, noise)
    spans = _merged(x, spans, noise)
    holds = tuple(_hold(t, x, a, b, noise, step) for a, b in spans if b - a >= _FEWEST)
    return Staircase(holds, noise, set_point, step)


def finest_holds_of(time: np.ndarray, current: np.ndarray) -> Staircase:
    """Find the holds with the window, a quarter to two seconds, that tells the most levels apart.

    A noisy current, or small steps, need more samples before and after a change; short holds need fewer.
    """
    found = [holds_of(time, current, window) for window in _WINDOWS]
    return max(found, key=lambda stairs: (levels_told(stairs.holds), len(stairs.holds)))


def without_ramps(holds: Sequence[Hold]) -> tuple[Hold, ...]:
    """Return the holds that stand still: no part of a ramp, and none far shorter than where the time is spent.

    Examples
    --------
    >>> ramp = Hold(9.5, 10.1, 0.2, 0.001, 0.09)
    >>> len(without_ramps([Hold(0, 9, 0.0, 0.001, 0.0), ramp, Hold(11, 20, 0.5, 0.001, 0.02)]))
    2
    """
    still = [hold for hold in holds if abs(hold.drift) < HOLD_DRIFT]
    lengths = np.sort([hold.duration for hold in still])
    if not lengths.size:
        return ()
    usual = float(lengths[np.searchsorted(np.cumsum(lengths), 0.5 * lengths.sum())])
    return tuple(hold for hold in still if hold.duration > _BRIEF * usual * (_MOVING if hold.drift != 0 else 1.0))


def levels_told(holds: Sequence[Hold]) -> int:
    """Return how many different levels there are among holds that stand still.

    Examples
    --------
    >>> levels_told([Hold(0, 9, 0.0, 0.001, 0.0), Hold(10, 19, 0.5, 0.001, 0.0), Hold(20, 29, 0.001, 0.001, 0.0)])
    2
    """
    still = [hold for hold in holds if abs(hold.drift) < HOLD_DRIFT]
    levels = np.sort([hold.level for hold in still])
    error = max((hold.level_error for hold in still), default=0.0)
    return int(1 + np.count_nonzero(np.diff(levels) > max(0.02, 5 * error))) if levels.size else 0


def level_name(level: float, error: float) -> float:
    """Return the round number (multiple of 0.5, 0.25, 0.1, 0.05, 0.01 A) that a measured level means.

    Examples
    --------
    >>> level_name(5.9987, 0.001), level_name(2.137, 0.001), level_name(-0.0004, 0.001)
    (6.0, 2.14, 0.0)
    """
    for grid in (0.5, 0.25, 0.1, 0.05):
        near = round(level / grid) * grid
        if abs(near - level) <= max(4 * error, 0.005):
            return round(near, 2) + 0.0
    return round(level, 2) + 0.0


def _noise(x: np.ndarray) -> tuple[float, bool]:
    """Return the noise from second differences, at least that of the resolution; and whether there is none at all."""
    steps = np.abs(np.diff(x))
    moving = steps[steps > 1e-12 * max(float(np.abs(x).max()), 1e-12)]
    if moving.size < _STILL_SHARE * steps.size:
        return 1e-3 * max(float(np.ptp(x)), 1e-6), True
    bends = np.abs(np.diff(x, 2))
    noise = 1.4826 * float(np.median(bends)) / math.sqrt(6)
    return max(noise, float(moving.min()) / math.sqrt(12)), False


def _median_of_five(x: np.ndarray) -> np.ndarray:
    """Return the running median of five samples: lone spikes vanish, steps stay sharp."""
    padded = np.r_[x[:2][::-1], x, x[-2:][::-1]]
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))


def _grown(x: np.ndarray, cores: Sequence[tuple[int, int]], noise: float) -> list[tuple[int, int]]:
    """Extend each core to where the current leaves its level, as far as the neighbouring cores."""
    spans = []
    for number, (a, b) in enumerate(cores):
        least = cores[number - 1][1] if number else 0
        most = cores[number + 1][0] if number + 1 < len(cores) else x.size
        width = min(b - a, 50)
        left, right = float(np.median(x[a : a + width])), float(np.median(x[b - width : b]))
        near = max(4 * noise, _SMALLEST)
        off = np.flatnonzero(np.abs(x[least:a] - left) > near)
        start = least + int(off[-1]) + 1 if off.size else least
        off = np.flatnonzero(np.abs(x[b:most] - right) > near)
        spans.append((start, b + int(off[0]) if off.size else most))
    return [(a, b) if n == 0 else (max(a, spans[n - 1][1]), b) for n, (a, b) in enumerate(spans)]


def _merged(x: np.ndarray, spans: Sequence[tuple[int, int]], noise: float) -> list[tuple[int, int]]:
    """Join neighbours whose levels do not differ: a spike or a short dip parted them."""
    joined: list[tuple[int, int]] = []
    for a, b in spans:
        if joined:
            before = joined[-1]
            sizes = (before[1] - before[0], b - a)
            off = abs(float(np.median(x[slice(*before)])) - float(np.median(x[a:b])))
            if off < max(4 * noise * math.sqrt(1.6 / sizes[0] + 1.6 / max(sizes[1], 1)), _SMALLEST):
                joined[-1] = (before[0], b)
                continue
        joined.append((a, b))
    return joined


def _hold(t: np.ndarray, x: np.ndarray, a: int, b: int, noise: float, step: float) -> Hold:
    values, since = x[a:b], t[a:b] - 0.5 * (t[a] + t[b - 1])
    centre = float(np.median(values))
    kept = np.abs(values - centre) <= max(6 * noise, 4 * float(np.median(np.abs(values - centre))), _SMALLEST)
    values, since = values[kept], since[kept]
    level, size = float(values.mean()), values.size
    spread = float(values.std()) if size > 2 else noise
    squares = float(((since - since.mean()) ** 2).sum())
    slope = float((since - since.mean()) @ values / squares) if squares > 0 else 0.0
    drift = slope * float(t[b - 1] - t[a])
    sure = squares > 0 and abs(slope) > 4 * max(spread, noise) / math.sqrt(squares)
    return Hold(
        float(t[a]), float(t[b - 1]) + 0.5 * step, level, max(spread, noise) / math.sqrt(size), drift if sure else 0.0
    )
