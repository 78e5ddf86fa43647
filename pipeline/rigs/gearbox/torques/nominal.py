"""Nominal value of a torque in one stage, with an error that knows of drift and ripple (fact sheet 5.2).

The transient is cut by MSER (White, Simulation 69, 1997, 323), the rest averaged over whole
revolutions, and the error comes from the autocorrelation and the zero offset. Sensor range and gain
(type B) are not in it: `type_b` gives them, to be stated beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import effective_size, t_quantile
from pipeline.rigs.gearbox.aligned_run import Span, ZeroOffset, within
from pipeline.rigs.gearbox.torques.ripple import columns

# Batches for the truncation point are this long, s; a stage keeps at least half of its length.
_BATCH = 0.1


@dataclass(frozen=True)
class Level:
    """A nominal value.

    Attributes
    ----------
    value
        Mean over whole revolutions, N m (or the unit of the signal).
    std_error
        Statistical, the zero offset's error included.
    dof
        Degrees of freedom of `std_error`.
    own_error
        Without the zero offset's error: what counts for differences within a run.
    span
        What was averaged, s; `revolutions` whole turns of the shaft (0: it stood, or its speed is unknown).
    correlation_time
        Integrated autocorrelation time, s: duration over effective samples.
    """

    value: float
    std_error: float
    dof: float
    own_error: float
    span: Span
    revolutions: int
    correlation_time: float

    @property
    def offset_error(self) -> float:
        """Standard error of the zero offset in it."""
        return math.sqrt(max(self.std_error**2 - self.own_error**2, 0.0))

    @property
    def ci95(self) -> Span:
        """95 % interval by Student's t."""
        half = t_quantile(self.dof) * self.std_error
        return self.value - half, self.value + half


def truncation(values: np.ndarray) -> int:
    """Return how many leading values MSER cuts: the d that minimises s^2(d) / (n - d), d at most n/2.

    Parameters
    ----------
    values
        Batch means, shape (n,).

    Examples
    --------
    >>> truncation(np.r_[np.linspace(5, 1, 10), np.tile([0.1, -0.1], 20)])
    10
    """
    n = values.size
    if n < 6:
        return 0
    shifted = values - values.mean()
    tail = np.cumsum(shifted[::-1])[::-1]
    tail_squares = np.cumsum((shifted**2)[::-1])[::-1]
    left = n - np.arange(n)
    error = (tail_squares / left - (tail / left) ** 2) / left
    return int(np.argmin(error[: n // 2 + 1]))


def level(
    time: np.ndarray,
    values: np.ndarray,
    span: Span,
    speed: float = 0.0,
    offset: ZeroOffset | None = None,
    guard: float = 0.05,
) -> Level | None:
    """Average a signal over the settled part of a stage.

    Parameters
    ----------
    time, values
        s and N m, shape (n,), some 50 Hz or more (the 100 Hz block means serve), offset taken off.
    span
        The stage, s.
    speed
        Of the shaft that carries the torque, rad/s; 0 where it stands or is unknown.
    offset
        Its error is added in quadrature.
    guard
        Left out at both ends, s: as much as the stage's borders are uncertain.

    Returns
    -------
    None where less than two revolutions, or less than 0.5 s, are left.
    """
    part = within(time, (span[0] + guard, span[1] - guard))
    t, x = time[part], values[part]
    kept = np.isfinite(x)
    t, x = t[kept], x[kept]
    if t.size < 20 or t[-1] - t[0] < 0.5:
        return None
    step = float(np.median(np.diff(t)))
    start = t[0] + _settled(t, x, speed, step)
    turn = 2 * math.pi / speed if speed > 0 else 0.0
    revolutions = int((t[-1] + step - start) / turn) if turn else 0
    if turn and revolutions < 2:
        return None
    start = t[-1] + step - revolutions * turn if turn else start
    used = slice(int(np.searchsorted(t, start - 0.5 * step)), t.size)
    t, x = t[used], x[used]
    mean, residual, fitted = _mean(t, x, speed)
    count = effective_size(residual, 1)
    own = float(np.sqrt(np.mean(residual**2) / max(count - fitted, 1.0)))
    # The correlation time is estimated too, and scatters more than the variance (Sokal 1997, eq. 3.19).
    dof = max(count / 3, 1.0)
    zero = offset or ZeroOffset()
    total = math.hypot(own, zero.std_error)
    pooled = total**4 / (own**4 / dof + zero.std_error**4 / zero.dof) if total > 0 else dof
    return Level(mean, total, pooled, own, (float(t[0]), float(t[-1])), revolutions, (t[-1] - t[0]) / count)


def type_b(sensor_range: float, relative: float = 0.001) -> float:
    """Return the standard uncertainty of a sensor stated as a share of its range, N m (rectangular limits).

    Examples
    --------
    >>> round(type_b(20.0), 4)
    0.0115
    """
    return sensor_range * relative / math.sqrt(3)


def _settled(t: np.ndarray, x: np.ndarray, speed: float, step: float) -> float:
    """Return how long the transient lasts, s: MSER on batch means of what the ripple leaves."""
    mean, residual, _ = _mean(t, x, speed)
    size = max(round(_BATCH / step), 1)
    count = x.size // size
    batches = (mean + residual)[: count * size].reshape(count, size).mean(axis=1)
    return truncation(batches) * size * step


def _mean(t: np.ndarray, x: np.ndarray, speed: float) -> tuple[float, np.ndarray, int]:
    """Return the mean beside shaft orders 1 and 2, what they leave over, and how many columns there were."""
    if not speed > 0:
        return float(x.mean()), x - x.mean(), 1
    A = columns(speed * (t - t[0]))
    found = np.linalg.lstsq(A, x, rcond=None)[0]
    return float(found[0]), x - A @ found, A.shape[1]
