"""Errors of a straight line through values whose errors hang together for most of an hour.

Blocks of residuals alone tell two thirds of the error: two numbers were fitted, and neighbouring blocks err alike. The
covariance that the gain's course brings along knows both; blocks guard against errors that it does not know of.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.bootstrap import blocks

_DRAWS = 400


@dataclass(frozen=True, eq=False)
class LineErrors:
    """Covariance (2, 2) of a line's two numbers, degrees of freedom, and what blocks alone give as standard errors, (2,)."""

    covariance: np.ndarray
    dof: float
    blocks_alone: np.ndarray


def line_errors(residual: np.ndarray, H: np.ndarray, shape: np.ndarray, length: int, seed: int = 0) -> LineErrors:
    """Return the errors of ``H @ values``.

    Parameters
    ----------
    residual
        Values less the line, shape (n,), in the order of time.
    H
        Pseudo-inverse of the line's columns, shape (2, n).
    shape
        Covariance of the values' errors, shape (n, n).
    length
        Values in a block.
    """
    n = residual.size
    rows = np.stack(list(blocks(n, length, _DRAWS, seed)))
    alone = np.asarray((residual[rows] @ H.T).var(axis=0, ddof=1)) * _few(n / length)
    model = H @ shape @ H.T
    # Where blocks alone tell more, there are errors that the gain's course does not know of.
    more = np.sqrt(np.maximum(alone / np.maximum(np.diag(model), 1e-300), 1.0))
    dof = math.inf if np.all(more == 1.0) else max(n / length - 2.0, 1.0)
    return LineErrors(model * np.outer(more, more), dof, np.sqrt(alone))


def _few(count: float) -> float:
    """Return by what the variance over `count` blocks grows for the two numbers that were fitted to them."""
    return count / max(count - 2.0, 1.0)


def student_two_sided(t: float, dof: float) -> float:
    """Return the probability of a Student variable beyond +-t."""
    from scipy.special import ndtr, stdtr

    if not math.isfinite(t):
        return math.nan
    return float(2.0 * (ndtr(-abs(t)) if not math.isfinite(dof) else stdtr(max(dof, 1.0), -abs(t))))
