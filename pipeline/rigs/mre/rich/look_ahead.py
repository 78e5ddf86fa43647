"""Displacement without noise and without phase shift while a log comes in: symmetric filters that look ahead.

A causal low-pass would delay the displacement against the force and the loop would be another; here both wait for
`LookAhead.delay` seconds instead. Gaps part the stream. Nothing is fitted here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# Steps of the filter per period of the cutoff, as in the batch fit: 60 Hz gives 1 kHz.
STEPS_PER_PERIOD = 16.0
_WIDTH, _BETA = (
    3.0,
    6.0,
)  # half-width of the kernel in periods of the cutoff, and its Kaiser window: 1e-3 beside the pass band
_RATE_FROM = 256  # samples from which the rate of the log is taken
_PIECE = 1 << 14
_HIGHEST = 0.4  # of the rate


@dataclass(frozen=True, eq=False)
class Steps:
    """What the filter is fed with, one row a step.

    Attributes
    ----------
    time
        Of the end of each step, s, shape (n,).
    path
        Displacement along each step, its start and end included, m, shape (n, pieces + 1).
    velocity, force
        At its end, m/s and N (NaN where not measured), shape (n,).
    fresh
        True where the step before is unknown: the first, and the first after a gap.
    """

    time: np.ndarray
    path: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    fresh: np.ndarray

    @classmethod
    def none(cls, pieces: int = 1) -> Steps:
        """No step."""
        return cls(np.zeros(0), np.zeros((0, pieces + 1)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool))

    def first(self, count: int) -> Steps:
        """Return the first so many."""
        return Steps(
            self.time[:count], self.path[:count], self.velocity[:count], self.force[:count], self.fresh[:count]
        )

    @classmethod
    def joined(cls, parts: list[Steps]) -> Steps:
        """Steps of several parts one after the other."""
        if not parts:
            return cls.none()
        names = ("time", "path", "velocity", "force", "fresh")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


class LookAhead:
    """Takes samples as they come, gives steps as soon as the samples after them are there."""

    def __init__(self, cutoff: float, force_lag: float = 0.0) -> None:
        """`cutoff` (Hz) of the filter on the displacement; the force is late by a known `force_lag` (s)."""
        self.wanted, self.force_lag = cutoff, force_lag
        self.rate = math.nan
        self._waiting: list[np.ndarray] = []
        self._raw = np.zeros((3, 0))

    @property
    def started(self) -> bool:
        """Tell whether the rate of the log is known."""
        return math.isfinite(self.rate)

    def feed(self, time: np.ndarray, x: np.ndarray, force: np.ndarray) -> Steps:
        """Take the next samples (s, m, N; shape (n,) each, NaN where not measured); return the steps that are complete."""
        known = np.isfinite(x) & np.isfinite(time)
        block = np.array([time[known], x[known], force[known]], dtype=float)
        if not self.started:
            self._waiting.append(block)
            if sum(part.shape[1] for part in self._waiting) < _RATE_FROM:
                return Steps.none()
            block = np.concatenate(self._waiting, axis=1)
            self._design(block[0, :_RATE_FROM])
        parts = [self._continued(block[:, i : i + _PIECE]) for i in range(0, block.shape[1], _PIECE)]
        return Steps.joined([part for part in parts if part.time.size] or [Steps.none(self.pieces)])

    @property
    def delay(self) -> float:
        """By how much the steps lag behind the log, s."""
        return self.half / self.rate

    def _design(self, time: np.ndarray) -> None:
        step = float(np.median(np.diff(time)))
        whole = np.diff(time)[np.abs(np.diff(time) - step) < 0.5 * step]
        self.rate = 1 / float(whole.mean())
        self.cutoff = min(self.wanted, _HIGHEST * self.rate)
        self.every = max(round(self.rate / (STEPS_PER_PERIOD * self.cutoff)), 1)
        self.pieces = max(math.ceil(0.9 * STEPS_PER_PERIOD * self.cutoff / self.rate), 1)
        self.half = math.ceil(_WIDTH * self.rate / self.cutoff)
        self.longest_gap = max(2.5 / self.rate, 0.25 / self.cutoff)
        self.kernels = [self._kernel(self.cutoff, self.half, j / self.pieces) for j in range(self.pieces)]
        self.slope = self._slope()
        anti_alias = 0.4 * self.rate / self.every
        self.force_half = math.ceil(_WIDTH * self.rate / anti_alias) if self.every > 1 else 0
        self.force_half = min(self.force_half, self.half)
        self.force_kernel = self._kernel(anti_alias, self.force_half) if self.every > 1 else np.ones(1)
        self._clear()

    def _kernel(self, cutoff: float, half: int, late: float = 0.0) -> np.ndarray:
        """Return a windowed sinc that gives the value `late` samples after the middle one."""
        at = np.arange(-half, half + 1) - late
        window = np.i0(_BETA * np.sqrt(np.maximum(1 - (at / (half + 1)) ** 2, 0.0)))
        kernel = np.sinc(2 * cutoff / self.rate * at) * window
        return np.asarray(kernel / kernel.sum())

    def _slope(self) -> np.ndarray:
        """Return the kernel of the velocity: the derivative of the smoothed displacement."""
        fine = 1e-3
        ahead, back = (self._kernel(self.cutoff, self.half, side * fine) for side in (1.0, -1.0))
        return np.asarray((ahead - back) / (2 * fine) * self.rate)

    def _clear(self) -> None:
        self._raw = np.zeros((3, 0))
        self._grid = np.zeros((2, 0))
        self._first = math.nan  # time of grid sample 0 of the stretch
        self._dropped = 0  # grid samples that are no longer held
        self._next = self.half  # grid sample of the next step
        self._last_x = math.nan

    def _continued(self, block: np.ndarray) -> Steps:
        parts = []
        joined = np.concatenate([self._raw, block], axis=1)
        start = 0
        for gap in (np.flatnonzero(np.diff(joined[0]) > self.longest_gap) + 1).tolist():
            parts.append(self._grown(joined[:, start:gap], closed=True))
            self._clear()
            start = gap
        parts.append(self._grown(joined[:, start:], closed=False))
        return Steps.joined([part for part in parts if part.time.size] or [Steps.none(self.pieces)])

    def _grown(self, raw: np.ndarray, closed: bool) -> Steps:
        """Bring samples onto the grid as far as their neighbours are there, and take the steps that this allows."""
        self._raw = raw
        if raw.shape[1] < 4:
            return Steps.none(self.pieces)
        stamps = raw[0] - self.force_lag
        if math.isnan(self._first):
            self._first = max(raw[0, 0], stamps[0])
        ready = min(raw[0, -1 if closed else -2], stamps[-1 if closed else -2])
        have = self._dropped + self._grid.shape[1]
        new = self._first + np.arange(have, math.floor((ready - self._first) * self.rate + 1e-6) + 1) / self.rate
        if new.size:
            grid = np.array([_cubic(raw[0], raw[1], new), _cubic(stamps, raw[2], new)])
            self._grid = np.concatenate([self._grid, grid], axis=1)
            older = min(raw[0].searchsorted(new[-1]), stamps.searchsorted(new[-1])) - 4
            self._raw = raw[:, max(int(older), 0) :]
        return self._steps()

    def _steps(self) -> Steps:
        half, every = self.half, self.every
        last = self._dropped + self._grid.shape[1] - 1 - half
        at = np.arange(self._next, last + 1, every)
        if not at.size:
            return Steps.none(self.pieces)
        # From one grid sample before: pieces of a step begin there.
        low = at[0] - every - half - self._dropped
        x = self._grid[0, max(low, 0) : at[-1] + half + 1 - self._dropped]
        middle = self._dropped + max(low, 0) + half  # grid sample of the first smooth value
        smooth = np.correlate(x, self.kernels[0], "valid")
        ends = smooth[at - middle]
        starts = np.r_[self._last_x, ends[:-1]]
        path = np.empty((at.size, self.pieces + 1))
        path[:, 0], path[:, -1] = starts, ends
        for j in range(1, self.pieces):  # only where the log is so coarse that every sample is a step
            path[1:, j] = np.correlate(x, self.kernels[j], "valid")[at[1:] - 1 - middle]
            path[0, j] = starts[0] + (ends[0] - starts[0]) * j / self.pieces
        velocity = np.correlate(x[at[0] - middle :], self.slope, "valid")[at - at[0]]
        around = self._grid[1, at[0] - self.force_half - self._dropped : at[-1] + self.force_half + 1 - self._dropped]
        force = np.correlate(around, self.force_kernel, "valid")[at - at[0]]
        fresh = np.zeros(at.size, dtype=bool)
        if math.isnan(self._last_x):
            fresh[0], path[0] = True, ends[0]
        self._last_x, self._next = float(ends[-1]), int(at[-1]) + every
        keep = max(self._next - every - half - self._dropped, 0)
        self._grid = self._grid[:, keep:]
        self._dropped += keep
        return Steps(self._first + at / self.rate, path, velocity, force, fresh)


def _cubic(t: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Interpolate through the four samples around each place; straight where they are not all there."""
    i = np.clip(np.searchsorted(t, at, "right") - 1, 0, t.size - 2)
    left = np.clip(i - 1, 0, t.size - 4)
    out = np.zeros(at.size)
    for a in range(4):
        weight = np.ones(at.size)
        for b in range(4):
            if a != b:
                weight *= (at - t[left + b]) / (t[left + a] - t[left + b])
        out += np.where(weight == 0, 0.0, weight * values[left + a])
    return np.asarray(out)
