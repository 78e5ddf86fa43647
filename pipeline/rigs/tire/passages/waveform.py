"""The synchronous average of a run's revolutions, with standard errors (tire.md, 5.4; Braun 2011).

What no revolution has a sample of is NaN; outlying revolutions are left out and counted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.rigs.tire.passages.revolutions import BINS, Revolutions
from pipeline.rigs.tire.passages.template import bridged
from pipeline.rigs.tire.ring.ring import Shape, grid, shape_of

# A revolution whose residual is so many robust standard deviations over the usual is left out.
_OUTLYING = 4.0
_GROUPS = 24
_LEAST = 3
# Standard deviation of half the difference of two lengths that are anywhere within a turn, turns.
_OFF_TURN = math.sqrt(1.0 / 24.0)
# Neighbouring bins whose variances are averaged, on either side.
_SMOOTHED = 4


@dataclass(frozen=True, eq=False)
class Waveform:
    """Mean of a run's revolutions by angle.

    Attributes
    ----------
    theta
        Even angles from -pi, rad, shape (BINS,); 0 is the peak, the leading dip stands at theta < 0.
    mean, std_error, scatter
        R2 and its standard error; standard deviation between revolutions; ohm, shape (BINS,).
    level, level_se
        R0: mean over the revolution, in the middle of the run where that is known; standard error from the scatter between
        revolutions beside a straight drift, ohm. NaN where part of the revolution is never recorded.
    count
        Samples in each bin.
    film, film_se
        The same of the PVDF film less its mean, V; None without one.
    speed, speed_scatter
        Mean angular speed, rad/s; its relative standard deviation between revolutions.
    revolutions, rejected
        Revolutions used and left out as outlying.
    first_harmonic
        Amplitude of the first harmonic of R2, ohm: zero for any bent ring.
    skewness
        Of the mean over the angle.
    groups
        Means without one group of revolutions each, level included, shape (G, BINS): for the jackknife.
    """

    theta: np.ndarray
    mean: np.ndarray
    std_error: np.ndarray
    scatter: np.ndarray
    level: float
    level_se: float
    count: np.ndarray
    film: np.ndarray | None
    film_se: np.ndarray | None
    speed: float
    speed_scatter: float
    revolutions: int
    rejected: int
    first_harmonic: float
    skewness: float
    groups: np.ndarray

    @property
    def change(self) -> np.ndarray:
        """R2 less its mean over the revolution, ohm, shape (BINS,)."""
        return np.asarray(self.mean - np.nanmean(bridged(self.mean)))

    def shape(self, highest: int) -> Shape:
        """Return the change of R2 as harmonics up to `highest`."""
        return change_shape(self.mean, highest)


def change_shape(mean: np.ndarray, highest: int) -> Shape:
    """Return R2 less its mean as harmonics; angles without samples are bridged by straight lines."""
    values = bridged(mean)
    return shape_of(values - values.mean(), highest)


def averaged(revolutions: Revolutions | Iterable[Revolutions], run: str = "", middle: float | None = None) -> Waveform:
    """Return the average of the whole revolutions.

    Parameters
    ----------
    revolutions
        All of a run, or its blocks: one block is held at a time.
    run
        For the message.
    middle
        Moment that the level is told for, s: of a drift over the run the whole turns need not hold the middle.

    Raises
    ------
    InputError
        Where fewer than three revolutions are whole.
    """
    blocks = [revolutions] if isinstance(revolutions, Revolutions) else revolutions
    flex, film, seen = _Sums(), _Sums(), 0
    levels: list[np.ndarray] = []
    speeds: list[np.ndarray] = []
    times: list[np.ndarray] = []
    rejected = 0
    for block in blocks:
        seen += len(block)
        good = block[block.whole]
        if not len(good):
            continue
        kept = _not_outlying(good, flex)
        rejected += int((~kept).sum())
        good = good[kept]
        flex.add(good.resistance, good.count)
        if good.film is not None:
            film.add(good.film, np.isfinite(good.film) * np.maximum(good.count, 1))
        levels.append(good.level)
        speeds.append(good.speed)
        times.append(good.times)
    if flex.revolutions < _LEAST:
        where = f"run '{run}': " if run else ""
        raise InputError(
            f"{where}{flex.revolutions} of {seen} revolutions are whole; an average needs at least {_LEAST}. "
            "Record more turns of the wheel."
        )
    level, speed = np.concatenate(levels), np.concatenate(speeds)
    mean = flex.mean()
    values = bridged(mean)
    off = values - values.mean()
    known = bool(np.mean(flex.count > 0) > 0.9)
    moved, level_se = _level_at(level, np.concatenate(times), middle)
    return Waveform(
        theta=grid(BINS),
        mean=mean,
        std_error=flex.std_error(),
        scatter=flex.scatter(),
        level=float(values.mean()) + moved if known else math.nan,
        level_se=level_se if known else math.nan,
        count=flex.count.astype(int),
        film=film.mean() - np.nanmean(film.mean()) if film.revolutions >= _LEAST else None,
        film_se=film.std_error() if film.revolutions >= _LEAST else None,
        speed=float(speed.mean()),
        speed_scatter=float(speed.std(ddof=1) / speed.mean()),
        revolutions=flex.revolutions,
        rejected=rejected,
        first_harmonic=float(2.0 * np.abs(np.fft.rfft(off)[1]) / off.size),
        skewness=float(np.mean(off**3) / np.mean(off**2) ** 1.5),
        groups=flex.groups(),
    )


def _level_at(level: np.ndarray, times: np.ndarray, middle: float | None) -> tuple[float, float]:
    """Return by how much the level at a moment is over the mean of the turns', and its standard error, ohm.

    Along a straight drift; the error is by what the turns leave of it. Without a moment the turns used begin and end up to one
    turn off the run's: the mean of a drift is off by as much of it.
    """
    turn = np.arange(level.size, dtype=float)
    at = turn if middle is None else times
    off = at - at.mean()
    slope = float(off @ level) / float(off @ off)
    noise = level - level.mean() - slope * off
    variance = float(noise @ noise) / max(level.size - 2, 1)
    if middle is None:
        return 0.0, math.hypot(math.sqrt(variance / level.size), slope * _OFF_TURN)
    away = middle - float(at.mean())
    return slope * away, math.sqrt(variance * (1.0 / level.size + away**2 / float(off @ off)))


def _not_outlying(block: Revolutions, before: _Sums) -> np.ndarray:
    """Return which revolutions do not lie off: residual against the median of the block, scaled by the noise."""
    if len(block) < _LEAST:
        return np.ones(len(block), dtype=bool)
    centred = block.resistance - block.level[:, None]
    middle = before.mean_change() if before.revolutions > 50 else _median(centred)
    scale = np.where(np.isfinite(block.amplitude) & (block.amplitude > 0.0), block.amplitude, np.nan)
    share = scale / np.nanmedian(scale)
    off = centred - share[:, None] * middle
    rms = np.sqrt(np.nanmean(off**2, axis=1))
    usual = float(np.nanmedian(rms))
    spread = 1.4826 * float(np.nanmedian(np.abs(rms - usual)))
    height = np.abs(share - 1.0) / max(1.4826 * float(np.nanmedian(np.abs(share - 1.0))), 5e-3)
    return np.asarray((rms < usual + _OUTLYING * max(spread, 0.1 * usual)) & (height < 2.0 * _OUTLYING))


def _median(values: np.ndarray) -> np.ndarray:
    counted = np.isfinite(values).any(axis=0)
    middle = np.full(values.shape[1], np.nan)
    middle[counted] = np.nanmedian(values[:, counted], axis=0)
    return middle


class _Sums:
    """Weighted sums by bin about a first mean; revolutions are dealt out in turn to groups."""

    def __init__(self) -> None:
        self.revolutions = 0
        self.count = np.zeros(BINS)
        self._origin: np.ndarray | None = None
        self._levels = 0.0
        self._weight = np.zeros((_GROUPS, BINS))
        self._sum = np.zeros((_GROUPS, BINS))
        # Sums of w x^2, w^2, w^2 x, w^2 x^2.
        self._square, self._w2, self._w2x, self._w2xx = np.zeros((4, BINS))

    def add(self, values: np.ndarray, count: np.ndarray) -> None:
        """Add revolutions, shape (m, BINS); the level of each is brought to that of the mean first."""
        weight = np.where(np.isfinite(values), count, 0).astype(float)
        some = weight.sum(axis=1) > 0
        values, weight = np.nan_to_num(values[some]), weight[some]
        if not values.shape[0]:
            return
        if self._origin is None:
            total = weight.sum(axis=0)
            self._origin = bridged(_ratio((values * weight).sum(axis=0), total))
        off = values - self._origin
        level = (off * weight).sum(axis=1) / weight.sum(axis=1)
        off -= level[:, None]
        self._levels += float(level.sum())
        group = (self.revolutions + np.arange(off.shape[0])) % _GROUPS
        heavy = weight * off
        np.add.at(self._weight, group, weight)
        np.add.at(self._sum, group, heavy)
        self._square += (heavy * off).sum(axis=0)
        self._w2 += (weight**2).sum(axis=0)
        self._w2x += (weight * heavy).sum(axis=0)
        self._w2xx += (heavy**2).sum(axis=0)
        self.count += weight.sum(axis=0)
        self.revolutions += off.shape[0]

    def mean(self) -> np.ndarray:
        """Return the mean by bin, NaN where there is no sample."""
        return np.asarray(self._base() + _ratio(self._sum.sum(axis=0), self.count))

    def mean_change(self) -> np.ndarray:
        """Return the mean less its own mean over the angle."""
        mean = self.mean()
        return np.asarray(mean - bridged(mean).mean())

    def groups(self) -> np.ndarray:
        """Return the means without one group each, shape (G, BINS)."""
        used = min(_GROUPS, self.revolutions)
        weight = self.count - self._weight[:used]
        return np.asarray(self._base() + _ratio(self._sum.sum(axis=0) - self._sum[:used], weight))

    def scatter(self) -> np.ndarray:
        """Return the standard deviation between revolutions by bin, shape (BINS,)."""
        mean = _ratio(self._sum.sum(axis=0), self.count)
        variance = _ratio(self._square, self.count) - mean**2
        return np.asarray(np.sqrt(np.maximum(variance * self._bessel(), 0.0)))

    def std_error(self) -> np.ndarray:
        """Return the standard error of the mean by bin, by the scatter of the revolutions about it.

        Its square is averaged over neighbouring bins: few revolutions tell the variance of one bin badly.
        """
        mean = np.nan_to_num(_ratio(self._sum.sum(axis=0), self.count))
        meat = self._w2xx - 2.0 * mean * self._w2x + mean**2 * self._w2
        square = np.maximum(np.nan_to_num(_ratio(meat, self.count**2) * self._bessel()), 0.0)
        known = (self.count > 0) & (square > 0.0)
        window = np.ones(2 * _SMOOTHED + 1)

        def around(values: np.ndarray) -> np.ndarray:
            return np.convolve(np.pad(values, _SMOOTHED, mode="wrap"), window, mode="valid")

        smooth = _ratio(around(np.where(known, square, 0.0)), around(known.astype(float)))
        return np.asarray(np.where(self.count > 0, np.sqrt(smooth), np.nan))

    def _base(self) -> np.ndarray:
        assert self._origin is not None
        return np.asarray(self._origin + self._levels / self.revolutions)

    def _bessel(self) -> np.ndarray:
        """Return n/(n - 1) of each bin, n the number of revolutions that its weights amount to."""
        n = _ratio(self.count**2, self._w2)
        return _ratio(n, np.maximum(n - 1.0, 0.2))


def _ratio(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Return the quotient, NaN where `below` is not above zero."""
    return np.asarray(np.divide(above, below, out=np.full(np.shape(above), np.nan), where=below > 0))
