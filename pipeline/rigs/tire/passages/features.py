"""Marks of a waveform with standard errors, of the mean and of single revolutions (tire.md, 3.5 and 5.5)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from operator import attrgetter

import numpy as np

from pipeline.rigs.tire.passages.revolutions import BINS, Revolutions
from pipeline.rigs.tire.passages.waveform import Waveform, change_shape
from pipeline.rigs.tire.ring.ring import Shape, grid
from pipeline.rigs.tire.ring.shape_lengths import Lengths, lengths

# The belt's own bending reaches up to here, however long the sensor.
_BENT = 70
# Groups from which on neighbours tell; the least share of the variance of independent groups.
_SOME, _LEAST_SHARE = 10, 0.2
# Marks that go with the load.
_HEIGHTS = ("peak", "dip_leading", "dip_trailing")
# Half the angle over which one revolution tells a mark's level and slope: of the peak, of a dip, rad.
_AT_PEAK, _AT_DIP = 0.035, 0.1


@dataclass(frozen=True)
class Features:
    """Marks of the mean waveform, R2 less its mean (ohm), and their standard errors.

    Attributes
    ----------
    value, error
        `error` holds in each field the standard error of the same field of `value`: a jackknife over groups of
        revolutions, so that what scatters from turn to turn (load, speed) is in it, and the orders left out.
    asymmetry_error
        Standard error of ``value.asymmetry``.
    groups
        Groups of the jackknife: the errors have one degree of freedom less.
    """

    value: Lengths
    error: Lengths
    asymmetry_error: float
    groups: int


def features(waveform: Waveform, R: float, highest: int) -> Features:
    """Return the marks of a waveform on a belt of radius R (m).

    They are read off orders that are whole up to 0.9 `highest` and fade out to twice that: cut sharply at `highest`,
    ripple moves L_slope by 0.3 mm and Ld by 0.7 mm where the sensor is 50 mm long. What the orders beyond change, as far
    as it is more than their noise, is part of the error.
    """
    means = [waveform.mean, *waveform.groups]
    upto = max(highest, _BENT)
    faded, wide = (
        [lengths(change_shape(mean, orders.size - 1).times(orders), R) for mean in means]
        for orders in (_fading(0.9 * upto, 1.8 * upto), np.ones(2 * upto + 1))
    )

    def error(mark: Callable[[Lengths], float], waves: bool) -> float:
        value, beyond = (np.array([mark(one) for one in marks]) for marks in (faded, wide))
        off = beyond - value
        cut = float(off[0] ** 2) if off[0] ** 2 > _jackknife(off[1:]) else 0.0
        return math.sqrt(_jackknife(value[1:], waves) + cut)

    errors = {f.name: error(attrgetter(f.name), f.name in _HEIGHTS) for f in fields(Lengths)}
    return Features(faded[0], Lengths(**errors), error(lambda one: one.asymmetry, True), len(waveform.groups))


def _fading(first: float, last: float) -> np.ndarray:
    """Return the weights of orders that are one up to `first` and fall to zero at `last` as half a cosine."""
    orders = np.arange(math.floor(last) + 1)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.clip((orders - first) / (last - first), 0.0, 1.0)))


def _jackknife(values: np.ndarray, waves: bool = False) -> float:
    """Return the variance of a value by those without one group each.

    With `waves` neighbours may be more or less alike than others: a wave of the load in step with the drum makes turns
    alternate, and their mean is quieter than of turns drawn at random (Bartlett weights; no less than a share of what
    independent groups give).
    """
    off = values - values.mean()
    n, plain = values.size, float(off @ off)
    lags = 2 if waves and n >= _SOME else 0
    along = sum(2.0 * (1.0 - k / (lags + 1.0)) * float(off[k:] @ off[:-k]) for k in range(1, lags + 1))
    return (n - 1) / n * max(plain + along, _LEAST_SHARE * plain)


@dataclass(frozen=True, eq=False)
class RevolutionFeatures:
    """Marks of m revolutions: change of R2 from the revolution's level, ohm, and Ld, m; shape (m,), NaN where lost.

    `*_se` are standard errors by the noise about the mean waveform in that revolution.
    """

    peak: np.ndarray
    peak_se: np.ndarray
    dip_leading: np.ndarray
    dip_leading_se: np.ndarray
    dip_trailing: np.ndarray
    dip_trailing_se: np.ndarray
    deformation: np.ndarray
    deformation_se: np.ndarray

    @property
    def asymmetry(self) -> np.ndarray:
        """Trailing dip less leading dip, ohm, shape (m,)."""
        return np.asarray(self.dip_trailing - self.dip_leading)


def revolution_features(revolutions: Revolutions, waveform: Waveform, R: float, highest: int) -> RevolutionFeatures:
    """Return the marks of each revolution.

    At each mark of the mean waveform a revolution is that waveform, scaled to its height, plus a straight line fitted
    about the mark: the lowest of noisy values would be biased.
    """
    shape = waveform.shape(highest)
    marks = lengths(shape, R)
    template = shape.on_grid(BINS)[1]
    at = grid(BINS)
    change = revolutions.resistance - revolutions.level[:, None]
    scale = revolutions.amplitude / marks.peak
    off = change - scale[:, None] * template
    places = (marks.peak_angle, marks.dip_leading_angle, marks.dip_trailing_angle)
    found = []
    for mark, reach in zip(places, (_AT_PEAK, _AT_DIP, _AT_DIP), strict=True):
        found.append(_line(off, revolutions.count, at - mark, reach, revolutions.noise))
    heights = np.array([marks.peak, marks.dip_leading, marks.dip_trailing])
    level = [h * scale + line[0] for h, line in zip(heights, found, strict=True)]
    bend = [_bend(shape, mark) for mark in places]
    moved = [-line[1] / (scale * b) for line, b in zip(found, bend, strict=True)]
    moved_se = [line[3] / np.abs(scale * b) for line, b in zip(found, bend, strict=True)]
    return RevolutionFeatures(
        level[0],
        found[0][2],
        level[1],
        found[1][2],
        level[2],
        found[2][2],
        marks.deformation + R * (moved[2] - moved[1]),
        R * np.hypot(moved_se[2], moved_se[1]),
    )


def _line(
    off: np.ndarray, count: np.ndarray, angle: np.ndarray, reach: float, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return height and slope at angle 0 of the straight lines through `off` within `reach`, and their errors."""
    near = np.abs(angle) < reach
    u, y = angle[near], off[:, near]
    w = np.where(np.isfinite(y), count[:, near], 0).astype(float)
    y = np.where(w > 0, y, 0.0)
    s0, s1, s2 = w.sum(axis=1), w @ u, w @ (u * u)
    y0, y1 = (w * y).sum(axis=1), (w * y) @ u
    det = s0 * s2 - s1 * s1
    det = np.where(det > 1e-3 * s0 * s0 * reach**2 / 3.0, det, np.nan)
    height, slope = (s2 * y0 - s1 * y1) / det, (s0 * y1 - s1 * y0) / det
    rss = (w * (y - height[:, None] - slope[:, None] * u) ** 2).sum(axis=1)
    dof = np.maximum((w > 0).sum(axis=1) - 2, 1)
    variance = np.maximum(rss / dof, 0.0)
    variance = np.where(np.isfinite(noise), np.maximum(variance, 0.25 * noise**2), variance)
    return height, slope, np.sqrt(variance * s2 / det), np.sqrt(variance * s0 / det)


def _bend(shape: Shape, angle: float) -> float:
    """Return the second derivative by angle, ohm/rad^2."""
    n = shape.orders
    waves = -(n**2) * shape.harmonics * np.exp(1j * n * angle)
    return float(waves[0].real + 2.0 * waves[1:].real.sum())
