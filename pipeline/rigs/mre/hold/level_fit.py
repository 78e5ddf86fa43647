"""Force at each level of the current without any law between them: F = A_level (1 - r log10(t/t0)) + d t/T.

Levels held more than once tell how far holds repeat; so this fit is what the law is tested against, what tells relaxation from
a drift of the sensor, and what increments come from where the law does not fit. What follows from that is said elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.separable import covariance_of
from pipeline.rigs.mre.hold.law_fit import Rows

_PASSES = 8
_FEWEST_REPEATS = 3


@dataclass(frozen=True, eq=False)
class LevelFit:
    """Levels (A, rising, the mean of their holds) with the force at t0, N; order of `covariance`: levels, r, and d where it was fitted.

    `level_of` tells the level of each hold, shape (H,); `residual` of means and creep is weighted; `spare` is the number of means beyond those that the
    parameters use up, `scatter` the standard deviation of a hold's mean beyond what its samples explain, N.
    """

    rows: Rows
    current: np.ndarray
    level_of: np.ndarray
    force: np.ndarray
    r: float
    drift: float
    covariance: np.ndarray
    residual: np.ndarray
    mean_sd: np.ndarray
    creep_sd: float
    scatter: float
    spare: float
    chi2: float

    @property
    def drift_sd(self) -> float:
        """Standard error of the drift over the log, N; infinite where none was fitted."""
        there = self.covariance.shape[0] > self.current.size + 1
        return math.sqrt(float(self.covariance[-1, -1])) if there else math.inf

    @property
    def r_sd(self) -> float:
        """Standard error of the relaxation."""
        n = self.current.size
        return math.sqrt(float(self.covariance[n, n]))

    @property
    def repeats(self) -> bool:
        """Tell whether enough levels were held twice to judge how far holds repeat."""
        return self.spare >= _FEWEST_REPEATS

    def increment(self, level: int) -> tuple[float, float]:
        """Return the force at a level over that at the lowest, less 1, and its standard error."""
        low, high = float(self.force[0]), float(self.force[level])
        g = np.zeros(self.covariance.shape[0])
        g[0] -= high / low**2
        g[level] += 1 / low
        return high / low - 1, math.sqrt(max(float(g @ self.covariance @ g), 0.0))


def fit_levels(rows: Rows, level_of: np.ndarray, *, drift: bool) -> LevelFit:
    """Fit one force a level, relaxation, and a drift where asked for, their variances estimated along.

    Parameters
    ----------
    rows
        Means and creep of the holds.
    level_of
        Number of the level of each hold, 0 for the lowest, shape (H,).
    drift
        Whether a part that goes with time is fitted.

    Raises
    ------
    ValueError
        If there are fewer data than parameters.
    """
    n, levels = rows.force.size, int(level_of.max()) + 1
    there = rows.has_creep
    of_creep = level_of[there]
    y = np.r_[rows.force, rows.creep_force[there]]
    if y.size < levels + 2 + drift:
        raise ValueError(f"{y.size} data cannot determine {levels + 1 + drift} parameters")
    member = np.r_[np.eye(levels)[level_of], np.eye(levels)[of_creep]]
    log = np.r_[rows.log, rows.creep_log[there]]
    base = np.r_[np.ones(n), np.zeros(int(there.sum()))]
    clock = np.r_[rows.clock, rows.creep_clock[there]]
    A = np.array([float(rows.force[level_of == k].mean()) for k in range(levels)])
    r, d, scatter = 0.0, 0.0, 0.0
    creep_sd = max(1.4826 * float(np.median(np.abs(rows.creep_force[there]))), 1e-9) if there.any() else 1.0
    for _ in range(_PASSES):
        sd = np.r_[np.sqrt(rows.white + scatter**2), np.full(int(there.sum()), creep_sd)]
        J = np.column_stack([member * (base - r * log)[:, None], -A[np.r_[level_of, of_creep]] * log])
        J = np.column_stack([J, clock]) if drift else J
        rest = y - A[np.r_[level_of, of_creep]] * (base - r * log) - d * clock
        step = np.linalg.lstsq(J / sd[:, None], rest / sd, rcond=None)[0]
        A, r = A + step[:levels], r + float(step[levels])
        d = d + float(step[-1]) if drift else 0.0
        raw = y - A[np.r_[level_of, of_creep]] * (base - r * log) - d * clock
        covariance, _ = covariance_of(J / sd[:, None])
        pull = np.clip(np.einsum("ij,jk,ik->i", J, covariance, J) / sd**2, 0, 1)
        spare = n - float(pull[:n].sum())
        if spare >= 1:
            explained = float(((1 - pull[:n]) * rows.white).sum()) / spare
            scatter = math.sqrt(max(float((raw[:n] ** 2).sum()) / spare - explained, 0.0))
        if there.any():
            creep_sd = max(math.sqrt(float((raw[n:] ** 2).sum()) / max(there.sum() - float(pull[n:].sum()), 1.0)), 1e-9)
    weighted = raw / sd
    current = np.array([float(rows.current[level_of == k].mean()) for k in range(levels)])
    return LevelFit(
        rows, current, level_of, A, r, d, covariance, weighted, sd[:n], float(sd[-1]) if there.any() else 1.0,
        scatter, spare, float(weighted @ weighted),
    )  # fmt: skip
