"""Peak-load calibration: which runs go in, what it tells, and what is wrong with the loads (tire.md, 5.7).

All in R2: the divider bends the curve in volts. The polynomial and its inversion are in `calibration_curve`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.rigs.tire.bench.calibration_curve import Curve, LoadReading, fitted
from pipeline.rigs.tire.ring.sensor import voltage_slope

NAMES = ("calibration_0", "calibration_1", "calibration_2")
# Loads closer than this are repeats of one; speeds closer than this are one speed.
_SAME_LOAD = 0.05
_SAME_SPEED = 0.1
_FEWEST_LOADS = 3
_FEWEST_QUADRATIC = 4
_SIGNIFICANT = 0.01
# The curve misses more than runs differ; d ln(peak)/d ln(pressure) (tire.md, 3.5).
_MISSES, _BY_PRESSURE = 0.05, -0.59
# Up against down, over the load at mid-range; load without a peak, over the same.
_MOST_HYSTERESIS = 0.02
_MOST_OFFSET = 0.08


@dataclass(frozen=True)
class PeakPoint:
    """One run: loads in N, peaks (less the mean of the turn) in ohm.

    Attributes
    ----------
    load, load_se, peak, peak_se
        Means over the run and their standard errors.
    nominal_load, speed
        As set, N and m/s.
    revolution_sd
        Scatter of single revolutions' peaks; 0 where it is not known.
    direction
        +1 where the load was reached from below, -1 from above, 0 where that is not known.
    """

    run: str
    load: float
    load_se: float
    peak: float
    peak_se: float
    nominal_load: float
    speed: float
    revolution_sd: float = 0.0
    direction: int = 0


@dataclass(frozen=True)
class Repeat:
    """How well runs repeat, told by all of their waveforms (relative standard deviations), and degrees of freedom of that."""

    load: float
    gain: float
    pressure: float
    dof: int


@dataclass(frozen=True)
class LackOfFit:
    """F-test of the curve against repeats (or, without them, the averages' own errors), and its size as a load (rms, N)."""

    F: float
    p_value: float
    size: float
    against: str

    @property
    def found(self) -> bool:
        """Tell whether the curve misses more than scatter."""
        return self.p_value < _SIGNIFICANT


@dataclass(frozen=True, eq=False)
class Calibration:
    """The curve, what is told of it, and what its loads look like.

    Attributes
    ----------
    curve
        None where there are too few loads; `reason` tells it.
    estimates
        calibration_0..2 and load_sensitivity by name, each with a value or a reason.
    points, residuals
        Runs on the curve and their peaks less it, ohm; `left_out` has the others with the reason.
    friction
        Guide friction by loading up and down, N, or None without runs of both directions.
    zero_load
        Load (N) at which the curve has no peak: the load cell's offset; None where it cannot be told.
    remarks
        Sentences on lack of fit, friction, offset and the number of loads.
    """

    curve: Curve | None
    reason: str
    estimates: dict[str, Estimate]
    points: tuple[PeakPoint, ...]
    residuals: np.ndarray
    left_out: dict[str, str]
    lack_of_fit: LackOfFit | None = None
    friction: Estimate | None = None
    zero_load: Estimate | None = None
    remarks: tuple[str, ...] = field(default=())

    @property
    def offset(self) -> float | None:
        """Load (N) at which the curve has no peak, where that is surely far from none: the load cell's error."""
        return _offset(self.curve, self.zero_load) if self.curve is not None else None

    def load_of(self, peak: float, revolutions: float = 1.0) -> LoadReading:
        """Return the load of a peak (ohm), mean of `revolutions`; all of it unknown where there is no curve."""
        if self.curve is None:
            return LoadReading(math.nan, -math.inf, math.inf, True)
        return self.curve.load_of(peak, revolutions)


def calibrate(
    points: Sequence[PeakPoint],
    R0: float,
    VIN: float,
    R1: float,
    *,
    load_gain_u: float = 0.005,
    mass: float | None = None,
    repeat: Repeat | None = None,
) -> Calibration:
    """Regress peaks on loads and tell what the curve is good for.

    Parameters
    ----------
    points
        One a run. The speed with most loads is calibrated; runs at other speeds are left out, the sensor's lag lowers
        their peaks.
    R0
        Resistance of the sensor on the undeformed tire, ohm.
    VIN, R1
        Supply (V) and fixed resistor (ohm) of the divider, for the sensitivity in V/N.
    load_gain_u
        Relative standard uncertainty of the load cell's gain.
    mass
        Of beam and axle, kg, where known: what an offset is compared with.
    repeat
        Five points leave a parabola two degrees of freedom: by chance they lie on it far better than runs repeat. What the
        waveforms of all runs tell of that is pooled with it, unless the curve misses by more, or fewer than six runs tell it.
    """
    used, left_out = _at_one_speed(points)
    groups = _groups(used)
    count = len(set(groups))
    if count < _FEWEST_LOADS:
        reason = (
            f"a calibration needs at least three loads at one speed, better five; there {'is' if count == 1 else 'are'} "
            f"{count or 'none'}."
        )
        return _without(reason, used, left_out)
    F, y = np.array([p.load for p in used]), np.array([p.peak for p in used])
    degree = 2 if count >= _FEWEST_QUADRATIC else 1
    friction, F = _friction(used, F, y, degree)
    coefficients, covariance, residual = fitted(F, y, degree)
    dof = len(used) - degree - 1 - (friction is not None)
    way = np.array([p.direction for p in used], dtype=float)
    slopes = coefficients[1] + 2.0 * coefficients[2] * F
    if slopes.min() <= 0.0:
        reason = (
            f"the peak does not rise with the load everywhere between {F.min():.0f} and {F.max():.0f} N; look at loads, "
            "polarity and bond of the sensor."
        )
        return _without(reason, used, left_out)
    own = np.mean([p.peak_se**2 + (s * p.load_se) ** 2 for p, s in zip(used, slopes, strict=True)])
    variance, dof = _pooled(float(residual @ residual) / dof, dof, float(own), F, y, slopes, repeat)
    scatter = math.sqrt(max(variance, 1e-12 * float(y @ y) / y.size))
    curve = Curve(
        coefficients,
        scatter**2 * covariance + _of_friction(friction, F, y, way, degree),
        degree,
        dof,
        scatter,
        float(np.sqrt(np.mean([p.revolution_sd**2 for p in used]))),
        float(F.min()),
        float(F.max()),
        load_gain_u,
    )
    lack = _lack_of_fit(residual, groups, degree, float(own), float(slopes.mean()))
    zero = _zero_load(curve)
    return Calibration(
        curve,
        "",
        _estimates(curve, R0, VIN, R1),
        tuple(used),
        residual,
        left_out,
        lack,
        friction,
        zero,
        _remarks(curve, count, lack, friction, zero, mass),
    )


def _pooled(
    left: float, dof: int, own: float, F: np.ndarray, y: np.ndarray, slopes: np.ndarray, repeat: Repeat | None
) -> tuple[float, int]:
    """Return the variance of a run's peak about the curve, ohm^2, and its degrees of freedom."""
    from scipy.special import fdtrc

    if repeat is None or repeat.dof <= 2:
        return left, dof
    # `run_scatter` tells the mean of the square over all that is likely, nu/(nu - 2) of what nu degrees of freedom estimate:
    # it holds the doubt that Student's t holds as well.
    told = own + (repeat.dof - 2) / repeat.dof * float(
        np.mean((repeat.load * slopes * F) ** 2 + (repeat.gain**2 + (_BY_PRESSURE * repeat.pressure) ** 2) * y**2)
    )
    if told <= 0.0 or fdtrc(dof, repeat.dof, left / told) < _MISSES:
        return left, dof
    return (dof * left + repeat.dof * told) / (dof + repeat.dof), dof + repeat.dof


def _at_one_speed(points: Sequence[PeakPoint]) -> tuple[list[PeakPoint], dict[str, str]]:
    left_out: dict[str, str] = {}
    rolling = []
    for p in points:
        if not (math.isfinite(p.load) and math.isfinite(p.peak) and p.load > 0.0):
            left_out[p.run] = f"its load is {p.load:.4g} N, its peak {p.peak:.4g} ohm"
        else:
            rolling.append(p)
    best: list[PeakPoint] = []
    for p in rolling:
        near = [q for q in rolling if abs(q.speed - p.speed) <= _SAME_SPEED * p.speed]
        if (len(set(_groups(near))), len(near)) > (len(set(_groups(best))), len(best)):
            best = near
    for p in rolling:
        if p not in best:
            left_out[p.run] = f"rolled at {p.speed:.3g} m/s, the calibration is made at {best[0].speed:.3g} m/s"
    return best, left_out


def _groups(points: Sequence[PeakPoint]) -> list[int]:
    """Return which load each run repeats, 0, 1, ... by rising load."""
    order = sorted(range(len(points)), key=lambda i: points[i].nominal_load)
    member, first, group = [0] * len(points), -math.inf, -1
    for i in order:
        if points[i].nominal_load > first * (1.0 + _SAME_LOAD) or group < 0:
            group, first = group + 1, points[i].nominal_load
        member[i] = group
    return member


def _friction(
    points: Sequence[PeakPoint], F: np.ndarray, y: np.ndarray, degree: int
) -> tuple[Estimate | None, np.ndarray]:
    """Return the friction h by which the cell reads more on the way up and less on the way down, and the loads without it.

    Peak = f(load - direction h), h along with the curve.
    """
    way = np.array([p.direction for p in points], dtype=float)
    if not ((way > 0).any() and (way < 0).any()) or F.size < degree + 3:
        return None, F
    h, h_se, dof = 0.0, 0.0, F.size - degree - 2
    for _ in range(4):
        coefficients, _, _ = fitted(F - way * h, y, degree)
        slope = coefficients[1] + 2.0 * coefficients[2] * (F - way * h)
        u = (F - F.mean()) / np.ptp(F)
        A = np.column_stack([*[u**k for k in range(degree + 1)], -way * slope])
        solution, *_ = np.linalg.lstsq(A, y, rcond=None)
        left = y - A @ solution
        h = float(solution[-1])
        h_se = math.sqrt(float(left @ left) / dof * np.linalg.inv(A.T @ A)[-1, -1])
    return estimate("guide_friction", h, h_se, dof=dof), F - way * h


def _of_friction(friction: Estimate | None, F: np.ndarray, y: np.ndarray, way: np.ndarray, degree: int) -> np.ndarray:
    """Return what the friction's error adds to the covariance of the coefficients, (3, 3)."""
    if friction is None or not friction.std_error:
        return np.zeros((3, 3))
    moved = fitted(F - way * friction.std_error, y, degree)[0] - fitted(F, y, degree)[0]
    return np.outer(moved, moved)


def _lack_of_fit(
    residual: np.ndarray, groups: Sequence[int], degree: int, own: float, slope: float
) -> LackOfFit | None:
    from scipy.special import fdtrc

    labels = np.array(groups)
    means = np.array([residual[labels == g].mean() for g in sorted(set(groups))])
    counts = np.array([np.count_nonzero(labels == g) for g in sorted(set(groups))])
    dof = means.size - degree - 1
    repeats = residual.size - means.size
    if dof < 1:
        return None
    missed = float((counts * means**2).sum()) / dof
    size = math.sqrt(float(np.mean(residual**2))) / slope
    if repeats >= 2:
        pure = max(
            float(sum(((residual[labels == g] - means[i]) ** 2).sum() for i, g in enumerate(sorted(set(groups)))))
            / repeats,
            own,
        )
        F = missed / pure
        return LackOfFit(F, float(fdtrc(dof, repeats, F)), size, f"{repeats} repeats")
    if own <= 0.0:
        return None
    F = missed / own
    return LackOfFit(F, float(fdtrc(dof, 1e6, F)), size, "the averages' own standard errors")


def _zero_load(curve: Curve) -> Estimate | None:
    """Return the load at which the curve goes through zero, with the error of its extrapolation."""
    c0, c1, c2 = curve.coefficients
    root = c1 * c1 - 4.0 * c0 * c2
    if root <= 0.0:
        return None
    load = -2.0 * c0 / (c1 + math.sqrt(root))
    slope = float(curve.slope(load))
    return estimate("zero_load", load, float(curve.std_error(load)) / slope, dof=curve.dof) if slope > 0.0 else None


def _estimates(curve: Curve, R0: float, VIN: float, R1: float) -> dict[str, Estimate]:
    found: dict[str, Estimate] = {}
    for k, name in enumerate(NAMES):
        if curve.degree < len(NAMES) - 1:
            found[name] = undetermined(
                name,
                "three loads tell a straight line only, and its slope is the mean over the loads, not that at no load: the peak over load is a bent "
                "curve. Measure at least four, better five.",
            )
            continue
        gain = k * curve.load_gain_u * curve.coefficients[k]
        se = math.hypot(math.sqrt(curve.covariance[k, k]), float(gain))
        found[name] = _wide(name, float(curve.coefficients[k]), math.sqrt(curve.covariance[k, k]), se, curve.dof)
    middle = 0.5 * (curve.least + curve.most)
    factor = float(voltage_slope(R0 + curve.at(middle), VIN, R1))
    slope, slope_se = float(curve.slope(middle)), curve.slope_se(middle)
    # The slope of the divider moves a little with the level at mid-range; that is second to the slope's own error.
    scatter = factor * slope_se
    value = factor * slope
    found["load_sensitivity"] = _wide(
        "load_sensitivity", value, scatter, math.hypot(scatter, curve.load_gain_u * value), curve.dof
    )
    return found


def _wide(name: str, value: float, scatter: float, total: float, dof: int) -> Estimate:
    """Return an estimate whose scatter has few degrees of freedom and whose common part has none (Welch-Satterthwaite)."""
    return estimate(name, value, total, dof=dof * (total / scatter) ** 4 if scatter > 0.0 else math.inf)


def _remarks(
    curve: Curve,
    count: int,
    lack: LackOfFit | None,
    friction: Estimate | None,
    zero: Estimate | None,
    mass: float | None,
) -> tuple[str, ...]:
    middle = 0.5 * (curve.least + curve.most)
    said = []
    if count < 5:
        reading = curve.load_of(float(curve.at(middle)), math.inf)
        said.append(
            f"The calibration rests on {count} loads ({curve.dof} degree{'s' * (curve.dof != 1)} of freedom); a load at "
            f"mid-range is known to +-{0.5 * (reading.high - reading.low):.0f} N. Five loads or more are advised."
        )
    if lack is not None and lack.found:
        said.append(
            f"The peaks miss a {'parabola' if curve.degree == 2 else 'straight line'} by {lack.size:.1f} N rms, more than "
            f"{lack.against} explain (p = {lack.p_value:.2g}); the intervals hold that."
        )
    if friction is not None and friction.value is not None and friction.ci95 is not None:
        share = 2.0 * abs(friction.value) / middle
        if share > _MOST_HYSTERESIS and not friction.ci95[0] <= 0.0 <= friction.ci95[1]:
            said.append(
                f"Loading up and down differ by {share:.1%} of the load: guide friction about {abs(friction.value):.0f} N "
                "between load cell and tire; the calibration uses loads freed of it."
            )
    offset = _offset(curve, zero)
    if offset is not None:
        weight = f"; the moving mass weighs {mass * 9.80665:.0f} N" if mass else ""
        said.append(
            f"The curve has no peak at {offset:.0f} N instead of 0 N: the load cell seems off by that "
            f"(weight of beam and axle not tared?){weight}."
        )
    return tuple(said)


def _offset(curve: Curve, zero: Estimate | None) -> float | None:
    if zero is None or zero.value is None or zero.ci95 is None or zero.ci95[0] <= 0.0 <= zero.ci95[1]:
        return None
    return zero.value if abs(zero.value) > _MOST_OFFSET * 0.5 * (curve.least + curve.most) else None


def _without(reason: str, used: Sequence[PeakPoint], left_out: dict[str, str]) -> Calibration:
    names = (*NAMES, "load_sensitivity")
    return Calibration(
        None, reason, {n: undetermined(n, reason) for n in names}, tuple(used), np.full(len(used), np.nan), left_out
    )
