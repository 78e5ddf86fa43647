"""Rolling speed over rotation: V = Re Omega through the origin, errors in both; an intercept and a wrong unit are looked for.

Speed of the drum or belt comes from the bench's own log, rotation from the passages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate
from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.in_words import chance

# Crystals of transmitter and bench log: within 20 ppm each, anywhere as likely.
CLOCKS_U = 20e-6 * math.sqrt(2.0 / 3.0)
# Rolling circumference over nominal diameter (ETRTO); how far a tire may be off, and what is expected without a size.
_ROLLING = 3.05
_TOLERANCE = 0.05
_USUAL = (0.25, 0.42)
_SUSPECTS = (
    (3.6, "the speed looks like km/h taken for m/s"),
    (1.0 / 3.6, "the speed looks converted from km/h twice"),
    (2.23694, "the speed looks like mph taken for m/s"),
    (3.28084, "the speed looks like ft/s taken for m/s"),
    (1000.0, "the speed looks like mm/s taken for m/s"),
    (60.0, "the speed looks like m/min taken for m/s"),
    (math.pi / 30.0, "the rotation looks like rpm taken for rad/s"),
    (2.0, "every second passage looks missed: rotation half of what it is, or speed told twice"),
    (0.5, "passages look counted twice: rotation twice what it is, or half the speed told"),
    (2.0 * math.pi, "the rotation looks like turns per second taken for rad/s"),
)
# What the channel holds if it is not a speed at all: V/Omega, m.
_ROTATIONS = (
    (30.0 / math.pi, "the speed channel looks like the wheel's rpm"),
    (1.0, "the speed channel looks like the wheel's rad/s"),
    (0.5 / math.pi, "the speed channel looks like the wheel's turns per second"),
)
_SIGNIFICANT = 0.01


@dataclass(frozen=True)
class SpeedPoint:
    """Mean rotation (rad/s) and rolling speed (m/s) of one run over the same span, with the standard errors of the means."""

    run: str
    rotation: float
    rotation_se: float
    speed: float
    speed_se: float


@dataclass(frozen=True, eq=False)
class SpeedLine:
    """The line and what is wrong with it. SI.

    Attributes
    ----------
    radius
        Re with its interval: scatter of the runs, or their own errors where those are larger, and the clocks.
    points
        Runs used, in the order of `residuals` (V - Re Omega, m/s) and `ratios` (V/Omega, m).
    intercept, intercept_se, p_value
        Of the line with an intercept, and the F-test of it; NaN with fewer than two speeds.
    chi2_reduced
        Scatter of the runs about the line over their standard errors, squared; NaN with one run.
    expected
        Re by the tire's size, m, or None.
    left_out
        Runs that were not used, with the reason.
    suspicion
        What is wrong with the unit or the count of passages; empty where nothing looks wrong.
    statement
        In a sentence or two.
    """

    radius: Estimate
    points: tuple[SpeedPoint, ...]
    residuals: np.ndarray
    ratios: np.ndarray
    intercept: float
    intercept_se: float
    p_value: float
    chi2_reduced: float
    speeds: int
    expected: float | None
    left_out: dict[str, str]
    suspicion: str
    statement: str


def speed_point(
    run: str, times: np.ndarray, rotation: np.ndarray, rotation_se: np.ndarray, moments: np.ndarray, speed: np.ndarray
) -> SpeedPoint:
    """Return the means of one run over the revolutions that the reference covers as well.

    Parameters
    ----------
    times, rotation, rotation_se
        Middle of each revolution (s), its mean rotation (rad/s) and standard error, shape (m,).
    moments, speed
        Reference: time (s, the same clock but for an offset) and rolling speed (m/s), shape (n,).

    Raises
    ------
    InputError
        If fewer than two revolutions have reference samples.

    Notes
    -----
    The wheel follows the drum, so the reference's noise is what is left of it beside the rotation. Its mean errs by that
    noise over the root of the number of *independent* samples.
    """
    good = np.isfinite(rotation) & np.isfinite(times)
    times, rotation, rotation_se = times[good], rotation[good], rotation_se[good]
    kept = np.isfinite(speed) & np.isfinite(moments)
    moments, speed = moments[kept], speed[kept]
    if times.size >= 2:
        half = 0.5 * np.median(2.0 * np.pi / rotation)
        within = (moments >= times[0] - half) & (moments <= times[-1] + half)
        inside = (
            (times >= moments[0] - half) & (times <= moments[-1] + half) if moments.size else np.zeros(0, dtype=bool)
        )
    if times.size < 2 or np.count_nonzero(within) < 2 or np.count_nonzero(inside) < 2:
        raise InputError(
            f"run {run}: rolling speed and rotation were not measured at the same time for two revolutions."
        )
    path = np.interp(moments[within], times, rotation)
    ratio = float(speed[within].mean() / path.mean())
    noise = speed[within] - ratio * path
    sd = float(noise.std(ddof=1))
    mean = float(path.mean())
    own = float(np.sqrt(np.nanmean(rotation_se[inside] ** 2) / np.count_nonzero(inside)))
    return SpeedPoint(run, mean, own, float(speed[within].mean()), sd / math.sqrt(effective_size(noise)))


def expected_radius(diameter: float) -> float:
    """Return Re of a tire of nominal `diameter` (m) by ETRTO's rolling circumference, m.

    Examples
    --------
    >>> round(expected_radius(0.6532), 4)
    0.3171
    """
    return _ROLLING * diameter / (2.0 * math.pi)


def speed_line(points: Sequence[SpeedPoint], diameter: float | None = None) -> SpeedLine:
    """Fit V = Re Omega through the origin with errors in both, and test an intercept.

    Parameters
    ----------
    points
        One a run.
    diameter
        Nominal diameter of the tire, m: what Re is compared with.

    Raises
    ------
    InputError
        If no run rolls, or a speed is negative.

    Notes
    -----
    Effective variance sd_V^2 + Re^2 sd_Omega^2; the covariance is scaled with the runs' scatter where that is larger.
    """
    used, left_out = _rolling(points)
    if not used:
        reasons = "; ".join(f"{name}: {why}" for name, why in left_out.items()) or "there are no runs"
        raise InputError(f"the rolling radius needs a run with rotation and rolling speed ({reasons}).")
    W, V = np.array([p.rotation for p in used]), np.array([p.speed for p in used])
    se_W, se_V = np.array([p.rotation_se for p in used]), np.array([p.speed_se for p in used])
    Re = float(np.median(V / W))
    for _ in range(3):
        # A floor far below what matters, for logs without noise.
        sd = np.sqrt(se_V**2 + (Re * se_W) ** 2 + (1e-7 * V) ** 2)
        Re = float((W * V / sd**2).sum() / (W**2 / sd**2).sum())
    residual = V - Re * W
    dof = len(used) - 1
    chi2 = float((residual**2 / sd**2).sum())
    reduced = chi2 / dof if dof else math.nan
    se = math.sqrt(max(reduced, 1.0) if dof else 1.0) / math.sqrt(float((W**2 / sd**2).sum()))
    speeds = _distinct(W)
    intercept, intercept_se, p_value = _intercept(W, V, sd, speeds)
    expected = None if diameter is None else expected_radius(diameter)
    suspicion = suspected(Re, expected)
    total = math.hypot(se, CLOCKS_U * Re)
    scattered = dof > 0 and reduced > 1.0
    # With scatter the interval is Student's on it; the clocks' part has no scatter of its own.
    freedom = dof * (total / se) ** 4 if scattered else math.inf
    radius = estimate("rolling_radius", Re, total, dof=freedom)
    return SpeedLine(
        radius=radius,
        points=tuple(used),
        residuals=residual,
        ratios=V / W,
        intercept=intercept,
        intercept_se=intercept_se,
        p_value=p_value,
        chi2_reduced=reduced,
        speeds=speeds,
        expected=expected,
        left_out=left_out,
        suspicion=suspicion,
        statement=_said(Re, total, (intercept, intercept_se, p_value), len(used), speeds, suspicion),
    )


def _rolling(points: Sequence[SpeedPoint]) -> tuple[list[SpeedPoint], dict[str, str]]:
    used, left_out = [], {}
    for point in points:
        if not (math.isfinite(point.rotation) and point.rotation > 0.0):
            left_out[point.run] = "no rotation"
        elif not (math.isfinite(point.speed) and abs(point.speed) > 0.0):
            left_out[point.run] = "no rolling speed"
        elif point.speed < 0.0:
            left_out[point.run] = f"its rolling speed is {point.speed:.3g} m/s: against the sense of rotation"
        else:
            used.append(point)
    return used, left_out


def suspected(Re: float, expected: float | None) -> str:
    """Return what a rolling radius so far from the expected one looks like; empty where it is near."""
    if expected is None:
        near, known, about = _USUAL[0] <= Re <= _USUAL[1], math.sqrt(_USUAL[0] * _USUAL[1]), math.log(1.35)
        range_said = f"{_USUAL[0]:.2f} to {_USUAL[1]:.2f} m for a car's tire"
    else:
        near, known, about = abs(Re / expected - 1.0) <= _TOLERANCE, expected, math.log1p(_TOLERANCE)
        range_said = f"{expected:.4f} m +-{_TOLERANCE:.0%} by the tire's size"
    if near:
        return ""
    found = f"V/Omega = {Re:.4g} m, expected {range_said}"
    fitting = [(abs(math.log(Re / (factor * known))), what) for factor, what in _SUSPECTS]
    fitting += [(abs(math.log(Re / ratio)), what) for ratio, what in _ROTATIONS if abs(math.log(Re / ratio)) < 0.01]
    off, what = min(fitting)
    if off > about:
        return f"{found}: no unit explains it; look at the tire's size and at what the speed channel measures"
    return f"{found}: {what}"


def _distinct(rotation: np.ndarray) -> int:
    ordered = np.sort(rotation)
    count, last = 1, ordered[0]
    for value in ordered[1:]:
        if value > 1.1 * last:
            count, last = count + 1, value
    return count


def _intercept(W: np.ndarray, V: np.ndarray, sd: np.ndarray, speeds: int) -> tuple[float, float, float]:
    """Return the intercept, its standard error and the p-value of none (F-test; with two runs from their own errors)."""
    if speeds < 2:
        return math.nan, math.nan, math.nan
    A = np.stack([W, np.ones(W.size)], axis=1) / sd[:, None]
    (slope, level), *_ = np.linalg.lstsq(A, V / sd, rcond=None)
    inverse = np.linalg.inv(A.T @ A)
    dof = W.size - 2
    left = (V - slope * W - level) / sd
    variance = max(float(left @ left) / dof, 1.0) if dof > 0 else 1.0
    se = math.sqrt(variance * inverse[1, 1])
    from scipy.special import fdtrc

    F = (float(level) / se) ** 2
    p = float(fdtrc(1, dof, F)) if dof > 0 else math.erfc(math.sqrt(0.5 * F))
    return float(level), se, p


def _said(
    radius: float, radius_se: float, test: tuple[float, float, float], runs: int, speeds: int, suspicion: str
) -> str:
    if suspicion:
        return suspicion[0].upper() + suspicion[1:] + "."
    said = f"Re = {radius:.5f} +- {1.96 * radius_se:.5f} m (95 %) from {runs} run{'s' * (runs > 1)}"
    level, se, p = test
    if speeds < 2:
        return f"{said} at one speed: whether the line passes through the origin cannot be tested."
    limits = f"{1e3 * level:.2f} +- {1.96e3 * se:.2f} mm/s"
    if p < _SIGNIFICANT:
        return (
            f"{said}, but the line misses the origin by {limits} (as much by chance: {chance(p)}): look for an offset of the speed channel, "
            "or slip that depends on speed."
        )
    return f"{said}; the line passes through the origin (intercept {limits})."


__all__ = ["SpeedLine", "SpeedPoint", "expected_radius", "speed_line", "speed_point", "suspected"]
