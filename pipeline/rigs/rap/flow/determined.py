"""What a set of calibration windows can determine, and why not: no estimator is calibrated on what cannot tell it (rap.md, 5.3, 5.9)."""

from __future__ import annotations

import numpy as np

from pipeline.errors import counted
from pipeline.rigs.rap.flow.calibration import ONE_SPEED, speeds_of
from pipeline.rigs.rap.flow.windows import FlowWindows

# The pulsation (E2) or the back pressure (E3) must vary by that share: E2's at a set speed, E3's at all.
_VARIED = 0.08
_VOLUME, _ADMITTANCE, _COMPLIANCE = (0.3e-6, 1.5e-6), (0.0, 5e-9), (0.0, 1e-10)
BOUNDS = {
    "stroke_volume": _VOLUME,
    "y0": _ADMITTANCE,
    "y1": (-5e-9, 5e-9),
    "stroke_volume_mean": _VOLUME,
    "pump_compliance": _COMPLIANCE,
}
_READ = {
    "stroke_volume": (1e6, "mL"),
    "stroke_volume_mean": (1e6, "mL"),
    "y0": (1.0, "m3/(s Pa)"),
    "y1": (1.0, "m3/Pa"),
    "pump_compliance": (1.0, "m3/Pa"),
}
CLAMP_ADVICE = (
    "Repeat each set-point with the access line clamped to about 2, 4 and 6 times its resistance (60 s each), and keep other clamp "
    "settings for the hold-out."
)


def at_one_speed(windows: FlowWindows, values: np.ndarray) -> float:
    """Return how much `values` (w,) varies between operating points of one speed, as a share: the second largest of the speeds."""
    points = windows.point
    means = [(windows.f[points == p].mean(), float(np.nanmean(values[points == p]))) for p in np.unique(points)]
    means.sort()
    groups: list[list[float]] = []
    last = -1.0
    for f, value in means:
        if not groups or f > last * (1.0 + ONE_SPEED):
            groups.append([])
        groups[-1].append(value)
        last = f
    varied = sorted((max(g) / min(g) - 1.0 for g in groups if min(g) > 0.0), reverse=True)
    return varied[1] if len(varied) > 1 else (varied[0] if varied else 0.0)


def why_not_pulsation(windows: FlowWindows) -> str:
    """Return why E2 cannot be calibrated on these windows; '' where it can."""
    if not windows.size:
        return "no calibration window has a pre-filter pulsation and a blood flow of the meter"
    speeds, points = speeds_of(windows), np.unique(windows.point).size
    if at_one_speed(windows, windows.A_1) < _VARIED:
        return (
            f"{counted(points, 'operating point')} at {counted(speeds, 'speed')}, none of them clamped: the pulsation says nothing there that the "
            "speed does not, so three coefficients are fitted to three points. Such a fit is right to 1 % on its own set-points and wrong "
            "by up to half when the access line narrows"
        )
    if speeds < 2:
        return "all windows are at one speed of the pump: y0 and y1 cannot be told apart"
    if points < 4:
        return f"{counted(points, 'operating point')} for three coefficients: their scatter cannot be told"
    return ""


def why_not_pressure(windows: FlowWindows) -> str:
    """Return why E3 cannot be calibrated on these windows; '' where it can."""
    if not windows.size:
        return "no calibration window has pre-filter and access pressure and a blood flow of the meter"
    points = np.unique(windows.point).size
    low, high = float(np.min(windows.back_pressure)), float(np.max(windows.back_pressure))
    if points < 3:
        return f"{counted(points, 'operating point')} for two coefficients: their scatter cannot be told"
    if high - low < _VARIED * max(abs(low), abs(high)):
        return "the back pressure is the same in all windows: volume and compliance of the pump cannot be told apart"
    return ""


def unphysical(names: tuple[str, ...], values: np.ndarray) -> str:
    """Return which coefficient comes out where no pump can be; '' where none does."""
    for name, value in zip(names, values, strict=True):
        low, high = BOUNDS.get(name, (-np.inf, np.inf))
        if not low < value < high:
            scale, unit = _READ[name]
            return (
                f"{name} comes out as {scale * value:.3g} {unit}, where {scale * low:.3g} to {scale * high:.3g} can be: the data contradict the law "
                "(frequency of the rotor and not of the rollers, a unit of flow, exchanged or inverted pressures)"
            )
    return ""
