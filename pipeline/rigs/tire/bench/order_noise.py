"""How large the noise of a run's orders is, from what a fit leaves of them: coloured noise is larger in some than in others.

A standard error by angle only tells the mean over all orders. Road and drum are loud in a band of frequencies, which is other
orders at another speed: the fastest run would weigh more than it knows.
"""

from __future__ import annotations

import numpy as np

# Orders whose residuals are averaged, on either side.
_NEIGHBOURS = 5
# No order is quieter or louder than that beside what its standard errors say: a fit that runs through a point is chance.
_LEAST, _MOST = 1.0, 1e3


def noise_of_orders(residual: np.ndarray, runs: int) -> np.ndarray:
    """Return the noise's standard deviation over what was assumed of it, shape (n,).

    Parameters
    ----------
    residual
        Weighted with the noise assumed: for each of the runs the real parts of its orders, then their imaginary parts,
        shape (n,).
    runs
        Number of runs; all have the same orders.
    """
    squares = (residual.reshape(runs, 2, -1) ** 2).mean(axis=1)
    count = squares.shape[1]
    near = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) <= _NEIGHBOURS
    around = squares @ near / near.sum(axis=1)
    factor = np.sqrt(np.clip(around, _LEAST, _MOST))
    return np.asarray(np.repeat(factor[:, None, :], 2, axis=1).ravel())
