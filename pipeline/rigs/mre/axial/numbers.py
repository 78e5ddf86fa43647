"""What a fitted loop tells, with intervals: the parameters of the model, both stiffnesses, loss and drop.

Where rho is well known, errors go by the covariance; where it is not, a number is told by all values of rho that
the data allow, and not at all where these leave it open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import propagate, t_quantile
from pipeline.rigs.mre.axial.loop import LoopModel, loss_ratio, secant, slope, unloading_drop
from pipeline.rigs.mre.axial.loop_data import LoopFit, within

MODEL = ("stiffness", "stiffness_cubic", "alpha", "rho")
SHAPE = ("stiffness_secant", "stiffness_slope", "loss_ratio", "unloading_drop")
NAMES = (*MODEL, *SHAPE)
HYSTERETIC = ("alpha", "rho", "loss_ratio", "unloading_drop")
# Misfit by which the loop must be better with hysteresis than without (chi-square of two unknowns, 1 in 10^5).
SEEN = 23.0
# Relative standard error of rho up to which it is told by the covariance; half width of an interval, relative,
# beyond which a number is not determined.
_SHARP, _OPEN = 0.12, 0.5
# Share of the stroke that the release must cover for the loss of a whole loop.
_RETURNED = 0.9

Quantity = Callable[[LoopModel, float], float]
_OF_MODEL: Mapping[str, Quantity] = {
    "stiffness": lambda model, _: model.k,
    "stiffness_cubic": lambda model, _: model.k3,
    "alpha": lambda model, _: model.alpha,
    "stiffness_secant": secant,
    "stiffness_slope": slope,
    "loss_ratio": loss_ratio,
    "unloading_drop": unloading_drop,
}


@dataclass(frozen=True)
class Numbers:
    """Estimates of one run by name, and what is to be said of them."""

    estimates: Mapping[str, Estimate]
    remarks: tuple[str, ...]


def d_max_of(fit: LoopFit) -> float:
    """Return the displacement at the turn of the first loop that goes (nearly) as far as any, m."""
    tops = fit.path.turns[1::2]
    return float(tops[np.flatnonzero(tops >= 0.95 * tops.max())[0]])


def returned_share(fit: LoopFit) -> float:
    """Return which share of the stroke the release covers; 0 where there is none."""
    turns = fit.path.turns
    top = int(np.argmax(turns[1::2])) * 2 + 1
    if top + 1 >= turns.size:
        return 0.0
    reached = float(fit.path.d[fit.path.stroke == top].min(initial=turns[top]))
    return (float(turns[top]) - reached) / float(turns[top])


def numbers_of(fit: LoopFit, *, release: str = "") -> Numbers:
    """Return what the loop tells; `release` is why the release cannot be used, empty where it can."""
    d_max = d_max_of(fit)
    dof = fit.covariance.dof
    allowed = within(fit, dof)
    covered = returned_share(fit)
    if not release and covered < 0.1:
        release = "only the loading branch was measured"
    if release:
        return _loading_only(fit, d_max, allowed, release)
    if fit.elastic[2] - fit.chi2.min() < SEEN:
        return _elastic(fit, d_max, float(np.median(2 * t_quantile(dof) * fit.conditional_error[:, 2])))
    left_open = _by_gauge(fit)
    if unloading_drop(fit.model, d_max) < left_open:
        return _elastic(fit, d_max, left_open)
    ends = (bool(allowed[0]), bool(allowed[-1]))
    sd_log = float(fit.covariance.std_error[0])
    sharp = not any(ends) and sd_log < _SHARP
    found = {name: _sharp(fit, name, d_max) if sharp else _spread(fit, name, d_max, allowed) for name in _OF_MODEL}
    found["rho"] = _rho(fit, allowed, sharp)
    remarks = []
    if covered < _RETURNED:
        reason = f"the release ends at {100 * (1 - covered):.0f} % of the stroke: the work below it was not measured"
        found["loss_ratio"] = undetermined("loss_ratio", reason)
        remarks.append(reason)
    if found["rho"].value is None:
        remarks.append(f"rho is not determined: {found['rho'].reason}")
    return Numbers({name: found[name] for name in NAMES}, tuple(remarks))


def _sharp(fit: LoopFit, name: str, d_max: float) -> Estimate:
    """Return a number with the error of the covariance, the gauge's included."""
    top = int(np.argmin(np.abs(fit.path.turns - d_max)))

    def value(z: np.ndarray) -> float:
        model, turns = fit.unpack(z)
        return _OF_MODEL[name](model, float(turns[top]))

    found, spread = propagate(value, fit.z, fit.covariance)
    return _told(name, float(found[0]), float(spread.std_error[0]), fit.covariance.dof)


def _told(name: str, value: float, sd: float, dof: float) -> Estimate:
    if name == "stiffness_cubic" or t_quantile(dof) * sd < _OPEN * abs(value):
        return estimate(name, value, sd, dof=dof)
    return undetermined(name, f"it would read {value:.3g} with a standard error of {sd:.2g}")


def _spread(fit: LoopFit, name: str, d_max: float, allowed: np.ndarray) -> Estimate:
    """Return a number whose interval holds those of every rho that the data allow."""
    t = t_quantile(fit.covariance.dof)
    best = _OF_MODEL[name](fit.model, d_max)
    low, high = [best], [best]
    for i in np.flatnonzero(allowed):
        value, sd = _given_rho(fit, name, d_max, int(i))
        low.append(value - t * sd)
        high.append(value + t * sd)
    half = (max(high) - min(low)) / 2
    if name != "stiffness_cubic" and half > _OPEN * abs(best):
        return undetermined(name, f"anything from {min(low):.3g} to {max(high):.3g} fits, with rho")
    told = "interval over all rho that the data allow"
    return Estimate(name, best, half / t, (min(low), max(high)), {}, told, fit.covariance.dof)


def _given_rho(fit: LoopFit, name: str, d_max: float, i: int) -> tuple[float, float]:
    """Return a number and its error at one rho, the errors of the linear unknowns taken one by one."""
    c, sd = fit.conditional[i], fit.conditional_error[i]
    model = LoopModel(float(c[0]), float(c[1]), float(c[2]), float(fit.rhos[i]))
    value = _OF_MODEL[name](model, d_max)
    if name in ("stiffness", "stiffness_cubic", "alpha"):
        return value, float(sd[("stiffness", "stiffness_cubic", "alpha").index(name)])
    if name in ("stiffness_secant", "stiffness_slope"):
        # The curve as a whole is known by the force; its parts are not.
        return value, _curve_error(fit, value, d_max)
    return value, abs(value) * float(sd[2]) / max(abs(model.alpha), 1e-30)


def _rho(fit: LoopFit, allowed: np.ndarray, sharp: bool) -> Estimate:
    if sharp:
        sd = float(fit.covariance.std_error[0]) * fit.model.rho
        return estimate("rho", fit.model.rho, sd, dof=fit.covariance.dof, logarithmic=True)
    low, high = fit.rhos[allowed][[0, -1]].tolist()
    length = float(np.abs(np.diff(fit.path.turns)).max())
    if allowed[-1] and allowed[0]:
        return undetermined("rho", "any value fits")
    if allowed[-1]:
        return undetermined(
            "rho",
            f"1/rho is too small to be seen, less than {1e6 / low:.2g} um; the gauge and the samples do not resolve it",
        )
    if allowed[0]:
        sum_ = fit.model.k + fit.model.alpha * fit.model.rho
        return undetermined(
            "rho", f"1/rho is as large as the stroke ({1e3 * length:.3g} mm) or larger, at least {1e3 / high:.2g} mm; only k + alpha rho = {sum_:.4g} N/m is known",
        )  # fmt: skip
    if high / low > 1 / (1 - _OPEN) ** 2:
        return undetermined("rho", f"anything from {low:.3g} to {high:.3g} 1/m fits")
    t = t_quantile(fit.covariance.dof)
    return Estimate("rho", fit.model.rho, (high - low) / 2 / t, (low, high), {}, "", fit.covariance.dof)


def _by_gauge(fit: LoopFit) -> float:
    """Return which distance between loading and release (N) the gauge leaves open, each stroke's shift being unknown."""
    motion = fit.data.motion
    if not motion.smooth and motion.shift_spread is None:
        return 0.5 * fit.model.k * motion.step
    return 4 * fit.model.k * math.sqrt(2) * max(s.marks.spread for s in motion.strokes)


def _place_error(fit: LoopFit, d_max: float) -> float:
    """Return the standard error of the displacement at the turn, relative."""
    top = int(np.argmin(np.abs(fit.path.turns - d_max)))
    _, spread = propagate(lambda z: float(fit.unpack(z)[1][top]), fit.z, fit.covariance)
    return float(spread.std_error[0]) / d_max


def _curve_error(fit: LoopFit, value: float, d_max: float) -> float:
    """Return the error of a stiffness of the loading branch: force along the curve, displacement at the turn."""
    return math.hypot(fit.sigma * math.sqrt(5 / fit.effective) / d_max, value * _place_error(fit, d_max))


def _elastic(fit: LoopFit, d_max: float, limit: float) -> Numbers:
    """Tell the elastic curve where no hysteresis is seen; it may be up to `limit` (N)."""
    c, sd, _ = fit.elastic
    dof = fit.covariance.dof
    reason = f"no hysteresis is seen; the release lies less than about {limit:.2g} N below the loading"
    model = LoopModel(float(c[0]), float(c[1]), 0.0, 1 / d_max)
    found = {name: undetermined(name, reason) for name in HYSTERETIC}
    found["stiffness"] = estimate(
        "stiffness", float(c[0]), math.hypot(float(sd[0]), float(c[0]) * _place_error(fit, d_max)), dof=dof
    )
    found["stiffness_cubic"] = estimate("stiffness_cubic", float(c[1]), float(sd[1]), dof=dof)
    for name in ("stiffness_secant", "stiffness_slope"):
        value = _OF_MODEL[name](model, d_max)
        found[name] = estimate(name, value, _curve_error(fit, value, d_max), dof=dof)
    return Numbers({name: found[name] for name in NAMES}, (reason,))


def _loading_only(fit: LoopFit, d_max: float, allowed: np.ndarray, release: str) -> Numbers:
    """Tell secant and slope of the loading branch; its bend may be elastic or hysteretic, so nothing else."""
    reason = f"{release}: whether its bend is elastic or hysteretic cannot be told"
    found = {name: undetermined(name, reason) for name in NAMES}
    for name in ("stiffness_secant", "stiffness_slope"):
        told = _spread(fit, name, d_max, allowed)
        found[name] = replace(told, reason="from the loading branch alone") if told.value is not None else told
    return Numbers(found, (release,))
