"""Where a torque leaves its course though a drive that droops under load answers only with a lag.

A drive that loses speed under load passes every step on as a first-order lag, some 15 ms long here (moment of
inertia times droop; gearbox.md, 3.5): a straight shape fitted to that comes late by the lag. The lag is found with
the break. Numbers only; which break means what is told in `events`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.uncertainty import autocovariance
from pipeline.rigs.gearbox.stages.stage import EventTime

# Candidates of the first search and of the two finer ones, and of the lag.
_STEPS, _FINER, _LAGS = 40, 15, 7
# Of what a locked drive passes on, the motor's own inertia takes up to that share of all inertias on its shaft.
_MOTOR = 0.1
# How long noise is correlated at the most, as a share of the fitted stretch.
_MEMORY = 0.1
LAGS = (0.002, 0.005, 0.01, 0.018, 0.028, 0.04)
"""Lags tried first, s."""

Shape = Callable[[np.ndarray, float, float], np.ndarray]
"""What a break at t_0 adds: ``shape(time, t_0, lag)``, shape (n, k)."""


def delayed_ramp(late: np.ndarray, lag: float) -> np.ndarray:
    """Zero before the break, then a ramp through a first-order lag; shape (n,)."""
    after = np.maximum(late, 0.0)
    return np.asarray(after - lag * (1.0 - np.exp(-after / lag)))


def delayed_step(late: np.ndarray, lag: float) -> np.ndarray:
    """Zero before the break, then a step through a first-order lag; shape (n,)."""
    return np.asarray(1.0 - np.exp(-np.maximum(late, 0.0) / lag))


@dataclass(frozen=True, eq=False)
class _Fit:
    """Values without what the columns explain, and what is fitted to them; the shape is zero before sample `first`."""

    time: np.ndarray
    rest: np.ndarray
    base: np.ndarray
    shape: Shape
    first: int

    def added(self, t0: float, lag: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Return what the break adds from `first` on, its coefficients, and the squares that are left."""
        columns = self.shape(self.time[self.first :], t0, lag)
        along = self.base[self.first :].T @ columns
        gram = columns.T @ columns - along.T @ along
        gram.flat[:: gram.shape[0] + 1] += 1e-12 * max(float(np.trace(gram)), 1e-30)
        pull = columns.T @ self.rest[self.first :]
        found = np.linalg.solve(gram, pull)
        return columns, found, float(self.rest @ self.rest - pull @ found)

    def beside(self, columns: np.ndarray) -> np.ndarray:
        """Return what columns, shape (n - first, k), add that the others do not explain, shape (n, k)."""
        whole = np.zeros((self.time.size, columns.shape[1]))
        whole[self.first :] = columns
        return np.asarray(whole - self.base @ (self.base.T @ whole))

    def change(self, t0: float, lag: float, step: tuple[float, float]) -> np.ndarray:
        """Return how the fitted curve changes with t_0 or the lag, shape (n, 1)."""
        _, found, _ = self.added(t0, lag)
        time = self.time[self.first :]
        after = self.shape(time, t0 + step[0], lag + step[1])
        before = self.shape(time, t0 - step[0], lag - step[1])
        return self.beside(((after - before) @ found / (2.0 * (step[0] + step[1])))[:, None])


def passed_at_once(event: EventTime) -> EventTime:
    """Return the break of a locked drive's torque allowing for what the motor's own inertia passes on at once.

    The sensor sits behind the motor: T_in = T_m - J_m w', of which only T_m has the lag k_d (J_m + J/a). A break that is
    taken for lagged as a whole comes out early by k_d J_m; J_m is not known, and its share may be anything from none to a tenth.
    """
    most = _MOTOR * event.lag
    return replace(event, time=event.time + 0.5 * most, sd=math.hypot(event.sd, most / math.sqrt(12.0)))


def find_lagged_break(
    time: np.ndarray,
    values: np.ndarray,
    columns: Sequence[np.ndarray],
    shape: Shape,
    within: tuple[float, float],
    lags: Sequence[float] = LAGS,
    noise: np.ndarray | None = None,
) -> tuple[EventTime, np.ndarray]:
    """Return the break time and the lag at which ``values = columns c + shape d`` fits best.

    Parameters
    ----------
    time, values
        s and any unit, shape (n,), evenly spaced.
    columns
        What is there without the break, shape (n,) each.
    shape
        What the break adds.
    within
        First and last candidate, s.
    lags
        Candidates to start from; a single one is held.
    noise
        What the values do about their course elsewhere, at the same rate, where the stretch itself is too short to
        tell it; shape (m,).

    Returns
    -------
    The break with its lag, and the residual sum of squares without and with it, shape (2,). The error comes from slope
    and noise of the values, the noise as correlated as it is found to be, the lag unknown unless held, and from the
    sample interval, within which a jump cannot be placed.

    Examples
    --------
    >>> t = np.arange(0, 1, 0.004)
    >>> noise = 0.005 * np.random.default_rng(1).standard_normal(t.size)
    >>> bend = lambda time, t0, lag: delayed_ramp(time - t0, lag)[:, None]
    >>> found, _ = find_lagged_break(t, 10 * delayed_ramp(t - 0.8, 0.015) + noise, [np.ones_like(t)], bend, (0.5, 0.95))
    >>> abs(found.time - 0.8) < 3 * found.sd < 0.01
    True
    """
    base, _ = np.linalg.qr(np.column_stack(columns))
    low, high = within
    before = int(np.searchsorted(time, low))
    late = before if before and not shape(time[:before], low, float(lags[0])).any() else 0
    fit = _Fit(time, values - base @ (base.T @ values), base, shape, late)
    tried = np.asarray(lags, dtype=float)
    t0, lag, pace = low, float(tried[0]), high - low
    for steps in (_STEPS, _FINER, _FINER):
        candidates = np.linspace(low, high, steps)
        squares = np.array([[fit.added(float(at), float(each))[2] for at in candidates] for each in tried])
        i, j = divmod(int(np.argmin(squares)), steps)
        t0, lag, pace = float(candidates[j]), float(tried[i]), float(candidates[1] - candidates[0])
        low, high = max(t0 - 2 * pace, within[0]), min(t0 + 2 * pace, within[1])
        if tried.size > 1:
            tried = np.geomspace(tried[max(i - 1, 0)], tried[min(i + 1, tried.size - 1)], _LAGS)
    columns_added, found, left = fit.added(t0, lag)
    added = fit.beside(columns_added)
    step = max(0.2 * pace, 1e-5)
    parts = [base, added, fit.change(t0, lag, (step, 0.0))]
    if len(lags) > 1:
        parts.append(fit.change(t0, lag, (0.0, 0.05 * lag)))
    place = base.shape[1] + added.shape[1]
    residual = fit.rest - added @ found
    fitted = place + len(parts) - 2
    rows = np.linalg.pinv(np.column_stack(parts))[place:]
    sd, *rest = (_spread(row, residual, fitted) if noise is None else _spread(row, noise, 1) for row in rows)
    lag_sd = rest[0] if rest else math.nan
    interval = float(np.median(np.diff(time)))
    # A jump may lie anywhere between two samples; what a lag rounds off over several of them is placed that much better.
    sampling = interval / math.sqrt(12.0) * interval / (interval + lag)
    return EventTime(t0, math.hypot(sd, sampling), lag, lag_sd), np.array([float(fit.rest @ fit.rest), left])


def _spread(row: np.ndarray, residual: np.ndarray, fitted: int) -> float:
    """Return the standard deviation of ``row @ noise``, the noise as correlated as the residual is."""
    lags = max(min(int(_MEMORY * residual.size), row.size - 1), 1)
    covariance = autocovariance(residual, lags) * residual.size / max(residual.size - fitted, 1)
    # Parzen's window keeps the spectrum, and so the variance, from being negative.
    x = np.arange(lags + 1) / (lags + 1)
    covariance = covariance * np.where(x < 0.5, 1 - 6 * x**2 * (1 - x), 2 * (1 - x) ** 3)
    overlap = np.correlate(row, row, "full")[row.size - 1 : row.size + lags]
    return math.sqrt(max(float(covariance[0] * overlap[0] + 2 * covariance[1:] @ overlap[1:]), 0.0))
