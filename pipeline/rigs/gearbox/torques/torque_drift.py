"""A torque that changes while nothing else does: a zero that drifts, bearings that warm up, a brake that still rubs.

Told from the locked, steady stretches before and after SOS alone, so it needs no standstill at the end. What
the change is, one channel cannot tell; how much it may falsify the numbers, it can.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.estimation.uncertainty import effective_size, t_quantile
from pipeline.rigs.gearbox.aligned_run import Span, within
from pipeline.rigs.gearbox.torques.ripple import columns

# Two-sided probability of 3 sigma.
_LEVEL = 0.9973
# Fewer seconds of steady torque tell no drift.
_LEAST = 1.5
# A step must explain so many variances more than a line to be one: in doubt the torque changes all the time.
_CLEARLY = 9.0
# The change over this is a standard error: a 95 % interval reaches a third beyond all of the change, whose course is not known.
_REACH = 1.5


@dataclass(frozen=True)
class Drift:
    """A significant change of a steady torque.

    Attributes
    ----------
    shape
        `line`: it changes all the time; `step`: it changes between the stretches, over SOS.
    rate
        Of a line, N m/s; `step` of a step, N m. The other is 0.
    since
        When the zero was known, s (the log's begin where it never was); `turn`: when a step happened, s.
    sigmas, limit
        How significant it is, and what would be so by chance.
    """

    shape: Literal["line", "step"]
    rate: float
    step: float
    since: float
    turn: float
    sigmas: float
    limit: float

    def change(self, time: float) -> float:
        """Return how far the torque has moved by `time` since its zero was known, N m."""
        if self.shape == "line":
            return self.rate * (time - self.since)
        return self.step * (float(time > self.turn) - float(self.since > self.turn))

    def error(self, time: float) -> float:
        """Return the standard error of a torque at `time`, N m: the zero moved by anything between nothing and all of it."""
        return abs(self.change(time)) / _REACH


def drift_of(
    time: np.ndarray, torque: np.ndarray, angle: np.ndarray, steady: Sequence[Span], since: float
) -> Drift | None:
    """Look for a change of a torque over locked, steady stretches.

    Parameters
    ----------
    time, torque, angle
        s, N m (offset taken off) and rad of the output shaft, shape (n,), some 100 Hz.
    steady
        Settled parts of FOS before and after SOS, s.
    since
        When the zero is known, s.

    Returns
    -------
    None where the torque does not change by more than its noise explains, or too little of it is steady.

    Notes
    -----
    Mean, ripple of each stretch and one column of change, a line or a step, by least squares; the errors know
    the correlation time of what is left. A step is told where it explains clearly more than a line.
    """
    rows, stretches = [], []
    for i, span in enumerate(steady):
        part = np.arange(time.size)[within(time, span)]
        rows.append(part)
        stretches.append(np.full(part.size, i))
    kept = np.concatenate(rows) if rows else np.zeros(0, dtype=int)
    if kept.size < 50 or sum(end - start for start, end in steady) < _LEAST:
        return None
    stretch, t, x = np.concatenate(stretches), time[kept], torque[kept]
    middle = 0.5 * (float(t[0]) + float(t[-1]))
    base = [np.ones_like(t)]
    for i in range(len(steady)):
        # After a slip the input shaft has another angle to the encoder: each stretch has its own ripple.
        base += [column * (stretch == i) for column in columns(angle[kept]).T[1:]]
    shapes: list[tuple[Literal["line", "step"], np.ndarray]] = [("line", t - middle)]
    if len(steady) > 1:
        shapes.append(("step", (stretch > 0).astype(float)))
    found = [(shape, *_size(np.column_stack(base), column, x, stretch)) for shape, column in shapes]
    clearly = len(found) > 1 and found[0][-2] - found[1][-2] > _CLEARLY * found[1][-1]
    significant = [one for one in (reversed(found) if clearly else found) if abs(one[2]) > one[3]]
    if not significant:
        return None
    shape, size, sigmas, limit, _, _ = significant[0]
    turn = 0.5 * (steady[0][1] + steady[-1][0])
    return Drift(shape, size if shape == "line" else 0.0, size if shape == "step" else 0.0, since, turn, sigmas, limit)


def _size(
    base: np.ndarray, column: np.ndarray, x: np.ndarray, stretch: np.ndarray
) -> tuple[float, float, float, float, float]:
    """Return size of the change, its standard errors, the limit of chance, sum of squares left and that of one independent part."""
    basis = np.linalg.qr(base)[0]
    free = column - basis @ (basis.T @ column)
    power = float(free @ free)
    rest = x - basis @ (basis.T @ x)
    size = float(free @ rest) / power if power > 0 else 0.0
    left = rest - size * free
    independent = sum(effective_size(left[stretch == i], 2) for i in np.unique(stretch))
    dof = max(independent - 3.0, 1.0)
    error = math.sqrt(float(left @ left) / dof / power) if power > 0 else math.inf
    # The correlation time is estimated too: fewer degrees of freedom than independent samples.
    return (
        size,
        size / error if error > 0 else 0.0,
        t_quantile(max(dof / 3.0, 3.0), _LEVEL),
        float(left @ left),
        float(left @ left) / dof,
    )
