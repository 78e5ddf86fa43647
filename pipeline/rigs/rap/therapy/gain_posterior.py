"""The pump's gain over a run as a wandering quantity: its course in bins and how the errors of that hang together.

The filter tells the error at each moment; a mean or a slope over hours needs to know that neighbours err alike, and how
far the gain strays from its long-run mean. Model: s = mu + w, w of standard deviation sd and memory tau (an
Ornstein-Uhlenbeck process), V its integral over what was asked for and a random walk, echoes as the filter takes them. sd,
tau and the walk are not known: all on a grid count by how well they explain the levels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from pipeline.rigs.rap.therapy.command import Command
from pipeline.rigs.rap.therapy.tank_filter import TankCourse
from pipeline.rigs.rap.therapy.tank_kalman import EMPTY_SD, GAIN_SD, LITRE, NOISE

_UNKNOWN_SD = 5.0
# Of the wander, and the odds of it: eq. 9 takes a gain to stray by 0.02 within an hour.
_SD = np.geomspace(0.003, 0.05, 6)
_USUAL_SD, _SPREAD = 0.012, 0.7
_TAU = np.geomspace(600.0, 14400.0, 5)
# Parts of the variance that eq. 9 drives the volume with, and their odds: a closed tank gains nothing by itself.
_WALK = tuple(zip(NOISE[0] * np.array([1e-3, 1e-2, 1e-1, 1.0]), (0.6, 0.3, 0.08, 0.02), strict=True))
_MOST_BINS = 260
_BIN = 60.0
_COUNTS = 1e-3


@dataclass(frozen=True, eq=False)
class GainPosterior:
    """Gain of the pump in m bins, given all levels.

    Attributes
    ----------
    edges
        Of the bins, s, shape (m + 1,).
    asked
        Volume asked for in each, m^3, shape (m,).
    means, covariances
        Of (gain in each bin, long-run mean), shapes (g, m + 1) and (g, m + 1, m + 1), for each case of sd, tau and walk.
    weights
        How much each case counts, (g,).
    wander_sd, wander_time
        Means of sd (1) and tau (s).
    seen
        Bins with echoes, bool, (m,).
    """

    edges: np.ndarray
    asked: np.ndarray
    means: np.ndarray
    covariances: np.ndarray
    weights: np.ndarray
    wander_sd: float
    wander_time: float
    seen: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        """Middle of each bin, s, (m,)."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))

    @property
    def course(self) -> np.ndarray:
        """Gain in each bin, (m,)."""
        return np.asarray(self.weights @ self.means)[:-1]

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the errors of `course`, (m, m): of each case, and of the cases about their mean."""
        off = self.means[:, :-1] - self.course
        within = np.tensordot(self.weights, self.covariances[:, :-1, :-1], axes=1)
        return np.asarray(within + (self.weights[:, None] * off).T @ off)

    def mean(self, share: np.ndarray) -> tuple[float, float, float]:
        """Return the mean over the run with weights `share` (m,), its standard error, and that as a long-run mean.

        The second is the error of the mean as it was in this run. The third holds that the gain wanders, too: how far the
        long-run mean may be from it.
        """
        value = float(share @ self.course)
        within = np.sqrt(max(float(share @ self.covariance @ share), 0.0))
        lasting = self.covariances[:, -1, -1] + (self.means[:, -1] - value) ** 2
        return value, float(within), float(np.sqrt(self.weights @ lasting))


def gain_posterior(course: TankCourse, command: Command) -> GainPosterior | None:
    """Return the gain over the run; None where fewer than three bins have an echo, or nothing was asked for."""
    from scipy.linalg import cho_factor, cho_solve

    edges = _edges(course)
    m = edges.size - 1
    asked = np.diff(command.volume(edges))
    level, noise, moment, seen = _levels(course, edges)
    if seen.sum() < 3 or not asked.sum() > 0.0:
        return None
    G, start = _integral(course, command, edges, moment)
    walk = np.minimum.outer(moment - edges[0], moment - edges[0])
    rows = np.ix_(seen, seen)
    G, walk = G[seen], walk[rows]
    y = level[seen] - G.sum(axis=1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    lags = np.abs(middle[:, None] - middle[None, :])
    total = G.sum(axis=1)
    base = (start + noise)[rows] + GAIN_SD**2 * np.outer(total, total)
    cases, factors, logs = [], [], []
    for tau in _TAU:
        wandering = G @ np.exp(-lags / tau) @ G.T
        for sd, (driven, odds) in product(_SD, _WALK):
            factor = cho_factor(base + sd**2 * wandering + driven * walk, lower=True, check_finite=False)
            cases.append((sd, tau))
            factors.append(factor)
            misfit = 0.5 * float(y @ cho_solve(factor, y)) + float(np.log(np.diag(factor[0])).sum())
            logs.append(math.log(odds) - 0.5 * (math.log(sd / _USUAL_SD) / _SPREAD) ** 2 - misfit)
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    kept = np.flatnonzero(weights > _COUNTS)
    means, covariances = [], []
    for i in kept:
        sd, tau = cases[i]
        prior = np.full((m + 1, m + 1), GAIN_SD**2)
        prior[:m, :m] += sd**2 * np.exp(-lags / tau)
        cross = prior[:, :m] @ G.T
        means.append(1.0 + cross @ cho_solve(factors[i], y))
        covariances.append(prior - cross @ cho_solve(factors[i], cross.T))
    share = weights[kept] / weights[kept].sum()
    sds, taus = np.array([cases[i] for i in kept]).T
    return GainPosterior(
        edges=edges,
        asked=asked,
        means=np.array(means),
        covariances=np.array(covariances),
        weights=share,
        wander_sd=float(share @ sds),
        wander_time=float(np.exp(share @ np.log(taus))),
        seen=seen,
    )


def _edges(course: TankCourse) -> np.ndarray:
    """Return the edges of equal bins over the course, a minute each, or more where there would be too many."""
    begin, end = float(course.time[0]), float(course.time[-1])
    count = min(max(round((end - begin) / _BIN), 1), _MOST_BINS)
    return np.linspace(begin, max(end, begin + 1.0), count + 1)


def _levels(course: TankCourse, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return by bin: mean level and its covariance (litres), mean moment of the echoes, whether there were any."""
    m = edges.size - 1
    used = np.isfinite(course.measured_volume) & ~course.gated
    bins = np.clip(np.searchsorted(edges, course.time, side="right") - 1, 0, m - 1)
    # Where a filling ends within a bin, the one with more levels counts.
    fillings = len(course.segments)
    filling = np.minimum(np.searchsorted([s.end for s in course.segments], course.time), fillings - 1)
    counts = np.bincount(bins[used] * fillings + filling[used], minlength=m * fillings).reshape(m, fillings)
    used &= filling == counts.argmax(axis=1)[bins]
    member = bins[used]
    count = np.bincount(member, minlength=m)
    seen = count > 0
    n = np.maximum(count, 1)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.asarray(np.bincount(member, weights=values[used], minlength=m) / n)

    middle = 0.5 * (edges[1:] + edges[:-1])
    common = mean(course.common_sd) / LITRE
    noise = np.diag(mean(course.echo_variance) / n / LITRE**2) + np.outer(common, common)
    return mean(course.measured_volume) / LITRE, noise, np.where(seen, mean(course.time), middle), seen


def _integral(
    course: TankCourse, command: Command, edges: np.ndarray, moment: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what the gains of the bins have let in by each moment (m, m), litre, and the covariance of the start (m, m)."""
    ends = np.array([s.end for s in course.segments])
    filling = np.minimum(np.searchsorted(ends, moment), ends.size - 1)
    begins = np.array([s.begin for s in course.segments])[filling]
    # What was asked for between the filling's begin, or the bin's, and the moment, or the bin's end.
    low = np.maximum(edges[:-1][None, :], begins[:, None])
    high = np.minimum(edges[1:][None, :], moment[:, None])
    shape = low.shape
    asked = command.volume(np.maximum(high, low).ravel()) - command.volume(low.ravel())
    sd = np.array([EMPTY_SD if s.known_empty else _UNKNOWN_SD for s in course.segments])[filling]
    same = filling[:, None] == filling[None, :]
    return asked.reshape(shape) / LITRE, np.where(same, (sd**2)[:, None], 0.0)
