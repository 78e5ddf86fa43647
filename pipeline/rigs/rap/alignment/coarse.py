"""Lag from starts, stops and steps alone, over +-30 s, and whether another lag fits as well (rap.md, 5.1 a).

The result is good to some hundredths of a second: which stroke is which. The fine part is in `fine`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.rigs.rap.alignment.features import STEP, Course, correlation, course
from pipeline.rigs.rap.alignment.pair import Pair
from pipeline.rigs.rap.alignment.result import Coarse

SEARCH = 30.0
"""How far stamps of one run lie apart at the most, s; beyond it is looked only where nothing is found within."""
AMBIGUOUS = 0.9
# Below that correlation lags beyond the usual are tried as well, and taken where they reach it.
_GOOD = 0.9
# A pair counts where its correlation is that high; against the others where it is that low.
_AGAINST = 0.7
# Over that time a feature must change the level by this share of the largest pulsation, s and 1.
_FEATURE_TIME, _FEATURE = 3.0, 0.25
# Of runs longer than that only what lies so near to the strongest feature counts, s; no clock drifts faster, relative. From
# that peak on the whole of a run tells where to look.
_LONG, _AROUND, _FASTEST, _FOUND_ROUGHLY = 1800.0, 120.0, 500e-6, 0.3
# Two peaks lie further apart than a feature is wide, s.
_APART = 1.0


def coarse_lag(pairs: Sequence[Pair], search: float = SEARCH) -> Coarse:
    """Return the lag that what is aperiodic in the pairs tells.

    Parameters
    ----------
    pairs
        At least one.
    search
        Lags up to that, s; all lags with overlap are searched where none within it fits.
    """
    step = max(STEP, 0.5 * max(max(1.0 / pair.device.rate, 1.0 / pair.bench.rate) for pair in pairs))
    courses = [(pair, course(pair.device, step), course(pair.bench, step)) for pair in pairs]
    featured = _featured(courses)
    found = _best(courses, -search, search)
    if found is None or found.peak < _GOOD:
        wide = _best(courses, -np.inf, np.inf)
        if wide is not None and (found is None or wide.peak > max(found.peak + 0.1, _GOOD)):
            found = replace(wide, wide=True)
    if found is not None and found.peak >= _FOUND_ROUGHLY:
        found = _about_one_feature(courses, found) or found
    if found is None:
        nothing = np.empty(0)
        return Coarse(np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, nothing, nothing, featured=False)
    return replace(found, featured=featured)


def _about_one_feature(courses: Sequence[tuple[Pair, Course, Course]], found: Coarse) -> Coarse | None:
    """Return the lag about the strongest feature of a long run, in which a drift smears what lies hours apart.

    None for short runs, or where that feature tells less than the whole.
    """
    longest = max((bench for _, _, bench in courses), key=lambda one: one.slope.size)
    if longest.slope.size * longest.step < _LONG:
        return None
    size = sum(
        np.interp(_moments(longest), _moments(b), b.slope**2) / max(float(b.slope @ b.slope), 1e-300)
        for _, _, b in courses
    )
    middle = float(_moments(longest)[int(np.argmax(size))])
    near = [(pair, device, _part(bench, middle - _AROUND, middle + _AROUND)) for pair, device, bench in courses]
    near = [one for one in near if one[2].slope.size > 10 and float(one[2].slope @ one[2].slope) > 0.0]
    drift = _FASTEST * longest.slope.size * longest.step
    one = _best(near, found.lag - _AROUND, found.lag + _AROUND) if near else None
    if one is None or not one.peak > max(found.peak, _AGAINST) or abs(one.lag - found.lag) > drift + _APART:
        return None
    return replace(one, wide=found.wide, flipped=found.flipped)


def _moments(one: Course) -> np.ndarray:
    """Return the middles of the bins, s, shape (n,)."""
    return np.asarray(one.start + one.step * np.arange(one.slope.size))


def _part(one: Course, first: float, last: float) -> Course:
    """Return a course between two moments, s."""
    inside = slice(max(round((first - one.start) / one.step), 0), max(round((last - one.start) / one.step), 0))
    start = one.start + one.step * (inside.start or 0)
    return Course(start, one.step, one.slope[inside], one.known[inside], one.level[inside])


def _featured(courses: Sequence[tuple[Pair, Course, Course]]) -> bool:
    """Tell whether a level changes within seconds by more than pulsation and noise let it."""
    pulsation = max(
        (np.sqrt(2.0) * _about_level(pair) for pair, _, _ in courses if pair.alike),
        default=0.0,
    )
    changes = []
    for pair, device, bench in courses:
        both = []
        for one in (device, bench):
            gap = max(round(_FEATURE_TIME / one.step), 1)
            change = np.abs(one.level[gap:] - one.level[:-gap]) * (one.known[gap:] & one.known[:-gap])
            usual = float(np.median(change))
            both.append(
                float(change.max(initial=0.0)) / max(_FEATURE * pulsation if pair.alike else 0.0, 6.0 * usual, 1e-300)
            )
        changes.append(min(both))
    return max(changes, default=0.0) > 1.0


def _prominence(one: Course) -> float:
    """Return the power of a course over what it would be with its median slope all along: large where it has features."""
    power = one.slope[one.known] ** 2
    usual = float(np.median(power)) / 0.455 if power.size else 0.0
    return max(float(power.mean()) / usual - 1.0, 0.01) if usual > 0 else 1e6


def _about_level(pair: Pair) -> float:
    """Return the usual standard deviation of the bench's channel within two seconds, its unit."""
    size = max(round(2.0 * pair.bench.rate), 4)
    count = pair.bench.values.size // size
    if not count:
        return float(np.std(pair.bench.values))
    return float(np.median(np.std(pair.bench.values[: count * size].reshape(count, size), axis=1)))


def _best(courses: Sequence[tuple[Pair, Course, Course]], lowest: float, highest: float) -> Coarse | None:
    """Return the highest peak of the mean correlation between two lags; None where nothing overlaps."""
    each = []
    lags: np.ndarray | None = None
    for pair, device, bench in courses:
        at, value = correlation(device, bench, lowest, highest)
        if not np.isfinite(value).any():
            continue
        extreme = float(value[int(np.nanargmax(np.abs(value)))])
        # What is alike rises and falls together; only where there is nothing to compare with is a flipped one followed.
        sign = float(np.sign(extreme)) if len(courses) == 1 or not pair.alike else 1.0
        each.append((pair, at, value, sign, min(_prominence(device), _prominence(bench))))
        lags = at if lags is None else lags
    if lags is None:
        return None
    grid = np.round(lags / courses[0][1].step) * courses[0][1].step if len(each) > 1 else lags
    weight, total = np.zeros(grid.size), np.zeros(grid.size)
    singles = []
    for pair, at, value, sign, prominence in each:
        known = np.isfinite(value)
        on_grid = np.interp(grid, at[known], sign * value[known], left=np.nan, right=np.nan)
        power = prominence * float(np.nanmax(np.abs(value))) ** 4
        inside = np.isfinite(on_grid)
        total[inside] += power * on_grid[inside]
        weight[inside] += power
        if pair.alike:
            singles.append((pair.name, sign * on_grid))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(weight > 0.5 * weight.max(), total / weight, np.nan)
    best = int(np.argmax(np.where(np.isfinite(mean), mean, -2.0)))
    flipped = [name for name, value in singles if value[best] < -_AGAINST]
    if flipped and len(flipped) < len(singles):
        # Without those that run against the others the peak is what the others tell.
        others = [one for one in courses if one[0].name not in flipped]
        again = _best(others, lowest, highest)
        return replace(again, flipped=tuple(flipped)) if again is not None else None
    return _peaks(courses, grid, mean, tuple(flipped))


def _peaks(
    courses: Sequence[tuple[Pair, Course, Course]], lags: np.ndarray, mean: np.ndarray, flipped: tuple[str, ...]
) -> Coarse:
    filled = np.where(np.isfinite(mean), mean, -2.0)
    best = int(filled.argmax())
    lag = float(lags[best])
    if 0 < best < lags.size - 1 and min(filled[best - 1], filled[best + 1]) > -2.0:
        left, centre, right = filled[best - 1 : best + 2]
        bend = left - 2.0 * centre + right
        lag += 0.5 * (left - right) / bend * (lags[1] - lags[0]) if bend < 0 else 0.0
    inner = np.flatnonzero((filled[1:-1] >= filled[:-2]) & (filled[1:-1] >= filled[2:])) + 1
    others = inner[np.abs(lags[inner] - lag) > _APART]
    second = int(others[filled[others].argmax()]) if others.size else -1
    bench = courses[0][2]
    at = float(np.average(_moments(bench), weights=bench.slope**2 + 1e-300))
    return Coarse(
        lag,
        0.05,
        at,
        float(filled[best]),
        max(float(filled[second]), 0.0) if others.size else 0.0,
        float(lags[second]) if others.size else float("nan"),
        lags,
        mean,
        flipped=flipped,
    )
