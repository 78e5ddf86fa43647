"""Lag and rate where no pulsation is seen on both sides: a line through the lags of starts and steps (rap.md, 5.1 a)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.estimation.estimate import estimate, undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.coarse_stamps import spread_errors
from pipeline.rigs.rap.alignment.pair import Pair
from pipeline.rigs.rap.alignment.result import BENCH_POLE, Alignment, Coarse, Track
from pipeline.rigs.rap.alignment.stamps import jitter
from pipeline.rigs.rap.alignment.steps import Features, feature_lags
from pipeline.rigs.rap.alignment.told import ambiguous, told_clock, told_coarse

# Unknown delays of two sensors of one kind, and of a pressure against a flow meter: standard uncertainties, s.
_SENSOR_DELAY, _OTHER_DELAY = 0.02, 0.25
# A second peak of that share of the first, with so many features of its own, may be that of a clock that was set meanwhile.
_RIVAL, _FEWEST = 0.4, 2
# A rate of which nothing is known: standard deviation, relative.
_ANY_RATE = 100e-6
_WHAT = "no pulsation is seen on both sides: starts and steps alone tell the lag, and the delay of the sensors is in it"


def from_steps(pairs: Sequence[Pair], coarse: Coarse, bench_pole: float | None, search: float) -> Alignment:
    """Return the alignment that starts, stops and steps alone tell; parameters as in `align`."""
    features = feature_lags(pairs, coarse.lag)
    first = max(max(float(pair.bench.time[0]), float(pair.device.time[0]) + coarse.lag) for pair in pairs)
    last = min(min(float(pair.bench.time[-1]), float(pair.device.time[-1]) + coarse.lag) for pair in pairs)
    reference = 0.5 * (first + last)
    delay = _SENSOR_DELAY if all(pair.alike for pair in pairs) else _OTHER_DELAY
    covariance = np.diag([max(coarse.sd, delay) ** 2, _ANY_RATE**2])
    value, slope, slope_sd, dof = coarse.lag, 0.0, math.nan, math.inf
    if features.time.size:
        value, slope, slope_sd, matrix, dof = _line(features, reference)
        covariance = matrix + np.diag([delay**2, 0.0])
    spread = spread_errors(pairs)
    covariance += np.diag([spread.lag**2, spread.rate**2])
    slope_sd = math.hypot(slope_sd, spread.rate)
    clock = Clock(reference, value, slope, covariance)
    doubt = ambiguous(coarse, None, sure=True)
    track = Track(features.time, features.lag, features.sd, np.ones(features.time.size, dtype=bool))
    return Alignment(
        clock=clock,
        method="steps",
        sure=not doubt,
        lag=undetermined("lag", doubt)
        if doubt
        else estimate(
            "lag", value, math.sqrt(covariance[0, 0]), dof=dof, reason="; ".join(filter(None, (_WHAT, spread.remark)))
        ),
        rate=estimate("clock_rate", slope, slope_sd, dof=dof, reason=spread.remark)
        if math.isfinite(slope_sd)
        else undetermined(
            "clock_rate", "one step alone tells no drift of the clock: stop or start the pump at both ends of the run"
        ),
        coarse=coarse,
        poles=(
            undetermined("sensor_pole", "no pulsation is seen on both sides: nothing tells the poles of the sensors"),
        ),
        bench_pole=BENCH_POLE if bench_pole is None else bench_pole,
        bench_pole_stated=bench_pole is not None,
        track=track,
        jitter=jitter(pairs[0].device.time),
        problems=(QualityFinding("warning", _WHAT), *told_coarse(coarse, search), *told_clock(clock, track, doubt)),
    )


def step_of_features(pairs: Sequence[Pair], coarse: Coarse) -> tuple[float, float] | None:
    """Return when a clock was set within the run (s on the bench's) and how much the lag changes (s); None where one lag fits all.

    It was where the second peak fits other features than the first, all before or all behind them.
    """
    if not math.isfinite(coarse.second_lag) or not coarse.margin > _RIVAL:
        return None
    first, second = (feature_lags(pairs, lag).time for lag in (coarse.lag, coarse.second_lag))
    if min(first.size, second.size) < _FEWEST:
        return None
    change = coarse.second_lag - coarse.lag
    if first.max() < second.min():
        return float(first.max()), change
    return (float(second.max()), -change) if second.max() < first.min() else None


def _line(features: Features, reference: float) -> tuple[float, float, float, np.ndarray, float]:
    """Return lag at the reference, rate, its standard error (NaN with one place only), covariance, degrees of freedom."""
    x, y, w = features.time - reference, features.lag, 1.0 / np.maximum(features.sd, 1e-3) ** 2
    several = np.ptp(x) > 60.0
    columns = np.stack([np.ones_like(x), x], axis=1) if several else np.ones((x.size, 1))
    normal = np.linalg.inv(columns.T @ (columns * w[:, None]))
    solution = normal @ (columns.T @ (w * y))
    dof = x.size - columns.shape[1]
    off = y - columns @ solution
    normal = normal * max(float(w @ off**2) / dof if dof > 0 else 1.0, 1.0)
    if not several:
        return float(solution[0]), 0.0, math.nan, np.diag([float(normal[0, 0]), _ANY_RATE**2]), max(dof, 1)
    sd = math.sqrt(normal[1, 1])
    return float(solution[0]), float(solution[1]), sd if dof > 0 else math.nan, normal, max(dof, 1)
