"""By how much loads, sensor gains and pressures differ from run to run, unseen: found from the runs themselves.

Averages of many turns are far more exact than a bench repeats itself. Taken as exact, small differences between runs
would be read as stiffness and lag, with errors that tell nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.rigs.tire.bench.ring_model import NAMES, RingModel

# Searched from what hides in the noise to what no bench should have (relative); twice the gain of likelihood that is asked.
_SIZES = np.geomspace(1e-4, 0.1, 61)
_CONVINCING = 2.0
_TRIED, _NONE = 1e-3, 1e-6


def run_scatter(model: RingModel, x: np.ndarray) -> float:
    """Return the most likely relative standard deviation of load, gain and pressure between runs; 0 if none convinces.

    Parameters
    ----------
    model, x
        Without scatter, and its best coordinates.

    Notes
    -----
    Marginal likelihood of the linearised residual, all coordinates integrated out: r'r less what they explain, plus
    ln det of the posterior over the prior precision. One deviation stands for all three: their waveforms are too alike to
    tell them apart with a handful of runs.
    """
    wide = RingModel(model.runs, model.known, _TRIED)
    start = np.zeros(wide.size)
    start[: len(NAMES)] = x[: len(NAMES)]
    for i in range(len(model.runs)):
        own = model.own(i)
        start[wide.own(i).start : wide.own(i).start + model.owned] = x[own]
    if model.heights:
        start[-1] = x[-1]
    rows = sum(w.size for w in wide.weights) + len(wide.heights)
    J, r = wide.jacobian(start)[:rows], wide.residual(start)[:rows]

    centre = np.zeros(wide.size)

    def spread(scatter: float) -> np.ndarray:
        sd = np.full(wide.size, np.inf)
        for at, value, own in RingModel(wide.runs, wide.known, scatter).priors:
            sd[at], centre[at] = own, value
        return sd

    spread(_TRIED)
    return likely_scatter(J.T @ J, J.T @ r, start - centre, spread)


def likely_scatter(A: np.ndarray, g: np.ndarray, x: np.ndarray, spread: Callable[[float], np.ndarray]) -> float:
    """Return the scatter of the highest marginal likelihood; 0 where it is no better than none.

    Parameters
    ----------
    A, g
        J'J and J'r of the data alone, at x.
    x
        Coordinates less the middles of their priors, shape (n,).
    spread
        Standard deviations of the priors for a scatter, infinite where there is no prior, shape (n,).
    """
    costs = np.array([_cost(A, g, x, spread(s)) for s in _SIZES])
    best = int(np.argmin(costs))
    return float(_SIZES[best]) if _cost(A, g, x, spread(_NONE)) - costs[best] > _CONVINCING else 0.0


def _cost(A: np.ndarray, g: np.ndarray, x: np.ndarray, sd: np.ndarray) -> float:
    """Return -2 ln(marginal likelihood) but for a constant."""
    precision = sd**-2.0
    posterior = A + np.diag(precision)
    pull = g + precision * x
    size = 1.0 / np.sqrt(np.diag(posterior))
    step = size * np.linalg.solve(posterior * np.outer(size, size), size * pull)
    determinant = float(np.linalg.slogdet(posterior * np.outer(size, size))[1] - 2.0 * np.log(size).sum())
    known = np.isfinite(sd)
    return float(x[known] @ (precision * x)[known] - pull @ step) + determinant + 2.0 * float(np.log(sd[known]).sum())


__all__ = ["likely_scatter", "run_scatter"]
