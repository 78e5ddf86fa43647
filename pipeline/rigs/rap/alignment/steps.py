"""Lag and rate from starts, stops and steps alone, where there is no pulsation to compare (rap.md, 5.1 a).

Each feature tells a lag by itself; a line through them tells lag and rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.alignment.features import STEP, Course, course
from pipeline.rigs.rap.alignment.pair import Pair

# A feature stands out of the usual slope by that factor and lies that far from the next, s.
_STANDS_OUT, _APART = 8.0, 8.0
_AROUND, _GAUSS_NEWTON, _MOST = 12.0, 8, 200


@dataclass(frozen=True, eq=False)
class Features:
    """Lag that each feature tells: `time` on the bench's clock, `lag`, `sd`, s, shape (f,)."""

    time: np.ndarray
    lag: np.ndarray
    sd: np.ndarray


def feature_lags(pairs: Sequence[Pair], lag: float) -> Features:
    """Return the lags (s) of single features near `lag`, in the order of time."""
    found = []
    for pair in pairs:
        step = max(STEP, 0.5 * max(1.0 / pair.device.rate, 1.0 / pair.bench.rate))
        device, bench = course(pair.device, step), course(pair.bench, step)
        found += [one for at in _places(bench) if (one := _lag_at(device, bench, at, lag)) is not None]
    found.sort()
    table = np.array(found).reshape(-1, 3)
    return Features(table[:, 0], table[:, 1], table[:, 2])


def _places(bench: Course) -> list[float]:
    """Return where the slope stands out of the usual, s, the strongest first."""
    size = np.abs(bench.slope)
    usual = float(np.median(size[bench.known])) if bench.known.any() else 0.0
    found: list[float] = []
    for k in np.argsort(size)[::-1]:
        if len(found) >= _MOST or not size[k] > _STANDS_OUT * usual:
            break
        at = bench.start + bench.step * float(k)
        if all(abs(at - other) > _APART for other in found):
            found.append(at)
    return found


def _lag_at(device: Course, bench: Course, at: float, lag: float) -> tuple[float, float, float] | None:
    """Return time, lag and its standard error of one feature; None where the device's course does not show it."""
    count = round(_AROUND / bench.step)
    k = round((at - bench.start) / bench.step) + np.arange(-count, count + 1)
    k = k[(k >= 0) & (k < bench.slope.size)]
    if k.size < count or not bench.known[k].all():
        return None
    y, time = bench.slope[k], bench.start + bench.step * k
    grid = device.start + device.step * np.arange(device.slope.size)
    slope = np.gradient(device.slope, device.step)
    start = lag
    for _ in range(_GAUSS_NEWTON):
        x = np.interp(time - lag, grid, device.slope)
        change = -np.interp(time - lag, grid, slope)
        power = float(x @ x)
        if not power > 0.0:
            return None
        factor = float(x @ y) / power
        left = y - factor * x
        # The factor is projected out of the change.
        change = factor * (change - x * float(x @ change) / power)
        information = float(change @ change)
        if not information > 0.0:
            return None
        lag += float(np.clip(float(change @ left) / information, -0.5, 0.5))
    if abs(lag - start) > 2.0 or float(left @ left) > 0.3 * float(y @ y):
        return None
    # Neighbours of the smoothed course repeat each other over about a second.
    together = max(1.0 / bench.step, 1.0)
    sd = float(np.sqrt(together * float(left @ left) / max(k.size - 2, 1) / information))
    return at, lag, sd
