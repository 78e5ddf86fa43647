"""A steady run cycle by cycle, against its fitted loop: does the mean force wander, does the stiffness change?

The fit of a loop averages over its cycles; what changes from cycle to cycle is seen only here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.mre.model.loop import Loop, drift_degree
from pipeline.rigs.mre.shear.samples import Series

_FEWEST = 4  # cycles
# Cycles with less than this share of the usual number of samples are not judged.
_FULL = 0.5


@dataclass(frozen=True)
class Wander:
    """What changes in the course of a run.

    Attributes
    ----------
    drift
        By how much the mean force drifts slowly (as the fit takes out), N.
    rest, rest_noise, jump_at
        What of the mean force's course is no slow drift, N; how much of it comes and goes from one cycle to the next,
        1 sigma, N; when it changes most, s.
    force_change, motion_change, change_sd, change_dof
        Relative change of the force's and of the displacement's amplitude from the first to the last
        cycle, by a straight line; the standard error of their difference, and its degrees of freedom.
    duration
        Of the run, s.
    """

    drift: float
    rest: float
    rest_noise: float
    jump_at: float
    force_change: float
    motion_change: float
    change_sd: float
    change_dof: int
    duration: float

    @property
    def softening(self) -> float:
        """Relative change of the force that the change of amplitude does not explain.

        A softening loop's force changes by six tenths to all of the change of its amplitude.
        """
        least, most = sorted((0.6 * self.motion_change, self.motion_change))
        return self.force_change - min(max(self.force_change, least), most)


def wander_of(series: Series, loop: Loop) -> Wander | None:
    """Return how a run of `series` wanders about its `loop`; None for fewer than four cycles to judge."""
    cycle = np.floor((series.time - series.time[0]) * loop.frequency + 1e-9).astype(int)
    whole = int((series.time[-1] - series.time[0]) * loop.frequency + 0.02)
    inside = cycle < whole
    number = np.bincount(cycle[inside], minlength=max(whole, 1))
    full = number > _FULL * np.median(number)
    if full.sum() < _FEWEST:
        return None
    cycle, time = cycle[inside], series.time[inside]

    def per_cycle(values: np.ndarray, coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and gain of each full cycle about the fitted curve."""
        turn = np.exp(2j * np.pi * loop.frequency * time)
        curve, power = np.zeros(time.size), np.ones(time.size, dtype=complex)
        for coefficient in coefficients:
            power *= turn
            if coefficient != 0:
                curve += (coefficient * power).real
        rest = values[inside] - curve
        sums = [np.bincount(cycle, weights, whole) for weights in (rest, curve, rest * curve, curve**2)]
        n = np.maximum(number, 1)
        mean = sums[0] / n
        gain = (sums[2] - mean * sums[1]) / (sums[3] - sums[1] ** 2 / n + 1e-300)
        return mean[full], gain[full]

    at = (np.flatnonzero(full) + 0.5) / whole
    level, force_gain = per_cycle(series.F, loop.F)
    _, motion_gain = per_cycle(series.x, loop.X)
    slow = np.polynomial.Polynomial.fit(at, level, min(drift_degree(whole), full.sum() - 2))(at)
    rest = level - slow
    changes = []
    for gain in (force_gain, motion_gain):
        line = np.polynomial.Polynomial.fit(at, gain, 1)
        left = gain - line(at)
        sd = np.sqrt(left @ left / (at.size - 2) / ((at - at.mean()) ** 2).sum())
        changes.append((float(line(at[-1]) - line(at[0])), float(sd) * float(at[-1] - at[0])))
    return Wander(
        drift=float(np.ptp(slow)),
        rest=float(np.ptp(rest)),
        rest_noise=1.4826 * float(np.median(np.abs(np.diff(rest)))) / math.sqrt(2),
        jump_at=float(series.time[0] + at[int(np.argmax(np.abs(np.diff(rest))))] * loop.duration),
        force_change=changes[0][0],
        motion_change=changes[1][0],
        change_sd=float(np.hypot(changes[0][1], changes[1][1])),
        change_dof=at.size - 2,
        duration=loop.duration,
    )
