"""Flex sensor against film by the heights of both alone: for a drive without a bench.

The film grows with the speed of rotation, the flex sensor does not, and how much is not known without a bench: the drive's
own changes of speed tell it.
"""

from __future__ import annotations

import numpy as np

# Revolutions between which speed and ratio are compared, passes of the least absolute deviation.
_APART, _PASSES = 8, 30
# Relative changes of speed below this are none.
_LEAST_CHANGE = 0.03
# The film's height goes with the speed to the power of 0 (fast) to 1 (slow); lags make that a little more.
_STEEPEST = 1.3
LEAST_STEP = 0.15
"""A step below this may be the load: the two sensors do not answer to it in the same way."""


def height_ratio(flex: np.ndarray, film: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the height of the flex sensor's peak over that of the film, less what goes with the rotation, shape (m,).

    Changes over eight revolutions tell the power law: a sensor that comes off is in few of them, a change of speed in
    many.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logs, u = np.log(flex / film), np.log(rotation)
    known = np.isfinite(logs) & np.isfinite(u)
    ratio = np.full(logs.size, np.nan)
    if not known.any():
        return ratio
    y, x = logs[known], u[known] - np.median(u[known])
    ratio[known] = np.exp(y - _of_rotation(x, y))
    return ratio


def _of_rotation(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return what of y goes with x, shape (m,): a parabola whose slope is held within what film and flex sensor can do."""
    dx, dy = x[_APART:] - x[:-_APART], y[_APART:] - y[:-_APART]
    if x.size <= _APART or np.abs(dx).max() < _LEAST_CHANGE:
        return np.zeros(x.size)
    square = x[_APART:] ** 2 - x[:-_APART] ** 2
    A = np.column_stack([dx, square])
    weight = np.ones(dx.size)
    slope = np.zeros(2)
    for _ in range(_PASSES):
        slope, *_ = np.linalg.lstsq(A * weight[:, None], dy * weight, rcond=1e-6)
        weight = 1.0 / np.sqrt(np.maximum(np.abs(dy - A @ slope), 1e-4))
    at = np.linspace(x.min(), x.max(), 200)
    power = np.clip(slope[0] + 2.0 * slope[1] * at, -_STEEPEST, 0.0)
    risen = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(at))])
    return np.asarray(np.interp(x, at, risen - np.interp(0.0, at, risen)))
