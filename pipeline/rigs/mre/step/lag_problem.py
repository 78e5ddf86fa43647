"""Columns of F = F0 + sum_k g_k y_k - c log10(1 + t) for given lags, and the rows of a log that they are fitted to.

y_k is the part of the measured current that belongs to step k, delayed by L and through one or two lags. Which lags are
taken, and what their errors are, is decided in `lag_fit`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.separable import SeparableFit, fit_separable
from pipeline.rigs.mre.step.lags import lag, response
from pipeline.rigs.mre.step.record import DIRECTIONS, Record

_MOST_DELAY = 1.0  # s
# Rows of a search: so many over the log, and so many samples one by one after each step.
_COARSE, _CLOSE = 1000, 700

Lags = Mapping[str, int]


def name_of(lags: Lags) -> str:
    """Return what a model is called: ``"rise: two lags, fall: one lag"``."""
    words = {1: "one lag", 2: "two lags"}
    return ", ".join(f"{direction}: {words[lags[direction]]}" for direction in DIRECTIONS if direction in lags)


@dataclass(frozen=True, eq=False)
class Rows:
    """Force to fit, shape (n,): times, means of the samples there, and the root of their number as weight."""

    time: np.ndarray
    force: np.ndarray
    weight: np.ndarray

    @classmethod
    def all_of(cls, record: Record, kept: np.ndarray) -> Rows:
        """Return every sample that is kept."""
        return cls(record.time[kept], record.force[kept], np.ones(int(kept.sum())))

    @classmethod
    def thinned(cls, record: Record, kept: np.ndarray) -> Rows:
        """Return the samples that follow each step one by one, and means of neighbours elsewhere: enough for a search."""
        time, force = record.time[kept], record.force[kept]
        period = float(np.median(np.diff(time)))
        group = np.arange(time.size) // max(round(time.size / _COARSE), 1)
        for step in record.steps:
            close = (time > step.onset - 30 * period) & (time < step.onset + _CLOSE * period)
            group = np.where(close, time.size + np.arange(time.size), group)
        _, member, count = np.unique(group, return_inverse=True, return_counts=True)
        mean = [np.bincount(member, weights=values) / count for values in (time, force)]
        order = np.argsort(mean[0], kind="stable")
        return cls(mean[0][order], mean[1][order], np.sqrt(count[order]))


class Problem:
    """Columns of the model for given numbers of lags, at given rows."""

    def __init__(self, record: Record, lags: Lags, rows: Rows, drift: bool = False) -> None:
        self.record, self.lags, self.rows, self.drift = record, dict(lags), rows, drift
        self.names = tuple(
            f"{direction}.{name}"
            for direction, count in self.lags.items()
            for name in ("L", "ln_tau1", "ln_tau2")[: 1 + count]
        )
        self.time = rows.time
        # Lags commute: what filters the force may as well filter the current.
        self.parts = [lag(part, record.filter_lag, record.dt) for part in parts_of(record)]

    def columns(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the columns 1, log10(1 + t), y_k (and t) and their slopes with q."""
        v = dict(zip(self.names, q.tolist(), strict=True))
        n, steps = self.time.size, self.record.steps
        A = np.empty((n, 2 + len(steps) + self.drift))
        if self.drift:
            A[:, -1] = self.time / float(self.record.grid[-1])
        A[:, 0], A[:, 1] = 1.0, np.log10(1 + np.maximum(self.time, 0.0))
        dA = np.zeros((q.size, n, A.shape[1]))
        for number, step in enumerate(steps):
            count = self.lags[step.direction]
            taus = tuple(math.exp(v[f"{step.direction}.ln_tau{i + 1}"]) for i in range(count))
            y, rate, slopes = response(self.parts[number], taus, self.record.dt)
            at = self.time - v[f"{step.direction}.L"]
            first = self.names.index(f"{step.direction}.L")
            found = self._sampled(at, np.vstack([y, -rate, slopes]))
            A[:, 2 + number] = found[0]
            dA[first : first + 1 + count, :, 2 + number] = found[1:]
        return A, dA

    def _sampled(self, at: np.ndarray, curves: np.ndarray) -> np.ndarray:
        """Return curves of the grid, shape (m, grid), at other times: straight between its points, held beyond its ends."""
        place = np.clip((at - self.record.grid[0]) / self.record.dt, 0.0, curves.shape[1] - 1.000001)
        k = place.astype(int)
        share = place - k
        return np.asarray(curves[:, k] * (1 - share) + curves[:, k + 1] * share)

    def fit(self, start: Mapping[str, float], hold: tuple[str, float] | None = None) -> SeparableFit:
        """Fit from a start; with one parameter held where asked for (and no second lag above a first that is held).

        Raises
        ------
        ValueError
            If the columns are not finite there.
        """
        period, length = self.record.period, float(self.record.grid[-1])
        low, high = math.log(0.02 * min(period, 0.01)), math.log(3 * length)
        bounds = {"L": (-_MOST_DELAY, _MOST_DELAY), "ln_tau1": (low, high), "ln_tau2": (low, high)}
        lower, upper = np.array([bounds[name.split(".")[1]] for name in self.names]).T
        q0 = np.array([start[name] for name in self.names])
        if hold is not None:
            at = self.names.index(hold[0])
            q0[at], lower[at], upper[at] = hold[1], hold[1] - 1e-9, hold[1] + 1e-9
            if hold[0].endswith("ln_tau1"):
                upper[at + 1] = max(hold[1], lower[at + 1] + 1e-3)
        scale = np.array([0.02 if name.endswith(".L") else 0.2 for name in self.names])
        return fit_separable(
            self.columns,
            self.rows.force,
            np.clip(q0, lower + 1e-10, upper - 1e-10),
            lower=lower,
            upper=upper,
            scale=scale,
            weights=self.rows.weight,
            tolerance=1e-8 if hold is None else 1e-6,
            max_evaluations=60 if hold is None else 15,
        )


def parts_of(record: Record) -> list[np.ndarray]:
    """Return what each step adds to the current, on the grid: 0 before, the change of the level after."""
    parts = []
    starts = [step.start for step in record.steps]
    for number, step in enumerate(record.steps):
        end = starts[number + 1] if number + 1 < len(starts) else math.inf
        part = np.where(record.grid < step.start, 0.0, record.current - step.before)
        parts.append(np.where(record.grid >= end, step.after - step.before, part))
    return parts
