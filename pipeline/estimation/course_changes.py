"""Which change of runs in their order is the clearest, and how probable one like it is by chance: a drift, a step, a spell.

One is looked for at a time, beside those that are known; `course` adds them up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.robust_fit import RobustFit, basis, memory

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


def clearest(fit: RobustFit, order: np.ndarray, known: Sequence[Candidate], seed: int) -> Candidate | None:
    """Return the change that explains most of what the fit leaves; None where runs are too few to tell.

    `order` is the column of a drift, -1/2 to 1/2; `known` are changes that the fit holds already.
    """
    n, p = fit.design.shape
    if n - p < _FEWEST_FOR_DRIFT - 1:
        return None
    left = _Left.by(fit)
    if not left.psi @ left.psi > 0:
        return None
    slow = 2 + len(known)
    drift = None if any(one.window is None for one in known) else left.drift(order, n - p - 1, slow)
    windows = left.windows(known) if n - p >= _FEWEST_FOR_STEP - 1 else np.zeros((0, 2), dtype=int)
    if not windows.size:
        return None if drift is None else Candidate(order, None, drift[1])
    gains = left.gains(left.psi, windows)
    if drift is not None and drift[0] > gains.max():
        return Candidate(order, None, drift[1])
    chance = left.chance(windows, int(gains.argmax()), slow, seed)
    first, after = left.to_the_run(windows[gains.argmax()], known)
    place = np.arange(n)
    return Candidate(((place >= first) & (place < after)).astype(float), (first, after), chance)


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

    def drift(self, order: np.ndarray, dof: float, slow: int) -> tuple[float, float] | None:
        """Return the gain of a drift and its chance; None where it cannot be told from what was fitted."""
        column = self.beside(order * self.weight)
        length, whole = float(column @ column), float(order * self.weight @ (order * self.weight))
        if length <= 1e-9 * whole:
            return None
        along = float(column @ self.psi)
        gain, rest = along**2 / length, self.psi - column * along / length
        dof = dof / memory(rest, slow)
        t = math.sqrt(gain * dof / max(float(rest @ rest), 1e-12 * gain))
        return gain, _chance_of_t(t, dof)

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

    def to_the_run(self, window: np.ndarray, known: Sequence[Candidate]) -> tuple[int, int]:
        """Return the best window whose ends are near those of `window`."""
        n = self.psi.size
        reach = 0 if window[1] == n else n // (_ENDS_OF_SPELLS - 1) + 1
        near = np.arange(-reach, reach + 1)
        first, after = (np.clip(end + near, 0, n) for end in window)
        windows = np.stack(np.meshgrid(first, after, indexing="ij"), axis=-1).reshape(-1, 2)
        windows = np.concatenate([window[None], self._usable(windows, known)])
        best = windows[int(self.gains(self.psi, windows).argmax())]
        return int(best[0]), int(best[1])

    def chance(self, windows: np.ndarray, best: int, slow: int, seed: int) -> float:
        """Return how often chance makes any of `windows` as clear as the `best`.

        The clearness, over the number of neighbours that are alike beside that change, is held against that of the runs in
        random order; the tail is that of the largest of many (Gumbel).
        """
        place = np.arange(self.psi.size)
        first, after = windows[best]
        column = self.beside(((place >= first) & (place < after)) * self.weight)
        rest = self.psi - column * float(column @ self.psi) / float(column @ column)
        lengths = self.lengths(windows)
        found = float(self._clearness(self.psi, windows, lengths)) / memory(rest, slow)
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
