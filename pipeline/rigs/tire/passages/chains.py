"""Passages in order: doubles dropped, lost ones put in, the chain broken where the wheel stood (tire.md, 5.2)."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

import numpy as np

# Two passages nearer than this share of the local period are one.
_DOUBLE, _SUSPECT = 0.5, 0.7
# An interval is so many periods if it differs from them by less than this share of one.
_OFF = 0.25
_MOST_LOST = 8
# A passage can have been lost only where less than this share of its samples is there.
_THERE = 0.8
_REACH = 0.05
# From one revolution to the next the period changes by no more than this factor, else the wheel nearly stood.
_FASTER = 1.6
# An interval so much longer than usual is no single turn if a passage can be in its gaps.
_UNSURE = 1.4
_NEIGHBOURS = 4


@dataclass(frozen=True, eq=False)
class Chain:
    """Passages one revolution apart: places (samples) and whether each was put in, shape (m,)."""

    places: np.ndarray
    repaired: np.ndarray


def chains_of(places: np.ndarray, heights: np.ndarray, valid: np.ndarray) -> tuple[list[Chain], int]:
    """Return the chains of three and more passages, and how many doubles were dropped.

    Parameters
    ----------
    places, heights
        Candidates, in samples and V, shape (p,), in order.
    valid
        How many samples are valid up to each, shape (n + 1,), cumulative.
    """
    kept = _without_doubles(places, heights)
    doubled = places.size - kept.size
    places = places[kept]
    if places.size < 3:
        return [], doubled
    chains: list[Chain] = []
    current, marks = [float(places[0])], [False]
    periods = np.diff(places)
    single = _of_one_turn(places, valid)
    for i, period in enumerate(periods.tolist()):
        usual = _usual(single, i)
        inserted = _lost_within(places[i], places[i + 1], usual, valid)
        longest = _UNSURE if _may_hide(places[i], places[i + 1], usual, valid) else _FASTER
        if inserted.size:
            current += inserted.tolist()
            marks += [True] * inserted.size
        elif not 1.0 / _FASTER < period / usual < longest and not (len(current) > 1 and _alike(single[i - 1 : i + 1])):
            chains.append(Chain(np.array(current), np.array(marks)))
            goes_on = i + 2 < single.size and _alike(single[i : i + 3])
            current, marks = ([float(places[i])], [False]) if goes_on else ([], [])
        current.append(float(places[i + 1]))
        marks.append(False)
    chains.append(Chain(np.array(current), np.array(marks)))
    return [chain for chain in chains if chain.places.size >= 3], doubled


def _without_doubles(places: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return which candidates stay: of two too near to each other the higher one."""
    kept = np.arange(places.size)
    while kept.size >= 3:
        periods = np.diff(places[kept])
        near = [i for i in np.flatnonzero(periods < _SUSPECT * np.median(periods)).tolist() if _is_double(periods, i)]
        near += [i for i in _shortest(periods) if i not in near and _is_double(periods, i)]
        if not near:
            break
        i = near[0]
        kept = np.delete(kept, i if heights[kept[i]] < heights[kept[i + 1]] else i + 1)
    return kept


def _shortest(periods: np.ndarray) -> list[int]:
    """Return the intervals that are much shorter than one beside them."""
    short = np.zeros(periods.size, dtype=bool)
    short[1:] |= periods[1:] < _SUSPECT * periods[:-1]
    short[:-1] |= periods[:-1] < _SUSPECT * periods[1:]
    return np.flatnonzero(short).tolist()


def _is_double(periods: np.ndarray, i: int) -> bool:
    """Tell whether interval i is too short, and none beside it as short: then the speed changed."""
    if periods[i] >= _DOUBLE * _usual(periods, i):
        return False
    beside = [periods[k] for k in (i - 1, i + 1) if 0 <= k < periods.size]
    return not any(abs(other / periods[i] - 1.0) < _OFF for other in beside)


def _usual(periods: np.ndarray, i: int) -> float:
    """Return the median period of up to four neighbours on either side, the nearer side of which may be another speed."""
    before = periods[max(i - _NEIGHBOURS, 0) : i].tolist()
    after = periods[i + 1 : i + 1 + _NEIGHBOURS].tolist()
    if not before and not after:
        return float(periods[i])
    middle = float(median(before + after))
    # While the speed changes, the neighbours next to the interval tell more than the median of all.
    sides = [median(side) for side in (before[-2:], after[:2]) if side]
    near = float(sum(sides) / len(sides))
    return near if abs(near / middle - 1.0) < 0.3 else middle


def _alike(periods: np.ndarray) -> bool:
    """Tell whether two or more intervals in a row are of nearly the same length: a speed that the wheel keeps."""
    return bool(periods.size > 1 and np.ptp(periods) < _OFF * periods.min())


def _of_one_turn(places: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return the intervals between candidates, each over the turns that it must hold beside the shortest next to it."""
    periods = np.diff(places)
    single = periods.copy()
    for i in range(periods.size):
        shortest = float(periods[max(i - _NEIGHBOURS, 0) : i + _NEIGHBOURS + 1].min())
        single[i] /= 1 + _lost_within(places[i], places[i + 1], shortest, valid).size
    return single


def _lost_within(begin: float, end: float, period: float, valid: np.ndarray) -> np.ndarray:
    """Return where passages must have been between two candidates: whole turns apart, and with samples lost there."""
    turns = round((end - begin) / period) if period > 0.0 else 1
    if not 2 <= turns <= _MOST_LOST or abs((end - begin) / period - turns) > _OFF:
        return np.zeros(0)
    inserted = np.linspace(begin, end, turns + 1)[1:-1]
    return inserted if all(_lost(valid, at, period) for at in inserted) else np.zeros(0)


def _may_hide(begin: float, end: float, period: float, valid: np.ndarray) -> bool:
    """Tell whether a gap between two candidates is so long that a passage can be in it."""
    counted, longest = valid[int(begin) : int(end) + 1], max(int(_REACH * period), 1)
    return bool(np.any(counted[longest:] == counted[:-longest]))


def _lost(valid: np.ndarray, at: float, period: float) -> bool:
    begin = int(np.clip(at - _REACH * period, 0, valid.size - 1))
    end = int(np.clip(at + _REACH * period + 1, 0, valid.size - 1))
    return bool(end <= begin or (valid[end] - valid[begin]) < _THERE * (end - begin))
