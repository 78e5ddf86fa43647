"""The shift in time at which one board's motion explains another board's signal best, with its error.

Arrays only; which part of a run tells which clock is in `clock_shifts` and `vibration_shifts`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import effective_size

FAR = 1.5
"""Shifts are looked for this far, s, first in coarse and then in fine steps."""

_COARSE, _FINE = 0.03, 0.001
# A part of the run has a shift of its own if it explains so much of the torque's variance.
_EXPLAINED = 0.5


@dataclass(frozen=True)
class Part:
    """The shift of one part of a run: when (s of the board), how much and with what error (s); what it leaves unexplained."""

    time: float
    shift: float
    sd: float
    misfit: float = 0.0


def best_shift(
    grid: np.ndarray, columns: np.ndarray, signal: Callable[[np.ndarray], np.ndarray], within: tuple[float, float]
) -> Part | None:
    """Return the shift at which the columns explain ``signal(grid + shift)`` best; None where they hardly do."""
    base, upper = np.linalg.qr(columns)

    def unexplained(shift: float) -> float:
        y = signal(grid + shift)
        y = y - y.mean()
        total = float(y @ y)
        # The last column (acceleration, slip) drives the signal, it never works against it.
        along = base.T @ y
        if total <= 0 or along[-1] * upper[-1, -1] <= 0:
            return 1.0
        return (total - float(along @ along)) / total

    low, high = within
    for pace in (_COARSE, _FINE):
        shifts = np.arange(low, high + pace, pace)
        shares = np.array([unexplained(float(shift)) for shift in shifts])
        best = int(np.argmin(shares))
        low, high = float(shifts[max(best - 1, 0)]), float(shifts[min(best + 1, shifts.size - 1)])
    shift = float(shifts[best])
    if shares[best] > 1.0 - _EXPLAINED or not within[0] + _FINE < shift < within[1] - _FINE:
        return None
    y = signal(grid + shift)
    residual = y - base @ (base.T @ y)
    slope = (signal(grid + shift + 0.01) - signal(grid + shift - 0.01)) / 0.02
    slope = slope - base @ (base.T @ slope)
    independent = effective_size(residual, columns.shape[1])
    variance = float(residual @ residual) / max(independent - columns.shape[1] - 1, 1.0)
    information = float(slope @ slope) * independent / grid.size
    sd = math.sqrt(variance * independent / grid.size / max(information, 1e-30))
    return Part(float(grid.mean()), shift, sd, float(shares[best]))
