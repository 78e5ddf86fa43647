"""Fillings of the tank between two emptyings: what each begins with, and what ran in (rap.md, 3.7 and section 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.circuit.tank import Tank
from pipeline.rigs.rap.therapy.drains import Emptying
from pipeline.rigs.rap.therapy.tank_kalman import EMPTY_SD, GAIN_SD, LITRE

# Levels after a fall of which one tells the volume that is left; so many gainsay the key, by so many standard deviations.
_SOON, _ENOUGH, _DOUBTS = 60, 15, 4.0


@dataclass(frozen=True)
class Segment:
    """A filling of the tank, from `begin` to `end` (s), closed by `cause` (drain, emptied, taken up anew, end of the run).

    `known_empty`: a drain key says that it began empty. Volumes at either end (m^3) with the standard error of their difference; `first_echo` (s), None without any.
    """

    begin: float
    end: float
    cause: str
    known_empty: bool
    first_echo: float | None
    volume_begin: float
    volume_end: float
    gained_sd: float

    @property
    def gained(self) -> float:
        """What ran into the tank, m^3."""
        return self.volume_end - self.volume_begin


def without_wild_start(level: np.ndarray, asked: np.ndarray, area: float) -> np.ndarray:
    """Return the levels without wild ones among the first thirty, which would set the filter off wrong."""
    found = np.flatnonzero(np.isfinite(level))[:30]
    if found.size < 5:
        return level
    rest = level[found] - np.cumsum(asked)[found] * LITRE / area
    off = np.abs(rest - np.median(rest))
    out = level.copy()
    out[found[off > 6.0 * max(1.4826 * float(np.median(off)), 1e-3)]] = np.nan
    return out


def not_empty(level: np.ndarray, asked: np.ndarray, area: float) -> float | None:
    """Return what the first levels say was left in a tank that the key says is empty, m^3; None where they agree with it.

    Parameters
    ----------
    level, asked
        Levels of the filling (m; NaN: none) and what was asked for in each step (litre), shape (m,).
    area
        Of the floor, m^2.
    """
    found = np.flatnonzero(np.isfinite(level))[:_SOON]
    if found.size < _ENOUGH:
        return None
    pumped = np.cumsum(asked)[found]
    left = float(np.median(level[found] * area / LITRE - pumped))
    doubt = math.hypot(EMPTY_SD, GAIN_SD * float(np.median(pumped)))
    return left * LITRE if left > _DOUBTS * doubt else None


def first_volume(level: np.ndarray, tank: Tank, *, after_fall: bool) -> tuple[float, float]:
    """Return a volume to start from where no key tells it, and its standard deviation, litre.

    That of the first level, as uncertain as the tank is large; where the levels are lost in a fall, what lies below them.
    """
    found = np.flatnonzero(np.isfinite(level))
    if after_fall and not (found.size and found[0] < _SOON):
        below = max(tank.blind, 2e-3) * tank.area / LITRE
        return 0.0, 0.5 * below
    height = float(level[found[0]]) if found.size else 0.5 * tank.H
    return height * tank.area / LITRE, tank.capacity / LITRE


def causes(emptied: Sequence[Emptying], count: int) -> list[str]:
    """Return what closes each of the last `count` fillings, in words."""
    words = ["drain key" if e.announced else "emptied without the key" for e in emptied]
    return [*words[len(words) - count + 1 :], "end of the run"] if count > 1 else ["end of the run"]


def segment(
    time: np.ndarray,
    a: int,
    b: int,
    volume: np.ndarray,
    covariances: np.ndarray,
    widening: float,
    used: np.ndarray,
    cause: str,
    known_empty: bool,
) -> Segment:
    """Return the account of one filling."""
    echoes = np.flatnonzero(used)
    ends = covariances[0, 0, 0] + covariances[-1, 0, 0]
    return Segment(
        begin=float(time[a]),
        end=float(time[b - 1]),
        cause=cause,
        known_empty=known_empty,
        first_echo=float(time[a + echoes[0]]) if echoes.size else None,
        volume_begin=float(volume[0]),
        volume_end=float(volume[-1]),
        gained_sd=widening * math.sqrt(max(float(ends), 0.0)) * LITRE,
    )
