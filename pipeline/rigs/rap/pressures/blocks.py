"""Blocks of 20 s within the levels of a run: what repeats when the run is repeated (rap.md, 5.2).

The protocol of a run is fixed: each level keeps its share, only what scatters within it is drawn anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.rap.pressures.levels import Level

BLOCK = 20.0
"""Length of a block, s: longer than what the pump's speed remembers (5 s)."""
_SHORTEST = 8.0
"""A level that long is at least two blocks, s."""
_DRAWS = 2000
# Parts of a block that tell how long noise lasts.
_PIECES = 4


@dataclass(frozen=True, eq=False)
class Blocks:
    """Block number of each sample, shape (n,), -1 for none, and the level that each of the b blocks belongs to, shape (b,)."""

    of: np.ndarray
    level: np.ndarray

    @property
    def count(self) -> int:
        """Number of blocks."""
        return int(self.level.size)

    @property
    def dof(self) -> float:
        """Degrees of freedom of the scatter within levels."""
        return float(max(self.count - np.unique(self.level).size, 1))

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return the sum of `values` (n,) or (n, k) over each block, shape (b,) or (b, k)."""
        inside = self.of >= 0
        if values.ndim == 1:
            return np.bincount(self.of[inside], values[inside], self.count)
        return np.stack([self.sums(column) for column in values.T], axis=-1)

    def hidden(self, time: np.ndarray, values: np.ndarray) -> float:
        """Return by how much too small errors from these blocks are because noise outlasts samples, 1 or more; (n,) each.

        A block of length L shows the share 1 - tau/L of the variance of a mean over noise of memory tau. How much quarters of
        blocks hang together tells tau.
        """
        inside = self.of >= 0
        block, at = self.of[inside], time[inside]
        first = np.searchsorted(block, np.arange(self.count))
        last = np.searchsorted(block, np.arange(self.count), side="right") - 1
        share = (at - at[first][block]) / np.maximum(at[last] - at[first], 1e-9)[block]
        piece, member = np.unique(
            _PIECES * block + np.minimum(_PIECES * share, _PIECES - 1).astype(int), return_inverse=True
        )
        mean = np.bincount(member, values[inside]) / np.bincount(member)
        level = np.unique(self.level[piece // _PIECES], return_inverse=True)[1]
        mean -= (np.bincount(level, mean) / np.bincount(level))[level]
        together = mean.size / effective_size(mean, int(level.max()) + 1)
        return float(1.0 / np.sqrt(1.0 - (1.0 - 1.0 / max(together, 1.0)) / _PIECES))

    def draws(self, seed: int = 0) -> np.ndarray:
        """Return how often each block counts in each resampled run, shape (draws, b).

        In a level of m blocks m - 1 are drawn and count m/(m - 1) times (Rao and Wu, J. Am. Stat. Assoc. 83, 1988, 231):
        so few blocks do not look too certain. A level of one block tells no scatter and stays as it is.
        """
        rng = np.random.default_rng(seed)
        out = np.ones((_DRAWS, self.count))
        for level in np.unique(self.level):
            members = np.flatnonzero(self.level == level)
            m = members.size
            if m > 1:
                out[:, members] = rng.multinomial(m - 1, np.full(m, 1.0 / m), _DRAWS) * (m / (m - 1.0))
        return out


def blocks_of(time: np.ndarray, good: np.ndarray, levels: Sequence[Level]) -> Blocks:
    """Cut the good samples (mask, shape (n,)) at `time` (s) into blocks that do not cross the beginning of a level."""
    if time.size < 2:
        return Blocks(np.full(time.size, -1), np.zeros(0, dtype=int))
    edges = np.array([level.begin for level in levels if time[0] < level.begin < time[-1]])
    of = np.full(time.size, -1)
    owner: list[int] = []
    bounds = [time[0], *edges.tolist(), time[-1]]
    for number, (begin, end) in enumerate(pairwise(bounds)):
        inside = np.flatnonzero(good & (time >= begin) & ((time < end) | (end == time[-1])))
        # One block alone would tell no scatter.
        count = max(round((end - begin) / BLOCK), 2 if end - begin > _SHORTEST else 1)
        block = np.minimum(((time[inside] - begin) / (end - begin) * count).astype(int), count - 1)
        used, block = np.unique(block, return_inverse=True)
        of[inside] = len(owner) + block
        owner += [number] * used.size
    return Blocks(of, np.array(owner, dtype=int))
