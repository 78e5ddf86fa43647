"""The samples that the checks of one channel look at: a new block with what came just before it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

# Samples of the block before that stay in sight: what leads into an event at the start of a block.
CONTEXT = 512


@dataclass(frozen=True)
class Window:
    """Finite samples in order, the first `old` of them seen before.

    `times` are the times (s) of the old samples and of the new ones.
    """

    values: np.ndarray
    times: tuple[np.ndarray, np.ndarray]

    @property
    def old(self) -> int:
        """How many samples were seen before."""
        return self.times[0].size

    def moment(self, at: int) -> float:
        """Return the time of row `at`, s."""
        return float(self.times[0][at] if at < self.old else self.times[1][at - self.old])

    @cached_property
    def steps(self) -> np.ndarray:
        """From each sample to the next, shape (n - 1,)."""
        return np.diff(self.values)

    @cached_property
    def sizes(self) -> np.ndarray:
        """Magnitude of the steps."""
        sizes: np.ndarray = np.abs(self.steps)
        return sizes

    def before(self, at: int, length: int) -> np.ndarray:
        """Return up to `length` samples before row `at`."""
        return self.values[max(at - length, 0) : at]


def cut_off(before: np.ndarray, level: float) -> bool:
    """Tell whether a signal that leads to a constant `level` was cut off there, or came to rest by itself.

    Parameters
    ----------
    before
        The samples before the constant ones, oldest first.

    Notes
    -----
    Cut off is what is rough, or what arrives on a bent course at speed: a clipped sine, a frozen
    sensor. What slows down (a step response, the top of a slow wave), arrives on a straight line (a
    commanded ramp and hold) or by a jump between constants (a set value) came to rest by itself.
    """
    course = np.append(before, level)
    steps = np.diff(course)
    at = np.flatnonzero(steps)
    if at.size < 4:
        return False
    recent = steps[at[-32:]]
    between_turns = np.diff(np.flatnonzero(recent[1:] * recent[:-1] < 0))
    # No wave turns twice within two samples. Steps of one size only are the last bit's, not noise.
    is_noise = np.count_nonzero(between_turns <= 2) >= 2
    if is_noise and np.abs(recent).max() > 1.5 * np.abs(recent).min():
        return True
    turns = np.flatnonzero(steps * steps[at[-1]] < 0)
    at = at[at > turns[-1]] if turns.size else at
    if at.size < 4:  # it has just turned: a wave in motion does not stop there, a ramp after a plateau may
        return bool(steps.size >= 12 and steps[-24:].all())
    # The first and the last step may be parts of one: where a plateau ended and where this one begins.
    course, smallest = course[at[0] + 1 : -1], float(np.abs(steps[at[1:-1]]).min())
    straight = np.linspace(course[0], course[-1], course.size)
    if np.abs(course - straight).max() <= 1.05 * _resolution(before):
        return False
    sizes = np.abs(steps[at[0] :])
    return bool(sizes[-2:].sum() >= 0.3 * sizes.mean()) and _way_left(at, np.abs(steps[at])) > 2.0 * smallest


def _resolution(values: np.ndarray) -> float:
    """Return the smallest distance between different values, rounding of floating-point numbers aside."""
    levels = np.sort(values)
    distances = np.diff(levels)
    rounding = 1e-9 * float(levels[-1] - levels[0])
    return float(distances[distances > rounding].min(initial=levels[-1] - levels[0]))


def _way_left(at: np.ndarray, sizes: np.ndarray) -> float:
    """Return how much further a signal would have gone that slows down as evenly as in its last eight moves.

    Parameters
    ----------
    at, sizes
        Rows and sizes of the moves, each of shape (m,); the last one leads to where the signal stays.
    """
    if at.size < 9:
        return float("inf")
    last, previous = sizes[-4:].sum(), sizes[-8:-4].sum()
    time, time_before = float(at[-1] - at[-5]), float(at[-5] - at[-9])
    slowing = (previous / time_before - last / time) / (0.5 * (time + time_before))
    speed = last / time - 0.5 * slowing * time
    if slowing <= 0:
        return float("inf")
    return float(speed**2 / (2 * slowing)) if speed > 0 else 0.0
