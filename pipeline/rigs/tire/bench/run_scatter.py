"""By how much loads, sensor gains and pressures differ from run to run, unseen: found from the runs themselves.

Averages of many turns are far more exact than a bench repeats itself. Taken as exact, small differences between runs
would be read as stiffness and lag, with errors that tell nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from pipeline.rigs.tire.bench.ring_model import NAMES, RingModel
from pipeline.rigs.tire.bench.ring_run import Scatter

# From what hides in the noise to what no bench should have (relative), and factors on what a rotation is uneven by.
_LEVELS = np.array([1e-5, 3e-4, 8e-4, 1.6e-3, 3e-3, 6e-3, 1.5e-2, 4e-2, 1e-1])
_FINE = np.array([1e-6, *np.geomspace(1e-4, 0.1, 31)])
_UNEVEN = np.array([0.3, 0.4, 0.55, 0.75, 1.0, 1.4, 2.0])
# How well the unevenness of benches is known beforehand, as a factor: a few runs tell it badly.
_USUAL = np.log(1.7)
# Less than that is none.
_LEAST = 1e-4
_TRIED = Scatter(1e-3, 1e-3, 1e-3)


def run_scatter(model: RingModel, x: np.ndarray) -> Scatter:
    """Return by how much load, gain and pressure of the runs differ, and how uneven the rotation is within the turn.

    Parameters
    ----------
    model, x
        Without scatter, and its best coordinates.

    Notes
    -----
    Marginal likelihood of the linearised residual, all coordinates integrated out, over a grid of the three deviations (each
    as likely at any order of magnitude); the root of the mean of their squares is told. Their most likely values are too
    small as often as not: a handful of runs tells a deviation badly, and the mean holds that.
    """
    wide = RingModel(model.runs, model.known, _TRIED)
    start = np.zeros(wide.size)
    start[: len(NAMES)] = x[: len(NAMES)]
    for i in range(len(model.runs)):
        start[wide.own(i).start : wide.own(i).start + model.owned] = x[model.own(i)]
    if model.heights:
        start[-1] = x[-1]
    rows = sum(w.size for w in wide.weights) + len(wide.heights)
    J, r = wide.jacobian(start)[:rows], wide.residual(start)[:rows]
    A, g = J.T @ J, J.T @ r
    centre = np.zeros(wide.size)
    for at, value, _ in wide.priors:
        centre[at] = value

    own = [wide.own(i) for i in range(len(wide.runs))]

    def spread(scatter: Scatter) -> np.ndarray:
        sd = np.full(wide.size, np.inf)
        for at, _, size in RingModel.priors_of(wide.runs, wide.known, scatter):
            sd[at] = size
        return sd

    tried = [Scatter(float(a), float(b), float(c)) for a, b, c in product(_LEVELS, repeat=3)]
    share = _shares(A, g, start - centre, np.array([spread(one) for one in tried]), own)
    load, gain, pressure = np.sqrt(share @ np.array([(s.load, s.gain, s.pressure) for s in tried]) ** 2)
    found = Scatter(*(float(s) if s > _LEAST else 0.0 for s in (load, gain, pressure)))
    uneven = [replace(found, uneven=float(factor)) for factor in _UNEVEN]
    share = _shares(A, g, start - centre, np.array([spread(one) for one in uneven]), own) * np.exp(
        -0.5 * (np.log(_UNEVEN) / _USUAL) ** 2
    )
    share /= share.sum()
    return replace(found, uneven=float(np.sqrt(share @ _UNEVEN**2)))


def likely_scatter(A: np.ndarray, g: np.ndarray, x: np.ndarray, spread: Callable[[float], np.ndarray]) -> float:
    """Return the root mean square of a scatter by its marginal likelihood; 0 where it is lost in the noise.

    Parameters
    ----------
    A, g
        J'J and J'r of the data alone, at x.
    x
        Coordinates less the middles of their priors, shape (n,).
    spread
        Standard deviations of the priors for a scatter, infinite where there is no prior, shape (n,).
    """
    share = _shares(A, g, x, np.array([spread(float(s)) for s in _FINE]))
    found = float(np.sqrt(share @ _FINE**2))
    return found if found > _LEAST else 0.0


def _shares(A: np.ndarray, g: np.ndarray, x: np.ndarray, spreads: np.ndarray, own: Sequence[slice] = ()) -> np.ndarray:
    """Return how likely each of the priors is, their standard deviations of shape (m, n), shape (m,); their sum is one.

    `own` are coordinates of single runs, which nothing but what all share ties to each other: they are solved for alone.
    """
    costs = _costs(A, g, x, spreads, own)
    share = np.exp(-0.5 * (costs - costs.min()))
    return np.asarray(share / share.sum())


def _costs(A: np.ndarray, g: np.ndarray, x: np.ndarray, sd: np.ndarray, own: Sequence[slice]) -> np.ndarray:
    """Return -2 ln(marginal likelihood) but for a constant, shape (m,)."""
    known = np.isfinite(sd)
    precision = np.where(known, sd, 1.0) ** -2.0 * known
    pull = g + precision * x
    costs = (precision * x**2).sum(axis=1) + 2.0 * np.log(np.where(known, sd, 1.0)).sum(axis=1)
    shared = np.setdiff1d(
        np.arange(x.size), np.concatenate([np.arange(x.size)[one] for one in own] or [np.zeros(0, int)])
    )
    rest, along = A[np.ix_(shared, shared)] + _diagonal(precision[:, shared]), pull[:, shared]
    for one in own:
        across = A[one][:, shared]
        right = np.concatenate([np.broadcast_to(across, (len(sd), *across.shape)), pull[:, one, None]], axis=2)
        solved, logarithm = _solved(A[one, one] + _diagonal(precision[:, one]), right)
        rest = rest - across.T @ solved[:, :, :-1]
        along = along - solved[:, :, -1] @ across
        costs += logarithm - (pull[:, one] * solved[:, :, -1]).sum(axis=1)
    solved, logarithm = _solved(rest, along[:, :, None])
    return np.asarray(costs + logarithm - (along * solved[:, :, 0]).sum(axis=1))


def _diagonal(values: np.ndarray) -> np.ndarray:
    return np.asarray(values[:, :, None] * np.eye(values.shape[1]))


def _solved(matrices: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the solutions, shape as `right`, and the logarithms of the determinants, shape (m,)."""
    size = 1.0 / np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))
    even = matrices * size[:, :, None] * size[:, None, :]
    solved = size[:, :, None] * np.linalg.solve(even, size[:, :, None] * right)
    return solved, np.linalg.slogdet(even)[1] - 2.0 * np.log(size).sum(axis=1)


__all__ = ["likely_scatter", "run_scatter"]
