"""When the blood pump turns: its starts and stops, from the pulsation of a pressure (rap.md, 3.5 and 3.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.rigs.rap.pulsation.passages import BAND, TURNING, Passages, find_passages
from pipeline.rigs.rap.pulsation.windows import cut, sampling_rate

# The scatter about a running mean is taken over one cycle of the slowest pump, s; below this share of the usual it stands.
_CYCLE = 1.0 / BAND[0]
_STANDS = 0.25
# A line that is weaker than that share of the usual is no pulsation of the pump.
_WEAKEST = 0.03
# Off and on that last less, s, are not told apart from a slow roller.
_SHORTEST = 2.5
# The level of rest is looked at over that time, s; what leaves it by so many standard deviations is motion.
_REST = 5.0
_MOVED = 6.0
_PROBE = 5.0


@dataclass(frozen=True)
class Turning:
    """The pump turns from `start` to `stop`, s on the clock of the pressure; None where the record begins or ends with it turning."""

    first: float
    last: float
    start: float | None
    stop: float | None


@dataclass(frozen=True)
class Pump:
    """Stretches in which the pump turns, in order, of a record from `begin` to `end`, s."""

    stretches: tuple[Turning, ...]
    begin: float
    end: float

    def on(self, time: np.ndarray) -> np.ndarray:
        """Tell for each time, s, shape (n,), whether the pump turns."""
        turns = np.zeros(np.shape(time), dtype=bool)
        for one in self.stretches:
            turns |= (time >= one.first) & (time <= one.last)
        return turns

    @property
    def rests(self) -> tuple[tuple[float, float], ...]:
        """Stretches in which the pump stands, (first, last) in s, in order; the ends are those of the record or a start or stop."""
        edges = [self.begin, *(t for one in self.stretches for t in (one.first, one.last)), self.end]
        pairs = zip(edges[0::2], edges[1::2], strict=True)
        return tuple((a, b) for a, b in pairs if b > a)

    @property
    def changes(self) -> np.ndarray:
        """Starts and stops, s, in order, shape (c,)."""
        both = [t for one in self.stretches for t in (one.start, one.stop) if t is not None]
        return np.array(sorted(both))


def pump(time: np.ndarray, values: np.ndarray, probe: Passages | None = None) -> Pump:
    """Find when the pump turns.

    Parameters
    ----------
    time, values
        A pulsating pressure (pre-filter for choice), s and Pa, shape (n,).
    probe
        Passages in windows all over the record, where they are known already; short windows are looked at otherwise.
    """
    kept = np.isfinite(values)
    t, x = time[kept], values[kept]
    if t.size < 2:
        return Pump((), float(t[0]) if t.size else 0.0, float(t[-1]) if t.size else 0.0)
    begin, end = float(t[0]), float(t[-1])
    if probe is None:
        probe = find_passages(t, x, cut(begin, end, min(_PROBE, end - begin)), refined=False)
    turning = probe.harmonics.amplitude(1)[np.isin(probe.state, ("turning", "jump"))]
    if not turning.size:
        return Pump((), begin, end)
    size = max(round(_CYCLE * sampling_rate(t)), 3)
    scatter = _scatter(x, size)
    moving = scatter > _STANDS * float(np.median(turning)) / np.sqrt(2.0)
    _keep_weak(t, moving, probe, float(np.median(turning)))
    return Pump(tuple(_stretches(t, x, moving, size)), begin, end)


def _keep_weak(t: np.ndarray, moving: np.ndarray, probe: Passages, usual: float) -> None:
    """Mark as moving the stretches that pulsate weakly but clearly (air at the sensor, a clot): the pump turns there as well."""
    weak = (probe.state == TURNING) & (probe.harmonics.amplitude(1) > _WEAKEST * usual)
    edges = [0, *(np.flatnonzero(np.diff(moving.astype(int))) + 1).tolist(), t.size]
    for first, last in pairwise(edges):
        inside = (probe.windows.start >= t[first]) & (probe.windows.end <= t[last - 1])
        if not moving[first] and inside.any() and weak[inside].mean() > 0.5:
            moving[first:last] = True


def _scatter(x: np.ndarray, size: int) -> np.ndarray:
    """Return the running standard deviation over `size` samples about each sample, shape (n,)."""
    level = float(np.median(x))
    sums = np.concatenate([np.zeros((2, 1)), np.cumsum([x - level, (x - level) ** 2], axis=1)], axis=1)
    low = np.clip(np.arange(x.size) - size // 2, 0, max(x.size - size, 0))
    high = np.minimum(low + size, x.size)
    mean, square = (sums[:, high] - sums[:, low]) / (high - low)
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)))


def _stretches(t: np.ndarray, x: np.ndarray, moving: np.ndarray, size: int) -> Sequence[Turning]:
    """Return the stretches that are marked as moving, short breaks closed, their edges where the level of rest is left."""
    edges = np.flatnonzero(np.diff(moving.astype(int))) + 1
    bounds = [0, *edges.tolist(), t.size]
    pieces = [(a, b, bool(moving[a])) for a, b in pairwise(bounds)]
    on = [(a, b) for a, b, moves in pieces if moves]
    merged: list[tuple[int, int]] = []
    for a, b in on:
        if merged and t[a] - t[merged[-1][1] - 1] < _SHORTEST:
            merged[-1] = (merged[-1][0], b)
        else:
            merged.append((a, b))
    lasting = [(a, b) for a, b in merged if t[b - 1] - t[a] >= _SHORTEST]
    found = []
    for i, (a, b) in enumerate(lasting):
        before = lasting[i - 1][1] if i else 0
        after = lasting[i + 1][0] if i + 1 < len(lasting) else t.size
        start = _left(t, x, max(before, 0), min(a + size, b), forwards=True) if a > 0 else None
        stop = _left(t, x, max(b - size, a), after, forwards=False) if b < t.size else None
        found.append(
            Turning(float(t[a]) if start is None else start, float(t[b - 1]) if stop is None else stop, start, stop)
        )
    return found


def _left(t: np.ndarray, x: np.ndarray, low: int, high: int, forwards: bool) -> float:
    """Return when samples `low` to `high` leave the level of rest, s: the rest is at their beginning (`forwards`) or end."""
    order = slice(low, high) if forwards else slice(high - 1, low - 1 if low else None, -1)
    time, values = t[order], x[order]
    away = np.abs(time - time[-1])
    # Rest: up to `_REST` s of it, but never the last cycle and a half before the motion.
    rest = (away > 1.5 * _CYCLE) & (away < _REST + 1.5 * _CYCLE)
    if rest.sum() < 5:
        rest = np.arange(time.size) < max(time.size // 3, 3)
    level = float(np.median(values[rest]))
    noise = float(np.std(values[rest]))
    gone = np.abs(values - level) > _MOVED * noise
    gone[: int(np.flatnonzero(rest)[0])] = False
    twice = np.flatnonzero(gone[:-1] & gone[1:])
    return float(time[twice[0]] if twice.size else time[-1])
