"""Bland and Altman's limits of agreement between device and bench, with intervals that blocks of time give (rap.md, 5.2).

For samples, for means of 5 s and for the amplitude of the stroke. Gain and offset are in `deming`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.rigs.rap.pressures.aligned import Aligned
from pipeline.rigs.rap.pressures.blocks import Blocks, blocks_of
from pipeline.rigs.rap.pressures.levels import Level
from pipeline.rigs.rap.pulsation.harmonics import harmonics
from pipeline.rigs.rap.pulsation.passages import Passages

MEAN = 5.0
"""Length of the means, s."""
# A mean of fewer of its samples is left out; limits from fewer differences or blocks are not told.
_FILLED, _FEWEST, _FEWEST_BLOCKS = 0.8, 10, 4
_KINDS = ("bias", "limit_lower", "limit_upper")


@dataclass(frozen=True, eq=False)
class Limits:
    """Mean difference device - bench and the limits bias -+ 1.96 s_d, Pa, and the differences behind them.

    `level` (m,) is the mean of both readings and `difference` (m,) their difference, Pa, at `time` (s).
    """

    bias: Estimate
    lower: Estimate
    upper: Estimate
    sd: float
    blocks: int
    time: np.ndarray
    level: np.ndarray
    difference: np.ndarray


@dataclass(frozen=True, eq=False)
class Trend:
    """Difference over the level: `slope` (1) and `start` (Pa at level 0) of means, tests proportional bias."""

    slope: Estimate
    start: Estimate


@dataclass(frozen=True, eq=False)
class Agreement:
    """One tap: limits on samples (bandwidth equalised), without equalising, on means of 5 s, on the stroke's amplitude."""

    name: str
    samples: Limits
    unequalised: Limits
    means: Limits
    amplitude: Limits | None
    trend: Trend


@dataclass(frozen=True, eq=False)
class Means:
    """Means of 5 s: `time` (m,), `device`, `bench` (m,) in Pa, and their blocks."""

    time: np.ndarray
    device: np.ndarray
    bench: np.ndarray
    blocks: Blocks


def bland_altman(one: Aligned, levels: Sequence[Level], passages: Passages | None = None) -> Agreement:
    """Return the limits of agreement of one tap.

    Parameters
    ----------
    one
        Device and bench side by side.
    levels
        Steady stretches of the run: blocks do not cross their beginnings.
    passages
        Frequency of the strokes in windows on the bench's clock, for the amplitude; None leaves it out.
    """
    blocks = blocks_of(one.time, one.good, levels)
    means = means_of(one, levels)
    strokes = None
    if passages is not None and passages.turning.sum() >= _FEWEST:
        windows, frequency = passages.windows.of(passages.turning), passages.frequency[passages.turning]
        known = np.where(one.good, one.device, np.nan), np.where(one.good, one.bench, np.nan)
        ours, theirs = (harmonics(one.time, values, windows, frequency, (1.0, 2.0)).amplitude(1) for values in known)
        found = np.isfinite(ours) & np.isfinite(theirs)
        if found.sum() >= _FEWEST:
            at = windows.centre[found]
            strokes = _limits(
                one.name, at, ours[found], theirs[found], blocks_of(at, np.ones(at.size, dtype=bool), levels)
            )
    return Agreement(
        one.name,
        _limits(one.name, one.time, one.device, one.bench, blocks),
        _limits(one.name, one.time, one.device, one.plain, blocks),
        _limits(one.name, means.time, means.device, means.bench, means.blocks),
        strokes,
        _trend(one.name, means),
    )


def means_of(one: Aligned, levels: Sequence[Level]) -> Means:
    """Return the means of 5 s of both readings; windows with gaps are left out."""
    number = ((one.time - one.time[0]) / MEAN).astype(int)
    count = int(number[-1]) + 1
    good = one.good
    n = np.bincount(number[good], minlength=count)
    kept = np.flatnonzero(n >= _FILLED * MEAN * one.rate)
    device, bench, time = (
        np.bincount(number[good], values[good], count)[kept] / n[kept] for values in (one.device, one.bench, one.time)
    )
    return Means(time, device, bench, blocks_of(time, np.ones(time.size, dtype=bool), levels))


def _limits(name: str, time: np.ndarray, device: np.ndarray, bench: np.ndarray, blocks: Blocks) -> Limits:
    inside = blocks.of >= 0
    d = (device - bench)[inside]
    level = 0.5 * (device + bench)[inside]
    at = {"channel": name}
    if d.size < _FEWEST or blocks.count < _FEWEST_BLOCKS:
        reason = f"{d.size} differences in {blocks.count} blocks of 20 s are too few for limits of agreement"
        bias, lower, upper = (undetermined(kind, reason, at) for kind in _KINDS)
        return Limits(bias, lower, upper, float("nan"), blocks.count, time[inside], level, d)
    spare = np.where(np.isfinite(device - bench), device - bench, 0.0)
    middle = float(d.mean())
    n, first, second = blocks.sums(np.ones(time.size)), blocks.sums(spare - middle), blocks.sums((spare - middle) ** 2)
    weights = np.concatenate([np.ones((1, blocks.count)), blocks.draws()])
    total = weights @ n
    mean = weights @ first / total
    sd = np.sqrt(np.maximum(weights @ second / total - mean**2, 0.0) * total / np.maximum(total - 1.0, 1.0))
    about = middle + mean
    hidden = blocks.hidden(time, spare)
    bias, lower, upper = (
        estimate(kind, values[0], hidden * float(np.std(values[1:], ddof=1)), dof=blocks.dof, at=at)
        for kind, values in zip(_KINDS, (about, about - 1.96 * sd, about + 1.96 * sd), strict=True)
    )
    return Limits(bias, lower, upper, float(sd[0]), blocks.count, time[inside], level, d)


def _trend(name: str, means: Means) -> Trend:
    """Return the regression of the difference on the level, its errors by leaving out one block after the other."""
    at = {"channel": name}
    level = 0.5 * (means.device + means.bench)
    d = means.device - means.bench
    if d.size < _FEWEST or means.blocks.count < _FEWEST_BLOCKS or float(np.ptp(level)) <= 0.0:
        reason = "too few means at different pressures"
        return Trend(undetermined("proportional_bias", reason, at), undetermined("offset", reason, at))
    table = np.stack([np.ones_like(d), level, d, level**2, level * d], axis=-1)
    sums = means.blocks.sums(table)
    whole = _slope(sums.sum(axis=0))
    spread = jackknifed(np.array([_slope(sums.sum(axis=0) - one) for one in sums]))
    dof = means.blocks.dof
    return Trend(
        estimate("proportional_bias", whole[1], float(np.sqrt(spread[1, 1])), dof=dof, at=at),
        estimate("offset", whole[0], float(np.sqrt(spread[0, 0])), dof=dof, at=at),
    )


def _slope(sums: np.ndarray) -> np.ndarray:
    n, x, y, xx, xy = sums
    slope = (xy - x * y / n) / (xx - x * x / n)
    return np.array([(y - slope * x) / n, slope])


def jackknifed(left_out: np.ndarray) -> np.ndarray:
    """Return the covariance from values that each leave one block out, shape (b, k) to (k, k)."""
    centred = left_out - left_out.mean(axis=0)
    return np.asarray((left_out.shape[0] - 1.0) / left_out.shape[0] * centred.T @ centred)
