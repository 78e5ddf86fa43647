"""Which stroke is which: delays known only up to whole strokes are followed from window to window (rap.md, 5.1 c)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# What is known of a clock's rate before, relative; what it wanders, per root second; the delay after a gap follows from both.
_RATE, _WANDER = 100e-6, 2e-7
# A step to the next window is sure where its standard deviation is below that share of a stroke.
_SURE = 0.15


# Delay (s) and rate, shape (2,), and their covariance.
State = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """Delay of each window (s, shape (w,), NaN where there was none) and whether every step was sure."""

    delay: np.ndarray
    sure: bool


def unwrapped(
    time: np.ndarray,
    delay: np.ndarray,
    sd: np.ndarray,
    stroke: np.ndarray,
    at: float,
    start: float,
    start_sd: float,
) -> Unwrapped:
    """Add whole strokes to delays so that they follow one line from `start` at time `at` (s) on.

    Parameters
    ----------
    time, delay, sd, stroke
        Of each window, s, shape (w,); `delay` modulo `stroke`, NaN where unknown.
    at, start, start_sd
        Where the delay is known without ambiguity, its value and standard deviation, s.
    """
    out = np.full(delay.shape, np.nan)
    known = np.flatnonzero(np.isfinite(delay))
    if not known.size:
        return Unwrapped(out, False)
    first = known[np.argmin(np.abs(time[known] - at))]
    state = (np.array([start, 0.0]), np.diag([start_sd**2, _RATE**2]))
    windows = (time, delay, sd, stroke)
    there, sure = _along(known[known >= first], windows, at, state, out)
    _, back = _along(known[known < first][::-1], windows, float(time[first]), there, out)
    return Unwrapped(out, sure and back)


def _along(
    rows: np.ndarray, windows: tuple[np.ndarray, ...], at: float, state: State, out: np.ndarray
) -> tuple[State, bool]:
    """Follow the windows in `rows` from the state at time `at`; return the state at the first of them and whether all was sure.

    A Kalman filter of delay and rate; the whole strokes nearest to its prediction are added.
    """
    time, delay, sd, stroke = windows
    (value, spread), sure, first = state, True, state
    for k, row in enumerate(rows):
        ahead = float(time[row]) - at
        move = np.array([[1.0, ahead], [0.0, 1.0]])
        value, spread = move @ value, move @ spread @ move.T + np.diag([0.0, _WANDER**2 * abs(ahead)])
        at = float(time[row])
        sure = sure and bool(np.sqrt(spread[0, 0]) < _SURE * stroke[row])
        out[row] = delay[row] + stroke[row] * np.round((value[0] - delay[row]) / stroke[row])
        gain = spread[:, 0] / (spread[0, 0] + sd[row] ** 2)
        value = value + gain * (out[row] - value[0])
        spread = spread - np.outer(gain, spread[0])
        if k == 0:
            first = (value, spread)
    return first, sure
