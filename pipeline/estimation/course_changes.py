"""Which change of runs in their order is the clearest, and how probable one like it is by chance: a drift, a step, a spell.

One is looked for at a time, beside those that are known; `course` adds them up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pipeline.estimation.robust_fit import RobustFit, basis, huber

_FEWEST_FOR_DRIFT, _FEWEST_FOR_STEP = 6, 8
_FEWEST_OF_ONE_LEVEL = 3  # runs between two steps: fewer are odd runs
_ENDS_OF_SPELLS = 48  # places at which spells are looked for before their ends are found to the run
_PERMUTATIONS = 199
_NUMBERS_AT_ONCE = 500_000


@dataclass(frozen=True, eq=False)
class Candidate:
    """A change that may be: its column (n,), its first run and the one after its last (None: drift), its chance."""

    column: np.ndarray
    window: tuple[int, int] | None
    chance: float


def next_change(
    fit: RobustFit,
    order: np.ndarray,
    known: Sequence[Candidate],
    refit: Callable[[Sequence[Candidate]], RobustFit],
    limit: float,
    seed: int,
) -> tuple[Candidate, RobustFit] | None:
    """Return the change that explains most of what `fit` leaves, of those chance does not, and the fit with it; None for none.

    `order` is the column of a drift, -1/2 to 1/2; `known` are changes that the fit holds already; `refit` fits with changes;
    `limit` is the largest chance at which one counts.
    """
    n, p = fit.design.shape
    if n - p < _FEWEST_FOR_DRIFT - 1:
        return None
    left = _Left.by(fit)
    if not left.psi @ left.psi > 0:
        return None
    # Each end of a window is fitted as well: a drift is not taken for a step that happens to lie well.
    may_be: list[tuple[float, Candidate, np.ndarray | None]] = []
    if all(one.window is not None for one in known) and (gain := left.gain_of(order)) is not None:
        may_be.append((gain, Candidate(order, None, 1.0), None))
    windows = left.windows(known) if n - p >= _FEWEST_FOR_STEP - 1 else np.zeros((0, 2), dtype=int)
    if windows.size:
        gains = left.gains(left.psi, windows)
        for ends in (1, 2):
            of = np.flatnonzero((windows[:, 1] < n) == (ends == 2))
            if of.size:
                best = of[gains[of].argmax()]
                window = (int(windows[best, 0]), int(windows[best, 1]))
                may_be.append(
                    (float(gains[best]) - ends * math.log(n), Candidate(_column(window, n), window, 1.0), windows)
                )
    for _, candidate, among in sorted(may_be, key=lambda one: -one[0]):
        trial = refit([*known, candidate])
        t, dof = _t(trial, len(known) + 1, -1)
        chance = _chance_of_t(t, dof) if among is None else left.chance(t, dof, n - p - 1, among, seed)
        chance = min(chance * len({one[1].window is None for one in may_be}), 1.0)
        if chance <= limit:
            moved = left.moved(candidate, trial, known)
            return replace(moved, chance=chance), trial if moved is candidate else refit([*known, moved])
    return None


def needed(fit: RobustFit, terms: Sequence[Candidate], limit: float) -> list[Candidate]:
    """Return those changes of a fit that are still needed beside the others: a drift is not where a step explains it."""
    chances = [_chance_of_t(*_t(fit, len(terms), place - len(terms))) for place in range(len(terms))]
    return [term for term, chance in zip(terms, chances, strict=True) if chance <= limit]


def disentangled(
    terms: Sequence[Candidate], fit: RobustFit, refit: Callable[[Sequence[Candidate]], RobustFit]
) -> tuple[list[Candidate], RobustFit]:
    """Return changes and their fit with windows that overlap told by their parts where that takes no more of them.

    Two that are found one after the other may cancel where they overlap, and neither says then what the runs did.
    """
    n = fit.left.size
    best = _price(fit, terms, fit), list(terms), fit
    for one, other in combinations([term for term in terms if term.window], 2):
        (a, b), (c, d) = one.window or (0, 0), other.window or (0, 0)
        if max(a, c) >= min(b, d):
            continue
        others = [term for term in terms if term is not one and term is not other]
        parts = [pair for pair in combinations(sorted({a, b, c, d}), 2) if pair[1] - pair[0] >= _FEWEST_OF_ONE_LEVEL]
        for instead in (*((part,) for part in parts), *combinations(parts, 2)):
            if len(instead) == 2 and instead[0][1] > instead[1][0]:
                continue
            chosen = [*others, *(Candidate(_column(w, n), w, max(one.chance, other.chance)) for w in instead)]
            trial = refit(chosen)
            if (price := _price(trial, chosen, fit)) < best[0]:
                best = price, chosen, trial
    return best[1], best[2]


def _price(trial: RobustFit, terms: Sequence[Candidate], fit: RobustFit) -> float:
    """Return the misfit of a trial in the deviations of `fit`, each number and each end of a window priced as BIC does."""
    ends = {end for term in terms if term.window for end in term.window}
    misfit = 2 * float(huber(trial.left * trial.sd / fit.sd).sum())
    return misfit + (len(terms) + len(ends)) * math.log(fit.left.size)


def _t(fit: RobustFit, changes: int, place: int) -> tuple[float, float]:
    """Return a coefficient over its standard error, and the degrees of freedom of that."""
    covariance, dof = fit.covariance(1 + changes)
    variance = float(covariance[place, place])
    return (float(fit.beta[place]) / math.sqrt(variance) if variance > 0 else math.inf), dof


def _column(window: tuple[int, int], n: int) -> np.ndarray:
    place = np.arange(n)
    return ((place >= window[0]) & (place < window[1])).astype(float)


@dataclass(frozen=True, eq=False)
class _Left:
    """What a fit leaves over: psi (n,), the weights of the runs, an orthonormal basis of the weighted design (n, p).

    `squares` and `shares` are sums of squared weights and of the weighted basis over the runs before each place, n + 1 rows.
    """

    psi: np.ndarray
    weight: np.ndarray
    Q: np.ndarray
    squares: np.ndarray
    shares: np.ndarray

    @classmethod
    def by(cls, fit: RobustFit) -> _Left:
        weight = 1 / fit.sd
        Q = basis(fit.design * weight[:, None])
        psi = fit.psi - Q @ (Q.T @ fit.psi)
        return cls(psi, weight, Q, _before(weight**2), _before(Q * weight[:, None]))

    def gain_of(self, column: np.ndarray) -> float | None:
        """Return by how much a column lowers the sum of squares; None where it cannot be told from what was fitted."""
        weighted = column * self.weight
        own = self.beside(weighted)
        length = float(own @ own)
        return float(own @ self.psi) ** 2 / length if length > 1e-9 * float(weighted @ weighted) else None

    def beside(self, column: np.ndarray) -> np.ndarray:
        """Return the part of a column that was not fitted."""
        return np.asarray(column - self.Q @ (self.Q.T @ column))

    def windows(self, known: Sequence[Candidate]) -> np.ndarray:
        """Return first run and the one after the last of steps (to the end) and spells that can be told, shape (m, 2)."""
        n = self.psi.size
        steps = np.column_stack([np.arange(n), np.full(n, n)])
        ends = np.unique(np.linspace(0, n, min(_ENDS_OF_SPELLS, n + 1)).round().astype(int))
        first, after = np.triu_indices(ends.size, 1)
        spells = np.column_stack([ends[first], ends[after]])
        return self._usable(np.concatenate([steps, spells[spells[:, 1] < n]]), known)

    def _usable(self, windows: np.ndarray, known: Sequence[Candidate]) -> np.ndarray:
        n, least = self.psi.size, _FEWEST_OF_ONE_LEVEL
        taken = {end for one in known if one.window for end in one.window} | {0, n}
        near = np.zeros(n + 1, dtype=bool)  # too near to the ends of the campaign and to known steps
        for end in taken:
            near[max(end - least + 1, 0) : end + least] = True
        near[n] = False  # the end of a step
        first, after = windows.T
        kept = windows[~near[first] & ~near[after] & (after - first >= least)]
        lengths = self.lengths(kept)
        return np.asarray(kept[lengths > 1e-6 * lengths.max(initial=0.0)])

    def lengths(self, windows: np.ndarray) -> np.ndarray:
        """Return the squared length of the weighted column of each window beside what was fitted, shape (m,)."""
        first, after = windows.T
        within = self.shares[after] - self.shares[first]
        return np.asarray(self.squares[after] - self.squares[first] - (within**2).sum(axis=1))

    def gains(self, psi: np.ndarray, windows: np.ndarray, lengths: np.ndarray | None = None) -> np.ndarray:
        """Return by how much each window lowers the sum of squares of `psi` (..., n), shape (..., m)."""
        sums = _before((psi * self.weight).T).T
        first, after = windows.T
        return np.asarray(
            (sums[..., after] - sums[..., first]) ** 2 / (self.lengths(windows) if lengths is None else lengths)
        )

    def near(self, window: np.ndarray | tuple[int, int], known: Sequence[Candidate]) -> np.ndarray:
        """Return `window` and those whose ends are near its own, shape (m, 2)."""
        n = self.psi.size
        first, after = window
        near = np.arange(-(n // (_ENDS_OF_SPELLS - 1)) - 1, n // (_ENDS_OF_SPELLS - 1) + 2)
        ends = np.array([n]) if after == n else np.clip(after + near, 0, n)
        windows = np.stack(np.meshgrid(np.clip(first + near, 0, n), ends, indexing="ij"), axis=-1).reshape(-1, 2)
        return np.concatenate([np.array([[first, after]]), self._usable(windows, known)])

    def moved(self, found: Candidate, fit: RobustFit, known: Sequence[Candidate]) -> Candidate:
        """Return a change of `fit`, its last, with its ends where its size, rather than a limited part of it, puts them."""
        if found.window is None:
            return found
        size = float(fit.beta[-1]) / fit.sd
        without = fit.left + size * found.column
        better = _before(huber(without) - huber(without - size))
        windows = self.near(found.window, known)
        first, after = windows[int((better[windows[:, 1]] - better[windows[:, 0]]).argmax())]
        window = (int(first), int(after))
        return found if window == found.window else replace(found, column=_column(window, self.psi.size), window=window)

    def chance(self, t: float, dof: float, free: int, windows: np.ndarray, seed: int) -> float:
        """Return how often chance makes any of `windows` as clear as one with this `t`, refitted with `free` runs to spare.

        The clearness, over the number of neighbours that are alike (`free` over `dof`), is held against that of the runs in
        random order; the tail is that of the largest of many (Gumbel).
        """
        place, lengths = np.arange(self.psi.size), self.lengths(windows)
        found = place.size * math.log1p(min(t**2 / dof, 1e12)) * dof / free
        rng = np.random.default_rng(seed)
        largest = np.empty(_PERMUTATIONS)
        at_once = max(_NUMBERS_AT_ONCE // (place.size + lengths.size), 1)
        for start in range(0, _PERMUTATIONS, at_once):
            count = min(at_once, _PERMUTATIONS - start)
            mixed = self.beside(rng.permuted(np.broadcast_to(self.psi, (count, place.size)), axis=1).T).T
            largest[start : start + count] = self._clearness(mixed, windows, lengths)
        width = max(float(largest.std(ddof=1)) * math.sqrt(6) / math.pi, 1e-12)
        mode = float(largest.mean()) - 0.5772156649 * width
        return float(-math.expm1(-math.exp(min(-(found - mode) / width, 50.0))))

    def _clearness(self, psi: np.ndarray, windows: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Return twice the gain in log-likelihood of the best window, the scatter being fitted with and without it."""
        gain, whole = self.gains(psi, windows, lengths).max(axis=-1), (psi**2).sum(axis=-1)
        return np.asarray(psi.shape[-1] * np.log(whole / np.maximum(whole - gain, 1e-12 * whole)))


def _before(rows: np.ndarray) -> np.ndarray:
    """Return the sums over the rows before each place, one more than rows."""
    return np.concatenate([np.zeros((1, *rows.shape[1:])), np.cumsum(rows, axis=0)])


def _chance_of_t(t: float, dof: float) -> float:
    from scipy.special import stdtr

    return float(2 * stdtr(max(dof, 1.0), -abs(t)))
