"""Resampling of blocks of time or of whole groups (runs, revolutions, settings).

For statistics without a covariance formula: limits of agreement, peaks, ratios of fitted curves.
Single samples are never resampled: those of a rig are correlated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """A statistic, shape (m,), and its values on resampled data, shape (draws, m)."""

    value: np.ndarray
    draws: np.ndarray

    @property
    def std_error(self) -> np.ndarray:
        """Standard deviation over the draws, shape (m,)."""
        return np.asarray(self.draws.std(axis=0, ddof=1))

    def intervals(self, level: float = 0.95) -> np.ndarray:
        """Return the basic ("reflected") intervals, shape (m, 2).

        Reflection corrects a bias of the statistic, which percentiles would count twice.
        """
        low, high = np.quantile(self.draws, [0.5 - level / 2, 0.5 + level / 2], axis=0)
        return np.stack([2 * self.value - high, 2 * self.value - low], axis=-1)


def blocks(n: int, length: int, draws: int, seed: int = 0) -> Iterator[np.ndarray]:
    """Yield `draws` index arrays of shape (n,) made of blocks of `length` neighbours, wrapped at the end.

    The circular block bootstrap of Politis and Romano (1992). A block must be longer than the
    correlation time; a tenth of the record is the most that still tells the scatter.
    """
    rng = np.random.default_rng(seed)
    length = min(max(length, 1), n)
    for _ in range(draws):
        starts = rng.integers(0, n, math.ceil(n / length))
        yield ((starts[:, None] + np.arange(length)).ravel() % n)[:n]


def groups(labels: Sequence[Hashable] | np.ndarray, draws: int, seed: int = 0) -> Iterator[np.ndarray]:
    """Yield `draws` index arrays that take as many whole groups as there are, with replacement."""
    rng = np.random.default_rng(seed)
    names, member = np.unique(np.asarray(labels), return_inverse=True)
    members = [np.flatnonzero(member == group) for group in range(names.size)]
    for _ in range(draws):
        yield np.concatenate([members[group] for group in rng.integers(0, names.size, names.size)])


def bootstrap(
    statistic: Callable[[np.ndarray], np.ndarray | float], n: int, resampled: Iterator[np.ndarray]
) -> Bootstrap:
    """Evaluate a statistic of row numbers on all rows and on each resampled set of rows.

    Parameters
    ----------
    statistic
        ``statistic(rows) -> number or shape (m,)`` with row numbers, repeats included.
    n
        Rows there are.
    resampled
        From `blocks` or `groups`.

    Raises
    ------
    InputError
        If fewer than half of the draws gave finite numbers.

    Examples
    --------
    >>> x = np.random.default_rng(0).normal(size=400)
    >>> result = bootstrap(lambda rows: x[rows].mean(), x.size, blocks(x.size, 10, 500))
    >>> bool(abs(result.std_error[0] - 0.05) < 0.01)
    True
    """
    value = np.atleast_1d(np.asarray(statistic(np.arange(n)), dtype=float))
    draws = np.array([np.atleast_1d(np.asarray(statistic(rows), dtype=float)) for rows in resampled])
    finite = np.isfinite(draws).all(axis=1) if draws.size else np.zeros(0, dtype=bool)
    if finite.sum() < max(2, draws.shape[0] / 2):
        raise InputError(
            f"only {int(finite.sum())} of {draws.shape[0]} resampled data sets gave a finite result; "
            "too few blocks or groups to tell its scatter."
        )
    return Bootstrap(value, draws[finite])
