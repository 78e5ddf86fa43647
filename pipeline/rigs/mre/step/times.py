"""What the lags of a direction mean: delay, time constants, t63 and t90 with intervals, or why they are open."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.estimation.uncertainty import t_quantile
from pipeline.rigs.mre.step.lag_fit import ALIKE, Admitted, LagFit
from pipeline.rigs.mre.step.lag_problem import parts_of
from pipeline.rigs.mre.step.lags import passes, response
from pipeline.rigs.mre.step.record import DIRECTIONS, Step

NAMES = ("delay", "time_constant_1", "time_constant_2", "t63", "t90")
SHARES = {"t63": 1 - math.exp(-1), "t90": 0.9}
# Relative standard error beyond which a time is not determined.
_WIDEST = 0.4
_HOPELESS = 20.0  # of a logarithm, or of a delay in s: nothing is known then
# Standard errors by which two time constants must differ to be two numbers. The data know the square of their difference, which noise
# alone lifts off 0: its relative standard error is twice that of the difference, and it must pass 0 by the one-sided 1 % point. Were
# more asked for, the larger would be told mostly where noise makes it larger still.
_APART = 2 * 2.326
# Steps of the force's converter over its noise that bias levels; what they do to a time constant, relative.
_COARSE, _BLUR = 1.5, 2.5
# A change of the current within one sample hides all that is shorter than so many samples.
_SAMPLES = 2.0


def estimates_of(fit: LagFit, force_lag: float = 0.0) -> list[Estimate]:
    """Return the estimates of both directions; those of one that the log does not hold are open.

    Parameters
    ----------
    fit
        The chosen model.
    force_lag
        How late the force channel is against the current, where it was calibrated, s: taken off delay and times.
    """
    told: list[Estimate] = []
    for direction in DIRECTIONS:
        if direction not in fit.lags:
            reason = f"the log holds no {'rising' if direction == 'rise' else 'falling'} step of the current"
            told += [undetermined(name, reason, {"direction": direction}) for name in NAMES]
            continue
        told += _of(fit, direction, force_lag)
    return told


def largest(fit: LagFit, direction: str) -> tuple[int, Step]:
    """Return number and step of the largest step of a direction."""
    steps = [(number, step) for number, step in enumerate(fit.record.steps) if step.direction == direction]
    return max(steps, key=lambda pair: abs(pair[1].size))


def blind(step: Step, period: float) -> float:
    """Return the time below which nothing can be told, s: 0 where the samples resolve the change of the current."""
    return _SAMPLES * period if step.spread > 0 else 0.0


def _of(fit: LagFit, direction: str, force_lag: float) -> list[Estimate]:
    at: dict[str, float | str | bool] = {"direction": direction}
    _, step = largest(fit, direction)
    hidden = blind(step, fit.record.period)
    names = [name for name in fit.names if name.startswith(f"{direction}.")]
    rows = fit.index(*names)
    matrix = fit.covariance.matrix[np.ix_(rows, rows)]
    dof, t = fit.covariance.dof, t_quantile(fit.covariance.dof)
    values = fit.q[rows]
    taus = fit.taus(direction)
    if not np.isfinite(matrix).all() or float(np.diag(matrix).max()) > _HOPELESS**2:
        reason = _bound_reason(fit, direction)
        return [undetermined(name, reason, at) for name in NAMES]
    sd = np.sqrt(np.diag(matrix))
    # A change within one sample may have begun anywhere in it, and its shape there is not known.
    shape = step.spread**2 / np.array(taus)
    steps = coarse(fit)
    answer = max(abs(fit.gain(largest(fit, direction)[0]) * step.size), 1e-12)
    sd[0] = math.hypot(sd[0], steps * taus[0] / answer)
    found = [_delay(values[0] - force_lag, math.hypot(sd[0], step.spread), hidden, dof, at)]
    wider = fit.admitted.get(direction)
    found[0] = _with_second(found[0], wider, f"{direction}.L", -force_lag)
    apart = len(taus) == 1 or (values[1] - values[2]) > max(
        _APART * math.sqrt(max(matrix[1, 1] + matrix[2, 2] - 2 * matrix[1, 2], 0.0)), ALIKE
    )
    total, total_sd = sum(taus), _spread(lambda q: sum(_exp(v) for v in q[1:]), values, matrix)
    told_sum = f"their sum is {total:.4g} +- {t * math.hypot(total_sd, float(shape.max())):.2g} s"
    for number, name in enumerate(("time_constant_1", "time_constant_2")):
        if number == 1 and len(taus) == 1:
            lag = f"the one lag is {total:.4g} +- {t * math.hypot(total_sd, float(shape.max())):.2g} s"
            found.append(
                undetermined(name, f"a second lag is not separable from the delay and the first (BIC): {lag}", at)
            )
        elif not apart:
            found.append(undetermined(name, f"the two lags are too alike to be told apart; {told_sum}", at))
        elif taus[number] < hidden:
            found.append(undetermined(name, f"{_hidden(hidden)}; {told_sum}", at))
        else:
            blur = _BLUR * steps / answer * taus[0] / taus[number]
            relative = math.hypot(sd[1 + number], shape[number] / taus[number], blur)
            if relative > _WIDEST:
                found.append(
                    undetermined(name, f"the data leave it open to a factor {_exp(t * relative):.2g}; {told_sum}", at)
                )
            else:
                half = _exp(t * relative)
                value = taus[number]
                told = Estimate(name, value, value * relative, (value / half, value * half), at, dof=dof)
                found.append(_with_second(told, wider, f"{direction}.ln_tau1"))
    return [*found, *_passing(fit, direction, values, matrix, force_lag, at)]


def coarse(fit: LagFit) -> float:
    """Return the standard error of a level of the force for steps of the converter that are larger than the noise, N; 0 otherwise."""
    levels = np.unique(fit.record.force)
    step = float(np.median(np.diff(levels))) if levels.size > 1 else 0.0
    return step / math.sqrt(12) * math.sqrt(2) if step > _COARSE * fit.sigma else 0.0


def _with_second(told: Estimate, wider: Admitted | None, name: str, shift: float = 0.0) -> Estimate:
    """Take value and interval as a second lag that cannot be told admits them: without it both hold a part of that lag."""
    if wider is None or told.value is None or told.ci95 is None:
        return told
    interval, logarithmic = wider.intervals[name], name.endswith("ln_tau1")
    value = float(wider.q[1 if logarithmic else 0])
    value, low, high = (_exp(v) if logarithmic else v + shift for v in (value, interval.low, interval.high))
    if not logarithmic:  # a second lag that is none would be made up for by an answer before its cause
        value = max(value, min(told.value, 0.0))
    low, high = min(low, told.ci95[0]), max(high, told.ci95[1])
    if not math.isfinite(low) or not math.isfinite(high) or (logarithmic and high > 10 * low):
        return undetermined(told.name, "a second lag that cannot be told from it leaves it open", told.at)
    reason = "value and interval allow for a second lag that is not separable"
    error = max((high - low) / 4, told.std_error or 0.0)
    return Estimate(told.name, value, error, (low, high), told.at, reason, told.dof)


def _hidden(hidden: float) -> str:
    return f"it is shorter than {hidden:.2g} s: the current changes within one sample, which hides what is so short"


def _delay(value: float, sd: float, hidden: float, dof: float, at: dict[str, float | str | bool]) -> Estimate:
    half = t_quantile(dof) * sd
    if abs(value) < hidden and half > 0.5 * abs(value):
        return undetermined(
            "delay", f"{_hidden(hidden)}; it lies between {value - half:.3g} and {value + half:.3g} s", at
        )
    return Estimate("delay", float(value), sd, (float(value - half), float(value + half)), at, dof=dof)


def _passing(
    fit: LagFit,
    direction: str,
    values: np.ndarray,
    matrix: np.ndarray,
    force_lag: float,
    at: dict[str, float | str | bool],
) -> list[Estimate]:
    """Return t63 and t90 of the largest step, counted from the onset of its current."""
    wider = fit.admitted.get(direction)
    if wider is not None and wider.matrix is not None:  # one lag alone answers too late at first and too soon at last
        values, matrix = wider.q, wider.matrix
    number, step = largest(fit, direction)
    record = fit.record
    share = parts_of(record)[number] / (step.after - step.before)
    start = max(int((step.start - record.grid[0]) / record.dt) - 2, 0)
    stop = int((min(step.end, record.grid[-1]) - record.grid[0]) / record.dt)
    # Carried on at its level as long as the slowest lag needs, thinned where that is long.
    extra = math.ceil(8 * sum(fit.taus(direction)) / record.dt)
    u = np.r_[share[start:stop], np.ones(min(extra, 200_000))]
    time = record.grid[0] + (start + np.arange(u.size)) * record.dt - step.onset
    answer = max(abs(fit.gain(number) * step.size), 1e-12)
    told = []
    for name, level in SHARES.items():

        def when(q: np.ndarray, level: float = level) -> float:
            y = response(u, tuple(_exp(v) for v in q[1:]), record.dt)[0]
            return passes(time, y, level) + float(q[0])

        value = when(values) - force_lag
        if not math.isfinite(value):
            told.append(undetermined(name, "the response does not get that far", at))
            continue
        later = (when(values, level + 0.02) - when(values, level - 0.02)) / 0.04  # s per share of the change
        sd = math.hypot(_spread(when, values, matrix), step.spread, 0.05 * record.period, coarse(fit) / answer * later)
        half = t_quantile(fit.covariance.dof) * sd
        if sd > _WIDEST * abs(value) or half > abs(value):
            told.append(
                undetermined(name, f"the data leave it between {value - half:.3g} and {value + half:.3g} s", at)
            )
        else:
            told.append(Estimate(name, value, sd, (value - half, value + half), at, dof=fit.covariance.dof))
    return told


def _exp(value: float) -> float:
    """Return exp without overflow: what is beyond is undetermined anyway."""
    return math.exp(min(value, 60.0))


def _spread(function: Callable[[np.ndarray], float], values: np.ndarray, matrix: np.ndarray) -> float:
    """Return the standard error of a function of the parameters, by differences of a tenth of a standard error."""
    gradient = np.empty(values.size)
    for i in range(values.size):
        step = np.zeros(values.size)
        step[i] = 0.1 * math.sqrt(matrix[i, i])
        gradient[i] = (function(values + step) - function(values - step)) / (2 * step[i]) if step[i] > 0 else 0.0
    return math.sqrt(max(float(gradient @ matrix @ gradient), 0.0))


def _bound_reason(fit: LagFit, direction: str) -> str:
    ended = [name.split(".")[1] for name in fit.at_bound if name.startswith(f"{direction}.")]
    what = {"L": "the delay", "ln_tau1": "the larger time constant", "ln_tau2": "the smaller time constant"}
    if ended:
        return f"the fit ends at the edge of what is admissible ({', '.join(what[name] for name in ended)}): the response is faster or slower than the log can tell"
    return "the data do not determine the response"
