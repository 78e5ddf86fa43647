"""How far the clock of a reference table is off that of the transmitter: from changes that both tables show.

An offset is told only by parts of the drive that agree with each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.estimation.uncertainty import effective_size

_FARTHEST = 10.0
_GRID = 0.05
_PARTS = 6
_FEWEST = 15
# Revolutions that tell a lag to the grid.
_ENOUGH = 3000
_SURE, _AGREE = 3.0, 3.0
# Parts that agree to that (s) are near enough to be compared, whatever their errors say; so many tell an odd one.
_CLOSE, _FEWEST_PARTS = 0.05, 5
# A correction below this moves no revolution's number.
_LEAST = 0.04
# Correlation at the best lag from which two signals are taken for the same.
_ALIKE = 0.7


@dataclass(frozen=True, eq=False)
class Pair:
    """A quantity that both tables hold.

    Attributes
    ----------
    values
        What the revolutions say, shape (m,); NaN where nothing.
    reference
        Returns what the reference says at moments of its own clock (s), averaged as a revolution does, shape (m,).
    beside
        What else may move the values in proportion, shape (m,), such as slip; None: nothing.
    """

    values: np.ndarray
    reference: Callable[[np.ndarray], np.ndarray]
    beside: np.ndarray | None = None


@dataclass(frozen=True)
class ClockOffset:
    """Seconds to add to the reference's stamps so that they fit the transmitter's.

    Attributes
    ----------
    offset, std_error
        In the middle of the drive; NaN where nothing tells it.
    rate, rate_se
        How it grows, s/s; 0 where that is not significant.
    middle
        Moment of `offset`, s on the transmitter's clock.
    applies
        Whether it is worth a correction and its parts agree.
    verdict
        The same in words.
    """

    offset: float
    std_error: float
    rate: float
    rate_se: float
    middle: float
    applies: bool
    verdict: str

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return what to subtract from moments of the transmitter (s) to read the reference, shape (m,)."""
        if not self.applies:
            return np.zeros(time.size)
        return np.asarray(self.offset + self.rate * (time - self.middle))


def clock_offset(time: np.ndarray, pairs: Sequence[Pair], farthest: float = _FARTHEST) -> ClockOffset:
    """Return the offset between the clocks from signals that both tables hold.

    The lag of the best correlation within `farthest` (s) first, then least squares of value, its slope in time and
    offset in six parts of the drive for each signal; parts and signals are weighted by their errors, which the
    autocorrelation of the residuals widens.
    """
    middle = float(np.mean(time[[0, -1]])) if time.size else 0.0
    start = _coarse(time, pairs, farthest)
    if start is None:
        return ClockOffset(math.nan, math.nan, 0.0, math.nan, middle, False, "not told: nothing changes in both tables")
    bounds = np.linspace(time[0], time[-1], _PARTS + 1)
    found = []
    for pair in pairs:
        for a, b in pairwise(bounds):
            part = _fine(time, pair, start, (time >= a) & (time <= b))
            if part is not None:
                found.append(part)
    if not found:
        return ClockOffset(start, math.nan, 0.0, math.nan, middle, False, "not told: the changes are too small")
    t, d, se = (np.array(column) for column in zip(*found, strict=True))
    t, d, se = _agreeing(t - middle, d, se)
    t = t + middle
    constant, error, misfit = _weighted(np.ones((t.size, 1)), d, se)
    offset, offset_se, rate, rate_se = float(constant[0]), float(error[0]), 0.0, math.nan
    if t.size >= 3 and np.ptp(t) > 0.0:
        line, line_error, line_misfit = _weighted(np.column_stack([np.ones(t.size), t - middle]), d, se)
        if abs(line[1]) > _SURE * line_error[1] and line_misfit < misfit:
            offset, offset_se, rate, rate_se = (
                float(line[0]),
                float(line_error[0]),
                float(line[1]),
                float(line_error[1]),
            )
            misfit = line_misfit
    told = f"{offset:+.3f} +- {1.96 * offset_se:.3f} s from {t.size} parts"
    apart = d - offset - rate * (t - middle)
    if misfit > _AGREE and float(np.sqrt(np.mean(apart**2))) > _CLOSE:
        return ClockOffset(
            offset, offset_se, rate, rate_se, middle, False, f"parts of the drive contradict each other ({told})"
        )
    if t.size < 2:
        return ClockOffset(offset, offset_se, 0.0, math.nan, middle, False, f"one part only tells it ({told})")
    largest = abs(offset) + abs(rate) * float(np.ptp(time)) / 2.0
    if largest < _LEAST or (abs(offset) < _SURE * offset_se and rate == 0.0):
        return ClockOffset(offset, offset_se, rate, rate_se, middle, False, f"not significant ({told})")
    return ClockOffset(offset, offset_se, rate, rate_se, middle, True, f"parts of the drive agree ({told})")


def _agreeing(t: np.ndarray, d: np.ndarray, se: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the parts that lie about one straight line: a part with an odd signal does not spoil the others."""
    if t.size < _FEWEST_PARTS:
        return t, d, se
    slopes = [
        (d[j] - d[i]) / (t[j] - t[i]) for i in range(t.size) for j in range(i) if abs(t[i] - t[j]) > 0.1 * np.ptp(t)
    ]
    off = d - float(np.median(slopes)) * t
    off = off - np.median(off)
    near = np.abs(off) < np.maximum(5.0 * 1.4826 * np.median(np.abs(off)), 3.0 * se)
    return t[near], d[near], se[near]


def _coarse(time: np.ndarray, pairs: Sequence[Pair], farthest: float) -> float | None:
    """Return the lag (s) at which the correlations together are best; None where no signal is alike at any lag."""
    lags = np.arange(-farthest, farthest + 0.5 * _GRID, _GRID)
    some = slice(None, None, 1 + time.size // _ENOUGH)
    total, best = np.zeros(lags.size), 0.0
    for pair in pairs:
        r = np.array([correlation(pair.values[some], pair.reference(time[some] - lag)) for lag in lags])
        if np.abs(r).max() < _ALIKE:
            continue
        best = max(best, float(np.abs(r).max()))
        # Gaussian log-likelihood of a straight line between the two.
        total += 0.5 * np.isfinite(pair.values[some]).sum() * np.log1p(-np.clip(r**2, 0.0, 0.999999))
    return float(lags[np.argmin(total)]) if best >= _ALIKE else None


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Return the correlation of two signals where both are known; 0 where that is less than half of the first."""
    known = np.isfinite(a) & np.isfinite(b)
    if np.count_nonzero(known) < _FEWEST or 2 * np.count_nonzero(known) < np.count_nonzero(np.isfinite(a)):
        return 0.0
    x, y = a[known] - a[known].mean(), b[known] - b[known].mean()
    size = math.sqrt(float(x @ x) * float(y @ y))
    return float(x @ y) / size if size > 0.0 else 0.0


def _fine(time: np.ndarray, pair: Pair, start: float, part: np.ndarray) -> tuple[float, float, float] | None:
    """Return moment, offset and standard error of one part (s); None where it tells nothing."""
    lag, error, moment = start, math.inf, 0.0
    for _ in range(3):
        at = time[part] - lag
        x = pair.reference(at)
        slope = (pair.reference(at + 0.5 * _GRID) - pair.reference(at - 0.5 * _GRID)) / _GRID
        y = pair.values[part]
        columns = [np.ones(x.size), x, slope] + ([] if pair.beside is None else [pair.beside[part]])
        A = np.column_stack(columns)
        known = np.isfinite(y) & np.isfinite(A).all(axis=1)
        if np.count_nonzero(known) < _FEWEST:
            return None
        A, y = A[known], y[known]
        size = np.sqrt((A**2).sum(axis=0))
        if not (size > 0.0).all():
            return None
        solution, _, rank, _ = np.linalg.lstsq(A / size, y, rcond=1e-8)
        if rank < A.shape[1]:
            return None
        left = y - A / size @ solution
        solution = solution / size
        freedom = max(y.size - A.shape[1], 1)
        variance = float(left @ left) / freedom * y.size / max(effective_size(left), 1.0)
        covariance = np.linalg.inv((A / size).T @ (A / size)) / np.outer(size, size) * variance
        gain, bent = float(solution[1]), float(solution[2])
        if abs(gain) < 5.0 * math.sqrt(covariance[1, 1]):
            return None
        lag -= bent / gain
        error = math.sqrt(covariance[2, 2]) / abs(gain)
        moment = float(np.average(time[part][known], weights=np.abs(slope[known]) + 1e-12))
    return (moment, lag, error) if abs(lag - start) < 4.0 * _GRID and error < 1.0 else None


def _weighted(A: np.ndarray, d: np.ndarray, se: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return weighted least squares, its standard errors (widened by a misfit above 1) and chi2 over degrees of freedom."""
    W = A / se[:, None]
    inverse = np.linalg.pinv(W.T @ W)
    found = inverse @ W.T @ (d / se)
    freedom = d.size - A.shape[1]
    misfit = float((((d - A @ found) / se) ** 2).sum() / freedom) if freedom > 0 else 1.0
    return found, np.sqrt(np.diag(inverse) * max(1.0, misfit)), misfit
