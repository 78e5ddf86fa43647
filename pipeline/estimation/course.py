"""One number of each run in the order of the runs: level, scatter, drift, steps, odd runs.

Right for six runs as for ten thousand: robust against odd runs (Huber), run-to-run scatter and correlation of neighbouring
runs counted, limits that grow with the number of runs. What the number is, and what is said of it, is the rig's.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.estimation.course_changes import Candidate, disentangled, needed, next_change
from pipeline.estimation.robust_fit import RobustFit
from pipeline.estimation.uncertainty import t_quantile

# By chance one campaign in twenty names a run odd, and one in a hundred a change.
ODD_CHANCE, CHANGE_CHANCE = 0.05, 0.01
_FEWEST_FOR_ODD = 5
_MOST_CHANGES = 6
# Degrees of freedom of the odd-run limit as a share of those of the runs; found by simulation of 5 to 400 normal runs.
_ODD_DOF = 0.6


@dataclass(frozen=True)
class Change:
    """A change over the campaign.

    `size` (SI) is last less first run of a drift, after less before of a step, within less outside of a spell; `first` and
    `last` are the places of its first and its last run in the order; `chance` is how probable one like it is where nothing
    changes.
    """

    kind: Literal["drift", "step", "spell"]
    size: float
    std_error: float
    ci95: tuple[float, float]
    chance: float
    first: int
    last: int


@dataclass(frozen=True)
class Odd:
    """A run off the others: its place in the order, by how much (SI), in robust standard deviations, in its own errors.

    `own_errors` is None where its own error is not known.
    """

    place: int
    off: float
    deviations: float
    own_errors: float | None


@dataclass(frozen=True, eq=False)
class Course:
    """What the numbers of n runs do in their order.

    Attributes
    ----------
    values, std_errors
        As given, in order, shape (n,); NaN where not known.
    expected, std_error
        What each run's number is expected to be by its group's level and the changes, and its standard error, shape (n,).
    levels
        Level of each run's group, the changes' mean included, shape (n,).
    spread
        Robust standard deviation of a run about that, its own error included, shape (n,).
    scatter
        Standard deviation between runs beyond their own errors, SI.
    level, level_error
        Mean of `expected`, and its standard error.
    dof
        Degrees of freedom of the errors: neighbouring runs that are alike count less than their number.
    changes
        Those that chance does not explain, the clearest first.
    odd
        Runs farther off than `limit` standard deviations, the farthest first.
    limit
        Beyond it lies one run in one campaign of twenty by chance, if the scatter is normal.
    """

    values: np.ndarray
    std_errors: np.ndarray
    expected: np.ndarray
    std_error: np.ndarray
    levels: np.ndarray
    spread: np.ndarray
    scatter: float
    level: float
    level_error: float
    dof: float
    changes: tuple[Change, ...]
    odd: tuple[Odd, ...]
    limit: float

    @property
    def level_ci95(self) -> tuple[float, float]:
        """95 % interval of the level."""
        half = t_quantile(self.dof) * self.level_error
        return self.level - half, self.level + half


def course(
    values: Sequence[float | None] | np.ndarray,
    std_errors: Sequence[float | None] | np.ndarray | None = None,
    groups: Sequence[Hashable] | None = None,
    *,
    among: int = 1,
    seed: int = 0,
) -> Course:
    """Tell level, scatter, changes and odd runs of one number over runs.

    Parameters
    ----------
    values
        One a run, in the order of the runs, shape (n,), SI; NaN or None where it is not determined.
    std_errors
        Their own standard errors, which need not tell the scatter between runs; shape (n,).
    groups
        What else tells runs apart (a speed, a current): every group has its own level, changes are common; shape (n,).
        Runs that are alone in their group tell nothing of scatter and changes.
    among
        How many numbers of the campaign are looked at in this way: the chance of a false alarm is that of all together.
    seed
        Of the permutations: the same input gives the same result.

    Raises
    ------
    ValueError
        If no value is known.

    Notes
    -----
    Weighted Huber regression on group levels; drift, steps and spells are added one by one, the clearest first, as long as chance
    does not explain them, and dropped again where a later one explains them. The scatter beyond the own errors makes the median of \\|residual\\| that of normal residuals.
    Drift is tested by t with the effective number of runs, a step or a spell by the clearest of all places against the runs in random
    order.

    Examples
    --------
    >>> x = np.random.default_rng(1).normal(10.0, 0.1, 40)
    >>> x[30] = 12.0
    >>> found = course(x)
    >>> [odd.place for odd in found.odd], found.changes, round(found.level, 1)
    ([30], (), 10.0)
    """
    known = np.array([np.nan if value is None else value for value in values], dtype=float)
    own = np.full(known.size, np.nan) if std_errors is None else np.array(
        [np.nan if error is None else error for error in std_errors], dtype=float)  # fmt: skip
    at = np.flatnonzero(np.isfinite(known))
    if not at.size:
        raise ValueError("none of the runs has a value")
    labels = ["" for _ in at] if groups is None else [groups[int(place)] for place in at]
    index = {label: number for number, label in enumerate(dict.fromkeys(labels))}
    member = np.array([index[label] for label in labels])
    levels = (member[:, None] == np.arange(len(index))).astype(float)
    order = np.linspace(-0.5, 0.5, at.size) if at.size > 1 else np.zeros(1)
    error = np.where(np.isfinite(own[at]) & (own[at] > 0), own[at], _rounding(known[at]))
    # About the median, in units of the usual deviation: neither large levels nor small numbers cost digits.
    centre = float(np.median(known[at]))
    off = np.abs(known[at] - centre)
    unit = float(np.quantile(off, 0.9, method="higher")) or float(off.max()) or float(error.max()) or 1.0
    scaled, error = (known[at] - centre) / unit, error / unit

    def refit(terms: Sequence[Candidate]) -> RobustFit:
        return RobustFit.of(scaled, error, np.column_stack([levels, *(term.column for term in terms)]), member)

    terms: list[Candidate] = []
    fit, limit_of_change = refit(terms), CHANGE_CHANCE / among
    for _ in range(_MOST_CHANGES):
        found = next_change(fit, order, terms, refit, limit_of_change, seed)
        if found is None:
            break
        terms, fit = disentangled([*terms, found[0]], found[1], refit)
        kept = needed(fit, terms, limit_of_change)
        if len(kept) < len(terms):
            terms, fit = kept, refit(kept)
    covariance, dof = fit.covariance(1 + len(terms))
    changes = []
    for number, term in enumerate(terms, levels.shape[1]):
        size, sd = unit * float(fit.beta[number]), unit * math.sqrt(covariance[number, number])
        half = t_quantile(dof) * sd
        first, after = term.window or (0, at.size)
        kind: Literal["drift", "step", "spell"] = (
            "drift" if term.window is None else "step" if after == at.size else "spell"
        )
        changes.append(
            Change(kind, size, sd, (size - half, size + half), term.chance, int(at[first]), int(at[after - 1]))
        )
    mean = fit.design.mean(axis=0)
    odd, limit = _odd(fit, unit, at, own, ODD_CHANCE / among)
    expected, std_error, of_group, spread = (np.full(known.size, np.nan) for _ in range(4))
    groups_only = np.where(np.arange(mean.size) < levels.shape[1], fit.design, mean)
    of_group[at] = centre + unit * (groups_only @ fit.beta)
    expected[at], spread[at] = centre + unit * (fit.design @ fit.beta), unit * fit.sd
    std_error[at] = unit * np.sqrt(np.einsum("ij,jk,ik->i", fit.design, covariance, fit.design))
    return Course(
        known, own, expected, std_error, of_group, spread, unit * fit.scatter, centre + unit * float(mean @ fit.beta),
        unit * math.sqrt(float(mean @ covariance @ mean)), dof, tuple(changes), odd, limit,
    )  # fmt: skip


def _rounding(values: np.ndarray) -> float:
    """Return the standard deviation by which numbers are rounded, where so many are the same that they must be; 0 else."""
    different = np.unique(values)
    return float(np.diff(different).min() / math.sqrt(12)) if 1 < different.size <= values.size / 2 else 0.0


def _odd(fit: RobustFit, unit: float, at: np.ndarray, own: np.ndarray, chance: float) -> tuple[tuple[Odd, ...], float]:
    """Return the runs beyond the limit, the farthest first, and the limit."""
    judged = np.flatnonzero(fit.free > 0)
    n, p = fit.design.shape
    if judged.size - p + 1 < _FEWEST_FOR_ODD:
        return (), math.inf
    limit = t_quantile(_ODD_DOF * (n - p), 1 - chance / judged.size)
    z = fit.left[judged] / np.sqrt(fit.free[judged])
    off = unit * fit.left[judged] * fit.sd[judged]
    found = []
    for number in np.flatnonzero(np.abs(z) > limit):
        place = int(at[judged[number]])
        error = own[place]
        known = bool(np.isfinite(error) and error > 0)
        found.append(
            Odd(place, float(off[number]), float(z[number]), float(abs(off[number]) / error) if known else None)
        )
    return tuple(sorted(found, key=lambda odd: (-abs(odd.deviations), odd.place))), limit
