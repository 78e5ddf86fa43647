"""Blocks of a bump test: means over a small turn of the force, and the force levels found among them.

A mean of force and displacement over the same samples obeys the contact law as a sample does, as
long as the same sides are pressed; its noise is smaller and less correlated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

# Preliminary blocks, to find how fast the force turns.
_PRELIMINARY = 4000
# Share of the largest force below which its direction is not looked at.
_LEAST_FORCE = 0.03


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of one run: time (n,), s; force (n, 2), N, and displacement in each plane (n, 2), m, in x, y."""

    run: str
    time: np.ndarray
    force: np.ndarray
    planes: Mapping[int, np.ndarray]


@dataclass(frozen=True, eq=False)
class Blocks:
    """Block means in the order of time, and the noise of one.

    Attributes
    ----------
    run, time
        Run and middle of each block (s), shape (n,).
    force, planes
        Means, shape (n, 2).
    slope
        Change of the force over half a block, shape (n, 2), N.
    level
        Number of the force level from 0, -1 for none, shape (n,).
    force_noise, motion_noise
        Standard deviation of a block's mean, from the scatter within blocks, N and m.
    frequency
        Turns per second of the force.
    coverage
        Share of the directions all round that the force went through.
    """

    run: np.ndarray
    time: np.ndarray
    force: np.ndarray
    planes: Mapping[int, np.ndarray]
    slope: np.ndarray
    level: np.ndarray
    force_noise: float
    motion_noise: float
    frequency: float
    coverage: float

    @property
    def size(self) -> np.ndarray:
        """Size of the force, shape (n,), N."""
        return np.asarray(np.hypot(*self.force.T))

    @property
    def levels(self) -> list[float]:
        """Median force of each level, N, rising."""
        return [float(np.median(self.size[self.level == k])) for k in range(int(self.level.max(initial=-1)) + 1)]

    def at(self, chosen: np.ndarray) -> Blocks:
        """Return the chosen blocks, `chosen` a mask of shape (n,)."""
        return replace(
            self,
            run=self.run[chosen],
            time=self.time[chosen],
            force=self.force[chosen],
            planes={p: d[chosen] for p, d in self.planes.items()},
            slope=self.slope[chosen],
            level=self.level[chosen],
        )


@dataclass(frozen=True)
class Rotation:
    """How the force turns: turns per second, share of directions it went through, largest size (N), steadiness.

    `steadiness` is the share of the time during which it turned about as fast as it does on the whole.
    """

    frequency: float
    coverage: float
    largest: float
    steadiness: float


def rotation_of(samples: Samples) -> Rotation:
    """Tell how the force vector turns."""
    m = max(1, samples.time.size // _PRELIMINARY)
    n = samples.time.size // m
    force = samples.force[: n * m].reshape(n, m, 2).mean(axis=1)
    time = samples.time[: n * m].reshape(n, m).mean(axis=1)
    size = np.hypot(*force.T)
    largest = float(np.quantile(size, 0.99)) if n else 0.0
    on = size > _LEAST_FORCE * largest
    if on.sum() < 8:
        return Rotation(0.0, 0.0, largest, 0.0)
    psi, time = np.unwrap(np.arctan2(force[on, 1], force[on, 0])), time[on]
    lag = max(1, psi.size // 50)
    rates = (psi[lag:] - psi[:-lag]) / (time[lag:] - time[:-lag]) / (2 * math.pi)
    rate = math.copysign(float(np.median(np.abs(rates))), float(np.median(rates)))
    bins = np.unique((psi % (2 * math.pi)) // (math.pi / 18)).size
    return Rotation(rate, bins / 36, largest, _steadiness(psi, time, rate))


def _steadiness(psi: np.ndarray, time: np.ndarray, rate: float) -> float:
    """Return the share of sixteenths of a turn within which the force really turned, either way, about as much."""
    if rate == 0:
        return 0.0
    step = 1 / (16 * abs(rate))
    edges = np.arange(time[0], time[-1] + step, step)
    which = np.digitize(time, edges)
    means = np.array([psi[which == i].mean() for i in np.unique(which)])
    moved = np.abs(np.diff(means)) / (math.pi / 8)
    return float(np.mean((moved > 0.3) & (moved < 3.0))) if moved.size else 0.0


def blocks_of(samples: Samples, rotation: Rotation, block_angle: float) -> Blocks:
    """Return the means over pieces of `block_angle` (rad) of turn; levels are not set yet."""
    rate = 1.0 / float(np.median(np.diff(samples.time)))
    per_turn = rate / abs(rotation.frequency)
    m = max(1, round(per_turn * block_angle / (2 * math.pi)))
    n = samples.time.size // m
    shape = (n, m, 2)
    force = samples.force[: n * m].reshape(shape)
    planes = {p: d[: n * m].reshape(shape) for p, d in samples.planes.items()}
    time = samples.time[: n * m].reshape(n, m)
    whole = (np.ptp(time, axis=1) <= 1.5 * m / rate) & np.isfinite(force).all(axis=(1, 2))
    for d in planes.values():
        whole &= np.isfinite(d).all(axis=(1, 2))
    mean = force.mean(axis=1)
    slope = np.zeros((n, 2)) if n < 2 else np.gradient(mean, axis=0) / 2
    motion = np.concatenate(list(planes.values()), axis=2)
    made = Blocks(
        np.full(n, samples.run, dtype=object),
        time.mean(axis=1),
        mean,
        {p: d.mean(axis=1) for p, d in planes.items()},
        slope,
        np.full(n, -1),
        _noise_of_mean(force[whole]),
        _noise_of_mean(motion[whole]),
        rotation.frequency,
        rotation.coverage,
    )
    return made.at(whole & (np.hypot(*mean.T) > _LEAST_FORCE * rotation.largest))


def _noise_of_mean(values: np.ndarray) -> float:
    """Return the standard deviation of block means of white noise, values (blocks, m, axes), from second differences."""
    if values.shape[0] == 0:
        return 0.0
    if values.shape[1] < 4:
        flat = values.reshape(-1, values.shape[2])
        bend = flat[2:] - 2 * flat[1:-1] + flat[:-2]
    else:
        bend = (values[:, 2:] - 2 * values[:, 1:-1] + values[:, :-2]).reshape(-1, values.shape[2])
    if bend.size == 0:
        return 0.0
    return float(np.median(1.4826 * np.median(np.abs(bend), axis=0) / math.sqrt(6)) / math.sqrt(values.shape[1]))


def joined(parts: list[Blocks]) -> Blocks:
    """Return the blocks of several runs as one, in the planes that all have."""
    first = parts[0]
    planes = [p for p in (1, 2) if all(p in part.planes for part in parts)]
    weights = np.array([part.time.size for part in parts], dtype=float)
    weights /= weights.sum()
    return Blocks(
        np.concatenate([part.run for part in parts]),
        np.concatenate([part.time for part in parts]),
        np.concatenate([part.force for part in parts]),
        {p: np.concatenate([part.planes[p] for part in parts]) for p in planes},
        np.concatenate([part.slope for part in parts]),
        np.concatenate([part.level for part in parts]),
        math.sqrt(sum(w * part.force_noise**2 for w, part in zip(weights, parts, strict=True))),
        math.sqrt(sum(w * part.motion_noise**2 for w, part in zip(weights, parts, strict=True))),
        first.frequency,
        max(part.coverage for part in parts),
    )


def with_levels(parts: list[Blocks], tolerance: float) -> list[Blocks]:
    """Find the force levels: sizes at which the force stayed for half a turn or more.

    The size is taken as the median over a turn, so that a force that is a little elliptic, or pauses,
    has one level and not many. A force that rises all the time is cut into pieces of a turn.

    Parameters
    ----------
    tolerance
        Relative difference of two levels that count as one.
    """
    from scipy.ndimage import median_filter

    smooth, turns, steady = [], [], []
    for part in parts:
        step = float(np.median(np.diff(part.time))) if part.time.size > 1 else 1.0
        per_turn = max(4, round(1 / (abs(part.frequency) * step)))
        size = median_filter(np.log(part.size), size=min(per_turn, part.time.size), mode="nearest")
        quarter = max(1, per_turn // 4)
        padded = np.pad(size, quarter, mode="edge")
        change = np.abs(padded[2 * quarter :] - padded[: -2 * quarter])
        smooth.append(size)
        steady.append(change < tolerance / 2)
        turns.append(np.full(part.time.size, 1.0 / per_turn))
    value, turn, held = np.concatenate(smooth), np.concatenate(turns), np.concatenate(steady)
    order = np.argsort(value, kind="stable")
    plateaus = order[held[order]]
    groups = [g for g in np.split(plateaus, np.flatnonzero(np.diff(value[plateaus]) > tolerance / 2) + 1) if g.size]
    groups = [g for g in groups if turn[g].sum() >= 0.5]
    if not groups:
        groups = np.array_split(order, max(1, min(6, int(turn.sum()))))
    level = np.full(value.size, -1)
    for number, group in enumerate(g for g in groups if turn[g].sum() >= 0.5):
        level[group] = number
        level[(level < 0) & (np.abs(value - np.median(value[group])) < tolerance / 4)] = number
    ends = np.cumsum([part.time.size for part in parts])[:-1]
    return [replace(part, level=piece) for part, piece in zip(parts, np.split(level, ends), strict=True)]
