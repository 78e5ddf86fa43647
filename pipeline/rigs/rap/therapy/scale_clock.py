"""How the scale's clock stands to the device's, from starts and stops of the filling that both show (rap.md, 5.6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.estimation.uncertainty import effective_size
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.therapy.scale_record import Weighed
from pipeline.rigs.rap.therapy.tank_filter import TankCourse

SEARCH = 60.0
"""How far the two clocks may stand apart, s."""
_CLOCK_SURE = 5.0
# Readings that count around a start or stop, s.
_AROUND = 600.0


@dataclass(frozen=True)
class ScaleLag:
    """Scale's clock less the device's: `lag` (s; no value where nothing tells it), `value` to go on with, its `sd`."""

    lag: Estimate
    value: float
    sd: float
    problems: tuple[QualityFinding, ...]

    @property
    def determined(self) -> bool:
        """Whether the data tell it."""
        return self.lag.determined


def scale_lag(scale: Weighed, course: TankCourse) -> ScaleLag:
    """Find how the scale's clock stands to the device's from starts and stops.

    A steady rise tells nothing: a later clock looks like a fuller tank. Without anything else the clocks are taken to
    agree, to +-30 s, and that is told.
    """
    from scipy.optimize import minimize_scalar

    span = (max(scale.time[0], course.time[0] - SEARCH), min(scale.time[-1], course.time[-1] + SEARCH))
    use = scale.good & (scale.time >= span[0]) & (scale.time <= span[1])
    if use.sum() < 60:
        raise InputError(
            "the scale and the device's level share less than a minute; look at the clocks of the two tables."
        )
    t, v = scale.time[use], scale.volume[use] * 1e6
    rate = _usual_rate(course)
    pieces = [
        (t[near], v[near]) for kink in _kinks(course, rate) if _both_sides(near := np.abs(t - kink) < _AROUND, t, kink)
    ]

    def residual(lag: float) -> np.ndarray:
        """Return what each piece leaves of the scale with an offset and a gain of its own."""
        left = []
        for moment, volume in pieces:
            X = np.stack(
                [np.ones(moment.size), np.interp(moment - lag, course.time, course.smoothed_volume * 1e6)], axis=1
            )
            c, *_ = np.linalg.lstsq(X, volume, rcond=None)
            left.append(volume - X @ c)
        return np.concatenate(left)

    if pieces:
        trial = np.linspace(-SEARCH, SEARCH, 61)
        values = [float(np.mean(residual(x) ** 2)) for x in trial]
        best = int(np.argmin(values))
        bounds = (trial[max(best - 1, 0)], trial[min(best + 1, trial.size - 1)])
        found = minimize_scalar(
            lambda x: float(np.mean(residual(x) ** 2)), bounds=bounds, method="bounded", options={"xatol": 0.01}
        )
        lag, least = float(found.x), float(found.fun)
        h = 5.0
        either = [float(np.mean(residual(lag + side) ** 2)) for side in (-h, h)]
        curvature = (sum(either) - 2.0 * least) / h**2
        n = effective_size(residual(lag), 3 * len(pieces))
        sd = math.sqrt(2.0 * least / (n * curvature)) if curvature > 0.0 else math.inf
        if sd < _CLOCK_SURE and abs(lag) < 0.95 * SEARCH:
            # Which second a row of the command stands for is not known better.
            sd = math.hypot(sd, 0.5)
            told = estimate("scale_lag", lag, sd, reason="from starts and stops, which both show")
            return ScaleLag(told, lag, sd, ())
    reason = (
        "the volume rises steadily while both are logged, and a later clock looks like a fuller tank; begin the log of the "
        "scale before the pump starts, or pause once"
    )
    text = f"the scale's clock cannot be told from the data; it is taken to agree with the device's, which to +-30 s is worth +-{30e6 * rate:.1f} mL."
    return ScaleLag(
        undetermined("scale_lag", reason),
        0.0,
        30.0 / math.sqrt(3.0),
        (QualityFinding("note", text, channel="uf_mass_scale"),),
    )


def _usual_rate(course: TankCourse) -> float:
    """Return how fast the tank usually fills, m^3/s."""
    rate = np.diff(course.smoothed_volume) / np.maximum(np.diff(course.time), 1e-9)
    on = rate[rate > 0.0]
    return float(np.median(on)) if on.size else 0.0


def _kinks(course: TankCourse, rate: float) -> list[float]:
    """Return when the filling starts or stops, s, away from emptyings."""
    steps = np.diff(course.smoothed_volume)
    now = steps / np.maximum(np.diff(course.time), 1e-9)
    on = now > 0.5 * rate
    turns = np.flatnonzero(on[1:] != on[:-1]) + 1
    falls = course.time[1:][steps < -20e-6]
    # An emptying takes its time, which the course does not follow.
    clear = [t for t in course.time[turns] if not np.any(np.abs(falls - t) < _AROUND)]
    return [float(t) for i, t in enumerate(clear) if i == 0 or t - clear[i - 1] > 30.0]


def _both_sides(near: np.ndarray, t: np.ndarray, kink: float) -> bool:
    """Tell whether readings stand on either side of a kink."""
    return bool((t[near] < kink - SEARCH).sum() >= 10 or (t[near] < kink).sum() >= 8) and (t[near] > kink).sum() >= 60
