"""Peak-load calibration: the curve of the runs of one speed, and what it tells (tire.md, 5.7).

All in R2: the divider bends the curve in volts. The polynomial and its inversion are in `calibration_curve`, the runs in
`calibration_points`, their scatter in `calibration_scatter`, what is wrong with the loads in `calibration_loads`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.rigs.tire.bench.calibration_curve import Curve, LoadReading, fitted
from pipeline.rigs.tire.bench.calibration_loads import covariance_by_friction, friction_of, offset_of, zero_load_of
from pipeline.rigs.tire.bench.calibration_points import PeakPoint, at_one_speed, groups_of
from pipeline.rigs.tire.bench.calibration_remarks import remarks_on
from pipeline.rigs.tire.bench.calibration_scatter import LackOfFit, Repeat, lack_of_fit, pooled
from pipeline.rigs.tire.ring.sensor import voltage_slope

NAMES = ("calibration_0", "calibration_1", "calibration_2")
_FEWEST_LOADS = 3
_FEWEST_QUADRATIC = 4


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
        return offset_of(self.curve, self.zero_load) if self.curve is not None else None

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
    used, left_out = at_one_speed(points)
    groups = groups_of(used)
    count = len(set(groups))
    if count < _FEWEST_LOADS:
        reason = (
            f"a calibration needs at least three loads at one speed, better five; there {'is' if count == 1 else 'are'} "
            f"{count or 'none'}."
        )
        return _without(reason, used, left_out)
    F, y = np.array([p.load for p in used]), np.array([p.peak for p in used])
    degree = 2 if count >= _FEWEST_QUADRATIC else 1
    friction, F = friction_of(used, F, y, degree)
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
    variance, dof = pooled(float(residual @ residual) / dof, dof, float(own), F, y, slopes, repeat)
    scatter = math.sqrt(max(variance, 1e-12 * float(y @ y) / y.size))
    curve = Curve(
        coefficients,
        scatter**2 * covariance + covariance_by_friction(friction, F, y, way, degree),
        degree,
        dof,
        scatter,
        float(np.sqrt(np.mean([p.revolution_sd**2 for p in used]))),
        float(F.min()),
        float(F.max()),
        load_gain_u,
    )
    lack = lack_of_fit(residual, groups, degree, float(own), float(slopes.mean()))
    zero = zero_load_of(curve)
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
        remarks_on(curve, count, lack, friction, zero, mass),
    )


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


def _without(reason: str, used: Sequence[PeakPoint], left_out: dict[str, str]) -> Calibration:
    names = (*NAMES, "load_sensitivity")
    return Calibration(
        None, reason, {n: undetermined(n, reason) for n in names}, tuple(used), np.full(len(used), np.nan), left_out
    )
