"""How far peaks lie off the calibration: what runs scatter by, and whether the curve misses more than that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_SIGNIFICANT = 0.01
# The curve misses more than runs differ; d ln(peak)/d ln(pressure) (tire.md, 3.5).
_MISSES, _BY_PRESSURE = 0.05, -0.59


@dataclass(frozen=True)
class Repeat:
    """How well runs repeat, told by all of their waveforms (relative standard deviations), and degrees of freedom of that."""

    load: float
    gain: float
    pressure: float
    dof: int


@dataclass(frozen=True)
class LackOfFit:
    """F-test of the curve against repeats (or, without them, the averages' own errors), and its size as a load (rms, N)."""

    F: float
    p_value: float
    size: float
    against: str

    @property
    def found(self) -> bool:
        """Tell whether the curve misses more than scatter."""
        return self.p_value < _SIGNIFICANT


def pooled(
    left: float, dof: int, own: float, F: np.ndarray, y: np.ndarray, slopes: np.ndarray, repeat: Repeat | None
) -> tuple[float, int]:
    """Return the variance of a run's peak about the curve, ohm^2, and its degrees of freedom."""
    from scipy.special import fdtrc

    if repeat is None or repeat.dof <= 2:
        return left, dof
    # `run_scatter` tells the mean of the square over all that is likely, nu/(nu - 2) of what nu degrees of freedom estimate:
    # it holds the doubt that Student's t holds as well.
    told = own + (repeat.dof - 2) / repeat.dof * float(
        np.mean((repeat.load * slopes * F) ** 2 + (repeat.gain**2 + (_BY_PRESSURE * repeat.pressure) ** 2) * y**2)
    )
    if told <= 0.0 or fdtrc(dof, repeat.dof, left / told) < _MISSES:
        return left, dof
    return (dof * left + repeat.dof * told) / (dof + repeat.dof), dof + repeat.dof


def lack_of_fit(residual: np.ndarray, groups: Sequence[int], degree: int, own: float, slope: float) -> LackOfFit | None:
    """Return the test of the curve against repeats; None where neither loads nor repeats are left over for it."""
    from scipy.special import fdtrc

    labels = np.array(groups)
    means = np.array([residual[labels == g].mean() for g in sorted(set(groups))])
    counts = np.array([np.count_nonzero(labels == g) for g in sorted(set(groups))])
    dof = means.size - degree - 1
    repeats = residual.size - means.size
    if dof < 1:
        return None
    missed = float((counts * means**2).sum()) / dof
    size = math.sqrt(float(np.mean(residual**2))) / slope
    if repeats >= 2:
        pure = max(
            float(sum(((residual[labels == g] - means[i]) ** 2).sum() for i, g in enumerate(sorted(set(groups)))))
            / repeats,
            own,
        )
        F = missed / pure
        return LackOfFit(F, float(fdtrc(dof, repeats, F)), size, f"{repeats} repeats")
    if own <= 0.0:
        return None
    F = missed / own
    return LackOfFit(F, float(fdtrc(dof, 1e6, F)), size, "the averages' own standard errors")
