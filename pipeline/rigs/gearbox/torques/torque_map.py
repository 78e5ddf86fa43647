"""Output over input torque, phase by phase: T_out = a (T_in - T_00) (fact sheet 4.3, 5.4).

a = 1 would be a box whose drag depends on speed alone; the same a < 1 in all phases is drag that grows
with load, or a sensor's gain: one bench cannot tell which.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.gearbox.aligned_run import AlignedRun, Span, within
from pipeline.rigs.gearbox.torques.nominal import Level
from pipeline.rigs.gearbox.torques.ripple import learn
from pipeline.signals.filtering import slope as time_slope

LEAD = 0.5
"""Before the brake comes on, so much of the locked, steady state counts with its rise, s."""

# Start-up: T_0(w) is taken out as a polynomial of this degree in speed.
_SPEED_DEGREE = 3
# Block means for the fits, Hz: fine enough for a rise of 0.1 s.
_RATE = 250.0


@dataclass(frozen=True)
class Line:
    """y = slope x + intercept by ordinary least squares, with standard errors and R^2."""

    slope: float
    slope_error: float
    intercept: float
    intercept_error: float
    r2: float
    largest_residual: float
    dof: float


@dataclass(frozen=True)
class Transfer:
    """T_out = slope (T_in - intercept) in one phase: a (1) and T_00 (N m), standard errors, their dof.

    `intercept` is NaN where the phase cannot tell it (start-up, where the drag changes with speed). `intercept_dof` are
    those of its error where they are not those of the slope's.
    """

    phase: str
    slope: float
    slope_error: float
    intercept: float
    intercept_error: float
    dof: float
    intercept_dof: float | None = None

    @property
    def slope_ci95(self) -> Span:
        """95 % interval of a."""
        half = t_quantile(self.dof) * self.slope_error
        return self.slope - half, self.slope + half


def straight_line(x: np.ndarray, y: np.ndarray) -> Line:
    """Fit a straight line by ordinary least squares.

    Parameters
    ----------
    x, y
        Shape (n,), n at least 3.

    Examples
    --------
    >>> line = straight_line(np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0]))
    >>> round(line.slope, 6), round(line.intercept, 6)
    (2.0, 1.0)
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    centred = x - x.mean()
    spread = float(centred @ centred)
    slope = float(centred @ y) / spread
    intercept = float(y.mean() - slope * x.mean())
    residual = y - intercept - slope * x
    variance = float(residual @ residual) / (x.size - 2)
    total = float(np.sum((y - y.mean()) ** 2))
    return Line(
        slope,
        math.sqrt(variance / spread),
        intercept,
        math.sqrt(variance * (1 / x.size + x.mean() ** 2 / spread)),
        1 - float(residual @ residual) / total if total > 0 else math.nan,
        float(np.abs(residual).max()),
        x.size - 2,
    )


def total_least_squares(x: np.ndarray, y: np.ndarray, ratio: float = 1.0) -> float:
    """Return the slope of y over x where both are noisy (Deming), means or other columns taken out before.

    Parameters
    ----------
    x, y
        Shape (n,), centred.
    ratio
        Variance of y's noise over that of x's.

    Examples
    --------
    >>> x = np.array([-1.0, 0.0, 1.0])
    >>> total_least_squares(x, 0.5 * x)
    0.5
    """
    sxx, syy, sxy = float(x @ x), float(y @ y), float(x @ y)
    lead = syy - ratio * sxx
    return (lead + math.copysign(math.hypot(lead, 2 * math.sqrt(ratio) * sxy), 1.0)) / (2 * sxy)


def brake_transfer(run: AlignedRun, steady: list[Span], until: float = math.inf) -> Transfer | None:
    """Fit the rise of both torques between brake onset and unlock: locked, and at almost constant speed.

    Parameters
    ----------
    run
        With the events `brake_onset` and `unlock`.
    steady
        Settled locked stretches (`Level.span` of fos, fos_after): the ripple is learnt in the first, the noise in all.
    until
        What comes later is left out, s: a torque sensor at its end stop.

    Returns
    -------
    None where the events or a steady stretch are missing.
    """
    onset, unlock = run.events.get("brake_onset"), run.events.get("unlock")
    if onset is None or unlock is None or not unlock > onset or not steady:
        return None
    data = _Locked.of(run, steady)
    # A block mean reaches half a block further.
    part = within(data.time, (onset - LEAD, min(unlock, until - 0.5 / _RATE)))
    return data.transfer("brake", part, np.ones((part.stop - part.start, 1)))


def startup_transfer(run: AlignedRun, steady: list[Span]) -> Transfer | None:
    """Fit the start-up: T_0(w) is a polynomial of the speed, what else moves both torques is a.

    The gearbox's own inertia takes J_gb/J_load off the slope (some 3 %), which is not corrected.
    """
    if not run.has("startup", "fos") or not steady:
        return None
    start, end = run.stages["startup"][0], run.stages["fos"][0] + 1.0
    data = _Locked.of(run, steady)
    turning = float(np.interp(0.5, run.angle - run.angle_at(np.array([start]))[0], run.angle_time))
    part = within(data.time, (max(start, turning), min(end, run.stages["fos"][1])))
    moving = time_slope(run.angle_time, run.angle, 0.25)
    good = np.isfinite(moving)
    if part.stop - part.start < 50 or good.sum() < 10:
        return None
    speed = np.interp(data.time[part], run.angle_time[good], moving[good]) / run.speed_nominal
    return data.transfer("startup", part, speed[:, None] ** np.arange(_SPEED_DEGREE + 1))


def steady_transfer(before: tuple[Level, Level], loaded: tuple[Level, Level]) -> Transfer | None:
    """Return the line through the steady levels (input, output) locked at low load and slipping at high load.

    Drag differs between the two states unless T_0 happens to be equal: compare with the brake's rise.
    """
    rise_in, rise_out = loaded[0].value - before[0].value, loaded[1].value - before[1].value
    if not abs(rise_in) > 5 * math.hypot(loaded[0].own_error, before[0].own_error):
        return None
    a = rise_out / rise_in
    error_in = math.hypot(loaded[0].own_error, before[0].own_error)
    error_out = math.hypot(loaded[1].own_error, before[1].own_error)
    error = math.hypot(error_out, a * error_in) / abs(rise_in)
    t_00 = before[0].value - before[1].value / a
    lever = before[1].value / rise_out
    errors = (
        (1 + lever) * before[0].own_error,
        lever * loaded[0].own_error,
        (1 + lever) / a * before[1].own_error,
        lever / a * loaded[1].own_error,
        before[0].offset_error,
        before[1].offset_error / a,
    )
    dof = min(level.dof for level in (*before, *loaded))
    return Transfer("steady", a, error, t_00, math.hypot(*errors), dof)


@dataclass(frozen=True, eq=False)
class _Locked:
    """Both torques without ripple as block means, and their noise in steady locked stretches, shape (n,)."""

    time: np.ndarray
    torque_in: np.ndarray
    torque_out: np.ndarray
    noise: list[tuple[np.ndarray, np.ndarray]]

    @classmethod
    def of(cls, run: AlignedRun, steady: list[Span]) -> _Locked:
        time, torque_in, torque_out = run.means(_RATE)
        angle = run.angle_at(time)
        first = within(time, steady[0])
        free_in = torque_in - learn(angle[first], torque_in[first]).at(angle)
        free_out = torque_out - learn(angle[first], torque_out[first]).at(angle)
        noise = []
        for span in steady:
            # After a slip the input shaft has another angle to the encoder: each stretch has its own ripple.
            part = within(time, span)
            left_in = torque_in[part] - learn(angle[part], torque_in[part]).at(angle[part])
            left_out = torque_out[part] - learn(angle[part], torque_out[part]).at(angle[part])
            noise.append((left_in - left_in.mean(), left_out - left_out.mean()))
        return cls(time, free_in, free_out, noise)

    def transfer(self, phase: str, part: slice, nuisance: np.ndarray) -> Transfer | None:
        """Return a, and T_00 where a constant is the only other column; noise is that of the steady stretches."""
        x, y = self.torque_in[part], self.torque_out[part]
        if x.size < nuisance.shape[1] + 5:
            return None
        basis = np.linalg.qr(nuisance)[0]
        left_x, left_y = x - basis @ (basis.T @ x), y - basis @ (basis.T @ y)
        noise_x = np.concatenate([pair[0] for pair in self.noise])
        noise_y = np.concatenate([pair[1] for pair in self.noise])
        if not noise_x.std() > 0 or not left_x @ left_x > 10 * noise_x.var() * x.size:
            return None
        a = total_least_squares(left_x, left_y, float(noise_y.var() / noise_x.var()))
        if not 0 < a < 10:
            return None
        weights = left_x / (left_x @ left_x)
        noise = [n_y - a * n_x for n_x, n_y in self.noise]
        scattered = _scatter(weights, noise)
        dof = max(sum(n_x.size for n_x, _ in self.noise) / x.size, 2.0)
        if nuisance.shape[1] > 1:
            return Transfer(phase, a, scattered, math.nan, math.nan, dof)
        t_00 = float(x.mean() - y.mean() / a)
        level = y.mean() / a**2 * weights - 1 / (x.size * a)
        return Transfer(phase, a, scattered, t_00, _scatter(level, noise), dof)


def _scatter(weights: np.ndarray, noise: list[np.ndarray]) -> float:
    """Return the standard deviation of ``weights @ noise`` over all places of the noise where the weights fit."""
    n = weights.size
    sums = [np.correlate(part, weights, "valid") for part in noise if part.size >= n]
    if not sums:
        return float(np.linalg.norm(weights) * np.concatenate(noise).std() * math.sqrt(n))
    return float(np.sqrt(np.mean(np.concatenate(sums) ** 2)))
