"""What the short coverage tests share: errors of simulated campaigns in units of what their intervals claim."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from scipy.stats import binom

from benchmarks.coverage.study import Row

CHANCE = 1e-3


def scores(rows: Iterable[Row], counts: Callable[[str], bool] = lambda _label: True) -> np.ndarray:
    """Return error over the interval's half width on that side, times 1.96: within +-1.96 it holds the truth. Shape (n,)."""
    found = []
    for row in rows:
        if row.value is None or row.ci95 is None or row.truth is None or not counts(row.label):
            continue
        half = row.value - row.ci95[0] if row.truth < row.value else row.ci95[1] - row.value
        found.append(1.96 * (row.value - row.truth) / half)
    return np.array(found)


def share_is_likely(z: np.ndarray, too_small_by: float = 1.0, chance: float = CHANCE) -> bool:
    """Tell whether so few of n independent intervals, narrower by a factor, may miss the truth by chance if they are of 95 %."""
    held = int(np.sum(np.abs(z) * too_small_by <= 1.96))
    return bool(binom.cdf(held, z.size, 0.95) > chance)
