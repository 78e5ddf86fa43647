"""What a displacement that comes in steps tells: the moments at which it passes from one step to the next.

A dial gauge of 0.01 mm says little within a step but much at its edges. Works on any sensor: where readings are
finer than the motion between two samples, every sample is told instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# A reading is coarse if at least this share of neighbours is equal, and the steps are alike to this.
_EQUAL_SHARE, _ALIKE = 0.4, 0.05
_FINEST = 1e-10  # m
# Of a fine gauge, this share of a stroke at its ends.
_END_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Marks:
    """Points of a stroke that are known: time (s), displacement (m), each to `spread` (m), shape (n,).

    `regular` is False where the readings of a stroke go to and fro by more than a step.
    """

    time: np.ndarray
    d: np.ndarray
    spread: float
    regular: bool = True


def step_of(x: np.ndarray) -> float:
    """Return the step (m) in which a gauge's readings come; 0 where they are fine beside its motion.

    `x` has shape (n,), finite.
    """
    if x.size < 3:
        return 0.0
    levels = np.unique(np.round(x / _FINEST)) * _FINEST
    if levels.size < 3:
        return float(levels[-1] - levels[0]) if levels.size == 2 else 0.0
    steps = np.diff(levels)
    step = float(steps.min())
    off = np.abs(steps / step - np.round(steps / step))
    if step <= _FINEST or np.mean(off > _ALIKE) > 0.02 or np.mean(np.diff(x) == 0) < _EQUAL_SHARE:
        return 0.0
    return float(np.median(steps[np.round(steps / step) == 1]))


def finest(x: np.ndarray) -> float:
    """Return the smallest difference between two readings, m."""
    steps = np.diff(np.unique(np.round(x / _FINEST)))
    return float(steps.min()) * _FINEST if steps.size else 0.0


def marks_of(time: np.ndarray, x: np.ndarray, step: float, direction: float) -> Marks:
    """Return what is known of one stroke from its samples, in the order of time, shape (n,).

    With `step` 0 every sample but those near the ends, where the press may stand; else the passages between neighbouring steps, half a step beyond the reading,
    at the middle of the two samples between which they fall.
    """
    if step <= 0:
        spread = max(_scatter(x), finest(x) / math.sqrt(12))
        margin = max(_END_SHARE * float(np.ptp(x)), 4 * spread)
        inside = (x > x.min() + margin) & (x < x.max() - margin)
        return Marks(time[inside], x[inside], spread)
    level = direction * np.round(x / step)
    ordered = np.sort(level)
    regular = bool(np.mean(np.abs(ordered - level) > 1) < 0.02)
    jump = np.diff(ordered)
    interval = np.diff(time)
    usual = float(np.median(interval)) if interval.size else 0.0
    at = np.flatnonzero((jump > 0) & (interval < 3 * usual))
    middle = 0.5 * (ordered[at] + ordered[at + 1])
    d = direction * step * middle
    moved = abs(float(d[-1] - d[0])) / max(float(time[at[-1]] - time[at[0]]), usual) if at.size > 1 else 0.0
    return Marks(0.5 * (time[at] + time[at + 1]), d, max(moved * usual / math.sqrt(12), 1e-12), regular)


def _scatter(x: np.ndarray) -> float:
    """Return the noise of samples on a smooth motion, from second differences."""
    if x.size < 5:
        return 1e-12
    return max(float(np.median(np.abs(np.diff(x, 2)))) / 0.6745 / math.sqrt(6), 1e-12)
