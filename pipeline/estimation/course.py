"""One number of each run in the order of the runs: level, scatter, slow drift, steps, odd runs.

Right for six runs as for ten thousand: robust against odd runs (Huber), run-to-run scatter and correlation of neighbouring
runs counted, limits that grow with the number of runs. What the number is, and what is said of it, is the rig's.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.estimation.uncertainty import effective_size, t_quantile

# By chance one campaign in twenty names a run odd, and one in a hundred a change.
ODD_CHANCE, CHANGE_CHANCE = 0.05, 0.01
_HUBER = 1.345  # 95 % efficiency for normal scatter
_FEWEST_FOR_ODD, _FEWEST_FOR_DRIFT, _FEWEST_FOR_STEP = 5, 6, 8
_FEWEST_OF_ONE_LEVEL = 3  # on each side of a step: fewer are odd runs
_MOST_CHANGES = 6
_PERMUTATIONS = 199
_MAD = 0.674489750196
# Finite-sample factors of the median absolute deviation (Croux and Rousseeuw, COMPSTAT 1992, 411), for 2 to 9 numbers.
_MAD_FACTORS = (1.196, 1.495, 1.363, 1.206, 1.200, 1.140, 1.129, 1.107)
# Degrees of freedom of the odd-run limit as a share of those of the runs; found by simulation of 5 to 400 normal runs.
_ODD_DOF = 0.6


@dataclass(frozen=True)
class Change:
    """A change over the campaign.

    `size` (SI) is last less first run of a drift, after less before of a step; `first` is the place in the order of the
    first run after a step, 0 of a drift; `chance` how probable one like it is where nothing changes.
    """

    kind: Literal["drift", "step"]
    size: float
    std_error: float
    ci95: tuple[float, float]
    chance: float
    first: int = 0


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
    Weighted Huber regression on group levels; drift and steps are added one by one, the clearest first, as long as chance
    does not explain them. The scatter beyond the own errors makes the median of \\|residual\\| that of normal residuals.
    Drift is tested by t with the effective number of runs, a step by the largest of all places against permutations of
    blocks of runs as long as runs are correlated.

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
    error = np.where(np.isfinite(own[at]) & (own[at] > 0), own[at], 0.0)
    fit = _Fit.of(known[at], error, levels, member)
    terms: list[tuple[np.ndarray, int | None, float]] = []
    while len(terms) < _MOST_CHANGES:
        found = _clearest(fit, order, [k for _, k, _ in terms], seed)
        if found is None or found[2] > CHANGE_CHANCE / among:
            break
        terms.append(found)
        fit = _Fit.of(known[at], error, np.column_stack([levels, *(column for column, _, _ in terms)]), member)
    covariance, dof = fit.covariance(1 + len(terms))
    changes = []
    for number, (_, first, chance) in enumerate(terms, levels.shape[1]):
        size, sd = float(fit.beta[number]), math.sqrt(covariance[number, number])
        half = t_quantile(dof) * sd
        changes.append(Change("drift" if first is None else "step", size, sd, (size - half, size + half), chance,
                              0 if first is None else int(at[first])))  # fmt: skip
    mean = fit.design.mean(axis=0)
    odd, limit = _odd(fit, at, own, ODD_CHANCE / among)
    expected, std_error, of_group, spread = (np.full(known.size, np.nan) for _ in range(4))
    groups_only = np.where(np.arange(mean.size) < levels.shape[1], fit.design, mean)
    of_group[at] = groups_only @ fit.beta
    expected[at], spread[at] = fit.design @ fit.beta, fit.sd
    std_error[at] = np.sqrt(np.einsum("ij,jk,ik->i", fit.design, covariance, fit.design))
    return Course(
        known, own, expected, std_error, of_group, spread, fit.scatter, float(mean @ fit.beta),
        math.sqrt(float(mean @ covariance @ mean)), dof, tuple(changes), odd, limit,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Fit:
    """A weighted Huber regression: design (n, p), coefficients, standard deviation of each run, what is left over.

    `left` is the residual in standard deviations, `free` the share of its variance that the fit left it (1 - leverage).
    """

    design: np.ndarray
    beta: np.ndarray
    sd: np.ndarray
    scatter: float
    left: np.ndarray
    free: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray, error: np.ndarray, design: np.ndarray, member: np.ndarray) -> _Fit:
        n, p = design.shape
        beta: np.ndarray = np.zeros(p)
        for group in range(int(member.max()) + 1):
            beta[group] = np.median(values[member == group])
        free = np.ones(n)
        scatter = 0.0
        sd: np.ndarray = np.ones(n)
        for _ in range(50):
            before = beta
            residual = values - design @ beta
            scatter = _scatter(residual, error, free, p)
            sd = np.hypot(scatter, error)
            sd = np.where(sd > 0, sd, _smallest(values))
            z = np.abs(residual) / sd
            weight = np.sqrt(_HUBER / np.maximum(z, _HUBER)) / sd
            rows = design * weight[:, None]
            beta = np.linalg.lstsq(rows, values * weight, rcond=1e-10)[0]
            free = _free(design / sd[:, None])
            if np.all(np.abs(design @ (beta - before)) <= 1e-7 * sd):
                break
        return cls(design, beta, sd, scatter, (values - design @ beta) / sd, free)

    @property
    def psi(self) -> np.ndarray:
        """What is left over, held to Huber's limit."""
        return np.asarray(np.clip(self.left, -_HUBER, _HUBER))

    def covariance(self, slow: int) -> tuple[np.ndarray, float]:
        """Return the covariance of the coefficients, shape (p, p), and its degrees of freedom; `slow` columns run over all.

        Huber's (Robust Statistics, 1981, eq. 6.6), times the number of runs over their effective number.
        """
        n, p = self.design.shape
        rows = self.design / self.sd[:, None]
        inverse = np.linalg.pinv(rows.T @ rows, rcond=1e-12, hermitian=True)
        if n <= p:
            return inverse, 1.0
        inside = max(float((np.abs(self.left) < _HUBER).mean()), 0.1)
        correction = 1 + p / n * (1 - inside) / inside
        variance = float((self.psi**2).sum()) / (n - p) * (correction / inside) ** 2
        memory = _memory(self.psi, slow)
        return inverse * variance * memory, max((n - p) / memory, 1.0)


def _memory(psi: np.ndarray, slow: int) -> float:
    """Return how many neighbouring runs count as one."""
    return max(psi.size / effective_size(psi, slow), 1.0)


def _free(rows: np.ndarray) -> np.ndarray:
    """Return one less the leverage of each run; 0 where it alone determines a coefficient."""
    Q = _basis(rows)
    free = 1 - (Q**2).sum(axis=1)
    return np.where(free > 1e-9, free, 0.0)


def _basis(rows: np.ndarray) -> np.ndarray:
    U, singular, _ = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(U[:, singular > 1e-10 * singular[:1]])


def _smallest(values: np.ndarray) -> float:
    """Return a standard deviation for numbers without any scatter: their rounding."""
    return float(max(np.abs(values).max() * 1e-12, 1e-300))


def _scatter(residual: np.ndarray, error: np.ndarray, free: np.ndarray, p: int) -> float:
    """Return the standard deviation beyond `error` that makes the median of residuals that of normal ones; 0 for none."""
    judged = free > 0
    size, error = np.abs(residual[judged]) / np.sqrt(free[judged]), error[judged]
    fitted = min(p - 1, size.size - 1)  # so many residuals are small because they were fitted
    n = size.size - fitted
    if n < 2:
        return 0.0
    usual = _MAD / (_MAD_FACTORS[n - 2] if n < 10 else n / (n - 0.8))

    def too_large(scatter: float) -> bool:
        sd = np.hypot(scatter, error)
        return bool(np.median(np.sort(size / np.where(sd > 0, sd, 1e-300))[fitted:]) > usual)

    if not too_large(0.0):
        # More than half of the numbers may be the same by rounding: the mean deviation still tells the others' scatter.
        return 0.0 if error.any() else float(size.mean() * math.sqrt(math.pi / 2))
    low, high = 0.0, float(size.max()) / usual
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if too_large(middle) else (low, middle)
    return high


def _clearest(
    fit: _Fit, order: np.ndarray, known: Sequence[int | None], seed: int
) -> tuple[np.ndarray, int | None, float] | None:
    """Return the column of the change that explains most of what is left, its first run (None: drift), its chance."""
    n, p = fit.design.shape
    if n - p < _FEWEST_FOR_DRIFT - 1:
        return None
    Q, psi = _basis(fit.design / fit.sd[:, None]), fit.psi
    psi = psi - Q @ (Q.T @ psi)
    if not psi @ psi > 0:
        return None
    found: list[tuple[float, np.ndarray, int | None, float]] = []
    if None not in known:
        column = order / fit.sd
        column = column - Q @ (Q.T @ column)
        length = float(column @ column)
        if length > 1e-9 * float((order / fit.sd) @ (order / fit.sd)):
            gain = float(column @ psi) ** 2 / length
            rest = psi - column * float(column @ psi) / length
            memory = _memory(rest, 2 + len(known))
            dof = (n - p - 1) / memory
            t = math.sqrt(gain * dof / max(float(rest @ rest), 1e-12 * gain))
            found.append((gain, order, None, _chance_of_t(t, dof)))
    if n - p >= _FEWEST_FOR_STEP - 1:
        lengths = _lengths_of_steps(1 / fit.sd, Q)
        usable = lengths > 1e-6 * lengths.max(initial=0.0)
        usable[:_FEWEST_OF_ONE_LEVEL] = usable[n - _FEWEST_OF_ONE_LEVEL + 1 :] = False
        for first in known:
            if first is not None:
                usable[max(first - _FEWEST_OF_ONE_LEVEL + 1, 0) : first + _FEWEST_OF_ONE_LEVEL] = False
        places = np.flatnonzero(usable)
        if places.size:
            gains = _gains_of_steps(psi, 1 / fit.sd, lengths, places)
            first = int(places[gains.argmax()])
            column = (np.arange(n) >= first).astype(float)
            found.append(
                (float(gains.max()), column, first, _chance_of_step(psi, fit, lengths, places, first, known, seed))
            )
    if not found:
        return None
    _, column, place, chance = max(found, key=lambda one: one[0])
    return column, place, chance


def _lengths_of_steps(weight: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Return the squared length of each step's weighted column beside what `Q` spans, shape (n,)."""
    after = np.cumsum((Q * weight[:, None])[::-1], axis=0)[::-1]
    return np.asarray(np.cumsum((weight**2)[::-1])[::-1] - (after**2).sum(axis=1))


def _gains_of_steps(psi: np.ndarray, weight: np.ndarray, length: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return by how much a step at each of `places` lowers the sum of squares of `psi`, shape (places,)."""
    after = np.cumsum((psi * weight)[::-1])[::-1][places]
    return np.asarray(after**2 / length[places])


def _chance_of_step(
    psi: np.ndarray,
    fit: _Fit,
    length: np.ndarray,
    places: np.ndarray,
    first: int,
    known: Sequence[int | None],
    seed: int,
) -> float:
    """Return how often chance makes a step as clear as that at `first`, at any of `places`.

    Blocks of runs, as long as runs are alike beside that step, are put into another order; the tail is that of the
    largest of many (Gumbel).
    """
    n = psi.size
    weight = 1 / fit.sd
    column = (np.arange(n) >= first) * weight
    Q = _basis(fit.design * weight[:, None])
    column = column - Q @ (Q.T @ column)
    rest = psi - column * float(column @ psi) / float(column @ column)
    block = math.ceil(_memory(rest, 2 + len(known)) - 0.5)
    rng = np.random.default_rng(seed)
    starts = np.arange(0, n, block)
    found = _clearness(psi, weight, length, places)
    largest = np.empty(_PERMUTATIONS)
    for draw in range(_PERMUTATIONS):
        turned = np.roll(psi, int(rng.integers(0, block)))
        shuffled = turned[(rng.permutation(starts)[:, None] + np.arange(block)).ravel() % n][:n]
        shuffled = shuffled - Q @ (Q.T @ shuffled)
        largest[draw] = _clearness(shuffled, weight, length, places)
    beta = float(largest.std(ddof=1)) * math.sqrt(6) / math.pi
    mode = float(largest.mean()) - 0.5772156649 * beta
    return float(-math.expm1(-math.exp(min(-(found - mode) / max(beta, 1e-12), 50.0))))


def _clearness(psi: np.ndarray, weight: np.ndarray, length: np.ndarray, places: np.ndarray) -> float:
    """Return twice the gain in log-likelihood of the best step, the scatter being fitted with and without it."""
    gain, whole = float(_gains_of_steps(psi, weight, length, places).max()), float(psi @ psi)
    return psi.size * math.log(whole / max(whole - gain, 1e-12 * whole))


def _chance_of_t(t: float, dof: float) -> float:
    from scipy.special import stdtr

    return float(2 * stdtr(max(dof, 1.0), -abs(t)))


def _odd(fit: _Fit, at: np.ndarray, own: np.ndarray, chance: float) -> tuple[tuple[Odd, ...], float]:
    """Return the runs beyond the limit, the farthest first, and the limit."""
    judged = np.flatnonzero(fit.free > 0)
    n, p = fit.design.shape
    if judged.size - p + 1 < _FEWEST_FOR_ODD:
        return (), math.inf
    limit = t_quantile(_ODD_DOF * (n - p), 1 - chance / judged.size)
    z = fit.left[judged] / np.sqrt(fit.free[judged])
    off = fit.left[judged] * fit.sd[judged]
    found = []
    for number in np.flatnonzero(np.abs(z) > limit):
        place = int(at[judged[number]])
        error = own[place]
        known = bool(np.isfinite(error) and error > 0)
        found.append(
            Odd(place, float(off[number]), float(z[number]), float(abs(off[number]) / error) if known else None)
        )
    return tuple(sorted(found, key=lambda odd: (-abs(odd.deviations), odd.place))), limit
