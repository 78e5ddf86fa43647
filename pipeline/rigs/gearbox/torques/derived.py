"""What follows from nominal and peak torques of one run: relief, excess, efficiency, heat, lock and slip torque (gearbox.md, 3.4, 4.2, 5.4).

A zero offset is common to all torques of one sensor: it cancels in differences and not in ratios.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.rigs.gearbox.torques.nominal import Level
from pipeline.rigs.gearbox.torques.peaks import Peak

# What is left of the low-pass's overshoot where the lock breaks, N m of each N m that the torque rises.
_OVERSHOOT = 0.001
# Share of its speed that a drive without slip compensation may lose under load.
_DROOP = 0.3
NO_OFFSET = "the zero offsets are unknown: the run has no standstill"


@dataclass(frozen=True)
class Torque:
    """A torque of one sensor, N m.

    Attributes
    ----------
    value
        As it is told.
    own, zero
        Its own error (noise, ripple) and that of the sensor's zero, which is common to all its torques.
    dof
        Degrees of freedom.
    bias
        What noise adds to a maximum on average: not taken off the value, but off the middle of its interval.
    """

    value: float
    own: float
    zero: float
    dof: float
    bias: float = 0.0

    @classmethod
    def of_level(cls, level: Level | None, zero: float) -> Torque | None:
        """Return a nominal torque; `zero` is the standard error of the zero offset, NaN where it is unknown."""
        return None if level is None else cls(level.value, level.own_error, zero, level.dof)

    @classmethod
    def of_peak(cls, peak: Peak | None, zero: float, unbiased: bool = False) -> Torque | None:
        """Return a peak torque, as read or without what noise adds to a maximum on average (`unbiased`)."""
        if peak is None:
            return None
        known = 0.0 if math.isnan(zero) else zero
        noise = math.sqrt(max(peak.std_error**2 - known**2, 0.0))
        if unbiased:
            return cls(peak.value - peak.bias, noise, zero, peak.dof)
        return cls(peak.value, noise, zero, peak.dof, peak.bias)

    @property
    def std_error(self) -> float:
        """Error of the value, the zero offset's included; NaN where that is unknown."""
        return math.hypot(self.own, self.zero)


def welch(parts: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the error of a sum and its degrees of freedom (Welch-Satterthwaite) from (error, dof) of the parts.

    Examples
    --------
    >>> welch([(3.0, 4.0), (4.0, 4.0)])[0]
    5.0
    """
    total = math.sqrt(sum(error**2 for error, _ in parts))
    spread = sum(error**4 / dof for error, dof in parts if error > 0)
    return total, total**4 / spread if spread > 0 else math.inf


def difference(name: str, upper: Torque | None, lower: Torque | None, missing: str) -> Estimate:
    """Return upper less lower of one sensor: its zero offset cancels."""
    if upper is None or lower is None:
        return undetermined(name, missing)
    error, dof = welch([(upper.own, upper.dof), (lower.own, lower.dof)])
    return _estimate(name, upper.value - lower.value, upper.bias - lower.bias, error, dof)


def _estimate(name: str, value: float, bias: float, error: float, dof: float) -> Estimate:
    """Return an estimate whose value is as defined and whose interval allows for what the peaks are biased by."""
    return replace(estimate(name, value - bias, error, dof=dof), value=value)


def share(name: str, part: Torque | None, whole: Torque | None, missing: str, residual: bool) -> Estimate:
    """Return part/whole of one sensor (`residual`), or one less it (relief)."""
    if part is None or whole is None:
        return undetermined(name, missing)
    if math.isnan(part.zero):
        return undetermined(name, NO_OFFSET)
    if not whole.value > 0:
        return undetermined(name, "the peak is not positive")
    ratio = part.value / whole.value
    common = part.zero * (1.0 - ratio) / whole.value
    error, dof = welch(
        [(part.own / whole.value, part.dof), (ratio * whole.own / whole.value, whole.dof), (common, part.dof)]
    )
    lifted = (part.bias - ratio * whole.bias) / whole.value
    if residual:
        return _estimate(name, ratio, lifted, error, dof)
    return _estimate(name, 1.0 - ratio, -lifted, error, dof)


def ratio(name: str, output: Torque | None, source: Torque | None, missing: str) -> Estimate:
    """Return the torque of the output sensor over that of the input sensor."""
    if output is None or source is None:
        return undetermined(name, missing)
    if math.isnan(output.zero) or math.isnan(source.zero):
        return undetermined(name, NO_OFFSET)
    if not source.value > 0:
        return undetermined(name, "the input torque is not positive")
    value = output.value / source.value
    error, dof = welch(
        [(output.std_error / source.value, output.dof), (value * source.std_error / source.value, source.dof)]
    )
    return estimate(name, value, error, dof=dof)


def power(name: str, torque: Torque | None, speed: float, speed_sd: float, missing: str) -> Estimate:
    """Return torque times speed, W."""
    if torque is None or not math.isfinite(speed):
        return undetermined(name, missing)
    if math.isnan(torque.zero):
        return undetermined(name, NO_OFFSET)
    error, dof = welch([(torque.std_error * speed, torque.dof), (torque.value * speed_sd, math.inf)])
    return estimate(name, torque.value * speed, error, dof=dof)


def power_assumed(name: str, torque: Torque | None, speed: float, missing: str) -> Estimate:
    """Return torque times a speed that nobody measured, W: an upper limit, and how far below it the truth may lie.

    A drive without slip compensation loses up to tens of percent of its speed under load (gearbox.md, 4.4) and
    does not gain any: the interval goes from 0.7 of the speed to the whole of it, the torque's own added.
    """
    full = power(name, torque, speed, 0.0, missing)
    if full.value is None or full.ci95 is None:
        return full
    low, high = full.ci95
    error = math.hypot(full.std_error or 0.0, _DROOP * full.value / math.sqrt(12.0))
    return Estimate(name, full.value, error, ((1.0 - _DROOP) * low, high), dof=full.dof)


@dataclass(frozen=True)
class Slope:
    """Slope a of output over input torque with its error and degrees of freedom."""

    value: float
    std_error: float
    dof: float


def drag_locked(fos_in: Torque | None, fos_out: Torque | None, slope: Slope | None) -> Estimate:
    """Return T_0 = T_in - T_out/a of the locked gearbox, N m."""
    name = "drag_locked"
    if fos_in is None or fos_out is None:
        return undetermined(name, "there is no settled FOS")
    if slope is None:
        return undetermined(name, "the slope a of the torque map is not known")
    if math.isnan(fos_in.zero) or math.isnan(fos_out.zero):
        return undetermined(name, NO_OFFSET)
    error, dof = welch([(fos_in.std_error, fos_in.dof), *_reaction(fos_out, slope)])
    return estimate(name, fos_in.value - fos_out.value / slope.value, error, dof=dof)


def lock_torque(
    peak: Torque | None,
    fos_in: Torque | None,
    fos_out: Torque | None,
    slope: Slope | None,
    drag: tuple[float, float] = (0.0, 0.0),
) -> Estimate:
    """Return T_in - T_0 at the brake peak; where T_0 is unknown the limits are told.

    `drag` is how much T_0 grows from FOS to the lower speed at which the lock breaks, N m, and its standard error.
    """
    name = "lock_torque"
    if peak is None:
        return undetermined(name, "the lock was not broken by the brake")
    reason = _no_drag(peak, fos_in, fos_out, slope)
    if reason or fos_in is None or fos_out is None or slope is None:
        return undetermined(name, reason)
    value = peak.value - fos_in.value + fos_out.value / slope.value - drag[0]
    edge = (math.hypot(_OVERSHOOT * (peak.value - fos_in.value), drag[1]), math.inf)
    error, dof = welch([(peak.own, peak.dof), (fos_in.own, fos_in.dof), edge, *_reaction(fos_out, slope)])
    return estimate(name, value, error, dof=dof)


def slip_torque(
    sos_in: Torque | None, sos_out: Torque | None, fos_in: Torque | None, fos_out: Torque | None, slope: Slope | None
) -> Estimate:
    """Return T_out/a with the output held (eq. C at rest): it needs no drag, which slipping may change."""
    name = "slip_torque"
    if sos_out is None:
        return undetermined(name, "there is no settled SOS")
    if slope is None or math.isnan(sos_out.zero):
        why = _no_drag(sos_in, fos_in, fos_out, slope) if sos_in is not None else ""
        return undetermined(name, why or NO_OFFSET)
    error, dof = welch(_reaction(sos_out, slope))
    return estimate(name, sos_out.value / slope.value, error, dof=dof)


def _no_drag(upper: Torque, fos_in: Torque | None, fos_out: Torque | None, slope: Slope | None) -> str:
    """Say why T_0 is unknown, and between what limits the torque on the lock lies then."""
    if fos_in is None or fos_out is None:
        return "there is no settled FOS, so the drag T_0 is unknown"
    if slope is not None and not math.isnan(fos_out.zero):
        return ""
    why = "the slope a of the torque map is not known" if slope is None else NO_OFFSET
    low = upper.value - (fos_in.value - fos_out.value)
    return (
        f"{why}; the drag T_0 lies between none and all of T_in - T_out in FOS, so the torque lies between {low:.3f} and "
        f"{upper.value:.3f} N m"
    )


def _reaction(fos_out: Torque, slope: Slope) -> list[tuple[float, float]]:
    """Return the errors of T_out/a with their degrees of freedom."""
    return [
        (fos_out.std_error / slope.value, fos_out.dof),
        (fos_out.value / slope.value**2 * slope.std_error, slope.dof),
    ]
