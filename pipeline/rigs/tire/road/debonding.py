"""Does the flex sensor still answer as the film does? A step of their ratio is debonding, a slow change is drift.

The ratio cannot tell load from gain in one sensor; with two sensors of different kind it can.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

_LEAST = 8
_AROUND = 25
_STEP = 5.0
_SMALL, _FINE = 0.02, 8.0
_SURE = 5.0
_LEAST_DRIFT = 0.01
_NORMAL = 1.4826


@dataclass(frozen=True)
class Step:
    """A step of the ratio flex over film.

    Attributes
    ----------
    time, time_se
        When, s: half way between the revolutions on either side.
    share
        Ratio after it over the ratio before; `share_se` its standard error.
    deviations
        Its height in standard deviations of one revolution.
    """

    time: float
    time_se: float
    share: float
    share_se: float
    deviations: float


@dataclass(frozen=True, eq=False)
class Bonding:
    """The ratio of the sensors along a drive.

    Attributes
    ----------
    time, ratio
        Revolutions that tell it (s), and flex over film, 1 as on the bench, shape (m,) each.
    sd
        Scatter of one revolution, relative.
    mean
        Median ratio before any step: other than 1 the sensors' gains are no longer those of the bench.
    steps
        Sudden changes, in order of time.
    drift, drift_se
        Slow change without the steps, relative per hour.
    span, least
        Of the drive, s; the least change over it that is a drift, relative.
    """

    time: np.ndarray
    ratio: np.ndarray
    sd: float
    mean: float
    steps: tuple[Step, ...]
    drift: float
    drift_se: float
    span: float
    least: float = 0.01

    @property
    def ok(self) -> bool:
        """Whether there is no step and no drift that matters."""
        return not self.steps and not self.drifts

    @property
    def drifts(self) -> bool:
        """Whether the ratio moves by more than its errors over the drive, and by more than the least."""
        return abs(self.drift) > _SURE * self.drift_se and abs(self.drift) * self.span / 3600.0 > self.least

    @property
    def verdict(self) -> str:
        """What the ratio says, in a sentence."""
        if not math.isfinite(self.sd):
            return "not judged: too few revolutions show flex sensor and film both"
        if self.steps:
            step = max(self.steps, key=lambda found: found.deviations)
            change = 100.0 * (step.share - 1.0)
            whom = (
                f"flex sensor against film fell by {-change:.0f} % at t = {step.time:.1f} s: debonding of the flex sensor"
                if change < 0.0
                else f"film against flex sensor fell by {100.0 - 100.0 / step.share:.0f} % at t = {step.time:.1f} s: the film or its readout"
            )
            return f"{whom} (step of {step.deviations:.0f} sd)"
        part = 100.0 * self.span / 3600.0
        told = f"{part * self.drift:+.2f} +- {1.96 * part * self.drift_se:.2f} % over these {self.span:.0f} s"
        if self.drifts:
            return f"flex sensor against film drifts by {told}: a gain changes, and the load of the flex sensor with it"
        return f"flex sensor and film agree: no step, drift {told}"


def debonding(
    time: np.ndarray, ratio: np.ndarray, usable: np.ndarray | None = None, least: float = _LEAST_DRIFT
) -> Bonding:
    """Return steps and drift of the ratio flex over film, shape (m,), along `time` (s).

    A step is one of more than 5 standard deviations of one revolution, or of 2 % where that is 8 standard errors:
    medians of 25 revolutions on either side against each other, so a single wild revolution is none. Steps and drifts
    below `least` (relative) are left out: where the ratio goes with the load too, that has to be larger.
    """
    kept = np.isfinite(ratio) & (ratio > 0.0)
    if usable is not None:
        kept &= usable
    t, r = time[kept], ratio[kept]
    if t.size < 2 * _LEAST:
        return Bonding(t, r, math.nan, math.nan, (), math.nan, math.nan, math.nan)
    logs = np.log(r)
    sd = _scatter(logs)
    edges = _steps(logs, sd, least if least > _LEAST_DRIFT else 0.0)
    bounds = [0, *edges, t.size]
    steps = tuple(
        _step(t, logs, sd, before, at, after) for before, at, after in zip(bounds[:-2], edges, bounds[2:], strict=True)
    )
    drift, drift_se = _drift(t, logs, edges)
    span = float(t[-1] - t[0])
    return Bonding(t, r, sd, float(np.exp(np.median(logs[: bounds[1]]))), steps, drift, drift_se, span, least)


def _scatter(logs: np.ndarray) -> float:
    """Return the standard deviation of one revolution, from differences of neighbours: no step or drift is in it."""
    apart = np.diff(logs)
    return max(1e-6, float(_NORMAL * np.median(np.abs(apart - np.median(apart))) / math.sqrt(2.0)))


def _steps(logs: np.ndarray, sd: float, least: float) -> list[int]:
    """Return the first revolution after each step."""
    heights = np.zeros(logs.size)
    for i in range(_LEAST, logs.size - _LEAST + 1):
        before, after = logs[max(0, i - _AROUND) : i], logs[i : i + _AROUND]
        heights[i] = float(np.median(after) - np.median(before))
    found: list[int] = []
    # Medians of many revolutions show a smaller step as well.
    big = np.abs(heights) > max(least, min(_STEP * sd, max(_SMALL, _FINE * 1.2533 * sd * math.sqrt(2.0 / _AROUND))))
    while big.any():
        about = int(np.argmax(np.where(big, np.abs(heights), 0.0)))
        low, high = max(0, about - _AROUND), min(logs.size, about + _AROUND)
        found.append(low + _split(logs[low:high]))
        big[low:high] = False
    return sorted(set(found))


def _split(logs: np.ndarray) -> int:
    """Return where two levels part best, by least absolute deviation."""
    costs = [
        np.abs(logs[:i] - np.median(logs[:i])).sum() + np.abs(logs[i:] - np.median(logs[i:])).sum()
        for i in range(2, logs.size - 1)
    ]
    return 2 + int(np.argmin(costs))


def _step(time: np.ndarray, logs: np.ndarray, sd: float, before: int, at: int, after: int) -> Step:
    low, high = max(before, at - _AROUND), min(after, at + _AROUND)
    height = float(np.median(logs[at:high]) - np.median(logs[low:at]))
    # A median is 1.25 times as uncertain as a mean.
    error = 1.2533 * sd * math.sqrt(1.0 / (high - at) + 1.0 / (at - low))
    share = math.exp(height)
    apart = float(time[at] - time[at - 1])
    return Step(0.5 * float(time[at] + time[at - 1]), apart / math.sqrt(12.0), share, share * error, abs(height) / sd)


def _drift(time: np.ndarray, logs: np.ndarray, edges: list[int]) -> tuple[float, float]:
    """Return the common slope of the stretches between steps, per hour, and its standard error.

    Means of blocks carry the scatter, so that slow noise is felt.
    """
    x, y, w = [], [], []
    bounds = [0, *edges, time.size]
    for a, b in pairwise(bounds):
        if b - a < 2 * _LEAST:
            continue
        parts = np.array_split(np.arange(a, b), min(40, (b - a) // _LEAST))
        xs = np.array([time[part].mean() for part in parts])
        ys = np.array([np.median(logs[part]) for part in parts])
        x.append(xs - xs.mean())
        y.append(ys - ys.mean())
        w.append(len(parts))
    if not x or sum(w) - len(w) < 2:
        return math.nan, math.nan
    X, Y = np.concatenate(x) / 3600.0, np.concatenate(y)
    slope = float(X @ Y / (X @ X))
    freedom = X.size - len(w) - 1
    return slope, math.sqrt(float(((Y - slope * X) ** 2).sum()) / max(freedom, 1) / float(X @ X))
