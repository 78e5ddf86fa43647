"""The longitudinal force that steady rolling takes, by speed: wind and rolling resistance are no event."""

from __future__ import annotations

import math

import numpy as np

# Steady: rad/s^2 (0.3 m/s^2) over so many revolutions on either side; how many tell a force, over what range of speed squared.
_STEADY, _AROUND = 1.0, 4
_FEWEST_STEADY, _STEADY_SHARE, _RANGE = 20, 0.1, 0.3
# Among revolutions that take so many times longer than they should, some are lost: the wheel may have stood.
_GAP = 2.5


def rolling_force(time: np.ndarray, rotation: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the force that steady rolling takes at each revolution, N, and where the rotation is steady, shape (m,) each.

    b0 + b2 Omega^2 by least absolute deviations over the revolutions without acceleration; 0 where these are too few.
    """
    change = np.full(time.size, math.inf)
    if time.size > 2 * _AROUND:
        rate = np.abs(rotation[_AROUND:] - rotation[:-_AROUND]) / (time[_AROUND:] - time[:-_AROUND])
        turns = (time[_AROUND:] - time[:-_AROUND]) * rotation[_AROUND:] / (2.0 * math.pi)
        rate[turns > _GAP * _AROUND] = math.inf
        change[_AROUND:-_AROUND] = np.maximum(rate[:-_AROUND], rate[_AROUND:])
    steady = change < _STEADY
    if np.count_nonzero(steady) < max(_FEWEST_STEADY, _STEADY_SHARE * time.size):
        return np.zeros(time.size), np.ones(time.size, dtype=bool)
    x, y = rotation[steady] ** 2, force[steady]
    square = x.max() or 1.0
    A = np.column_stack([x / square, np.ones(x.size)])
    if np.ptp(x) < _RANGE * square:
        # One speed does not tell wind from rolling resistance: at a standstill neither is left of a force that drives.
        A = A[:, :1]
    found = _least_deviations(A, y)
    if found.size > 1 and found[0] < 0.0:  # wind does not push
        found = np.array([0.0, *_least_deviations(A[:, 1:], y)])
    return sum(found[1:]) + found[0] * np.minimum(rotation**2 / square, 1.0), steady


def _least_deviations(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    found: np.ndarray = np.zeros(A.shape[1])
    weight = np.ones(y.size)
    for _ in range(20):
        found, *_ = np.linalg.lstsq(A * weight[:, None], y * weight, rcond=None)
        weight = 1.0 / np.sqrt(np.maximum(np.abs(y - A @ found), 1.0))
    return np.asarray(found)
