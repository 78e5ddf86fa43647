"""Equivalence of group means: two one-sided tests with a variance pooled over all groups (rap.md, 3.12; Schuirmann 1987).

Plain statistics of cells (a group at a time): nothing here knows of logs or of what was counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.estimation.uncertainty import t_quantile

# Each one-sided test is made at this level; the interval that goes with it holds 1 - 2 ALPHA.
ALPHA = 0.05
Verdict = Literal["equivalence", "inconclusive", "different"]


@dataclass(frozen=True)
class Cell:
    """Cultures of one group at one time: their number, mean, and sum of squares about it with its degrees of freedom."""

    n: int
    mean: float
    squares: float
    dof: int

    @staticmethod
    def of(values: Sequence[float] | np.ndarray) -> Cell:
        """Return the cell of single cultures, shape (n,)."""
        x = np.asarray(values, float)
        return Cell(x.size, float(x.mean()), float(np.sum((x - x.mean()) ** 2)), x.size - 1)

    def joined(self, other: Cell) -> Cell:
        """Return both as one cell whose scatter is that within each."""
        n = self.n + other.n
        return Cell(
            n, (self.n * self.mean + other.n * other.mean) / n, self.squares + other.squares, self.dof + other.dof
        )


@dataclass(frozen=True, eq=False)
class Differences:
    """Treated less control at k times, shape (k,) each.

    `low90`, `high90` are the limits of the two one-sided tests at 5 %, `low95`, `high95` those of the usual interval;
    `p` is the larger p value of the two tests. `deviation` is the pooled standard deviation with `dof` degrees of freedom.
    """

    value: np.ndarray
    std_error: np.ndarray
    low90: np.ndarray
    high90: np.ndarray
    low95: np.ndarray
    high95: np.ndarray
    p: np.ndarray
    deviation: float
    dof: int


def pooled(cells: Sequence[Cell]) -> tuple[float, int]:
    """Return the pooled standard deviation within cells (ANOVA) and its degrees of freedom; NaN where none are left."""
    dof = sum(cell.dof for cell in cells)
    return (float(np.sqrt(sum(cell.squares for cell in cells) / dof)), dof) if dof else (float("nan"), 0)


def differences(treated: Sequence[Cell], controls: Sequence[Cell], margin: float) -> Differences:
    """Return the differences of k cells to the control of each (the same object where there is one for all).

    The variance is pooled over all cells, each counted once. Without degrees of freedom there is no interval.
    """
    from scipy.special import stdtr

    each = list(treated) + [cell for i, cell in enumerate(controls) if not any(cell is c for c in controls[:i])]
    deviation, dof = pooled(each)
    value = np.array([t.mean - c.mean for t, c in zip(treated, controls, strict=True)])
    error = deviation * np.array([np.sqrt(1.0 / t.n + 1.0 / c.n) for t, c in zip(treated, controls, strict=True)])
    if not dof:
        blank = np.full(value.shape, np.nan)
        return Differences(value, blank, blank, blank, blank, blank, blank, deviation, 0)
    narrow, wide = (t_quantile(dof, level) * error for level in (1.0 - 2.0 * ALPHA, 0.95))
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(error > 0.0, (margin - np.abs(value)) / error, np.inf * np.sign(margin - np.abs(value)))
    p = np.asarray(stdtr(dof, -t))
    return Differences(value, error, value - narrow, value + narrow, value - wide, value + wide, p, deviation, dof)


def verdict_of(found: Differences, margin: float) -> Verdict:
    """Return what the k differences say together.

    Equivalence where every 90 % interval lies within +-margin (intersection-union: no correction for several times).
    Different where one of them lies beyond the margin as a whole, at 5 % for all k together (Bonferroni). Else inconclusive.
    """
    if not found.dof or not np.isfinite(found.std_error).all():
        return "inconclusive"
    if bool(np.all((found.low90 > -margin) & (found.high90 < margin))):
        return "equivalence"
    half = t_quantile(found.dof, 1.0 - 2.0 * ALPHA / found.value.size) * found.std_error
    return "different" if bool(np.any(np.abs(found.value) - half > margin)) else "inconclusive"


@dataclass(frozen=True)
class Slope:
    """Change of the difference with time (1/s), its standard error, 95 % interval and p value of no change."""

    value: float
    std_error: float
    ci95: tuple[float, float]
    p: float


def slope_of(times: np.ndarray, treated: Sequence[Cell], controls: Sequence[Cell], found: Differences) -> Slope | None:
    """Return the weighted line through the differences over `times` (k,), s; None for fewer than three times.

    A control that all times share moves them together and not the slope.
    """
    from scipy.special import stdtr

    if len(times) < 3 or not found.dof or not found.deviation > 0.0:
        return None
    shared = all(cell is controls[0] for cell in controls)
    weight = np.array(
        [1.0 / (1.0 / t.n + (0.0 if shared else 1.0 / c.n)) for t, c in zip(treated, controls, strict=True)]
    )
    centred = times - np.sum(weight * times) / np.sum(weight)
    spread = float(np.sum(weight * centred**2))
    value = float(np.sum(weight * centred * found.value)) / spread
    error = found.deviation / float(np.sqrt(spread))
    half = t_quantile(found.dof) * error
    return Slope(value, error, (value - half, value + half), float(2.0 * stdtr(found.dof, -abs(value) / error)))
