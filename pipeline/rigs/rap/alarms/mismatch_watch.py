"""Mismatches of one tap from its residual: the two schemes run together, and start anew behind each mismatch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.alarms.cusum import cumulative, second_means, threshold_onsets
from pipeline.rigs.rap.alarms.limits import MismatchLimits
from pipeline.rigs.rap.alarms.mismatch_kind import described
from pipeline.rigs.rap.alarms.results import Mismatch

# The units agree again where the residual has been small for this many seconds.
_QUIET = 5


@dataclass(frozen=True, eq=False)
class Watched:
    """Mismatches, and the 1 s means with both cumulative sums, shape (m,), s and Pa."""

    mismatches: tuple[Mismatch, ...]
    ends: np.ndarray
    means: np.ndarray
    up: np.ndarray
    down: np.ndarray


def watched(tap: str, time: np.ndarray, residual: np.ndarray, noise: float, limits: MismatchLimits) -> Watched:
    """Return what threshold and cumulative sums find in a residual.

    Parameters
    ----------
    time, residual
        Stamps (s) and protective less control unit without skew (Pa; NaN where not to be judged), shape (n,).
    noise
        Standard deviation of its samples, Pa.
    """
    ends, means, size = second_means(time, residual)
    up, down = np.zeros(ends.size), np.zeros(ends.size)
    jumps = time[threshold_onsets(residual, limits.threshold, limits.samples)]
    quiet = (np.abs(means) <= limits.allowance) & (size <= max(4.0 * noise, limits.allowance))
    found: list[Mismatch] = []
    k = 0
    while k < ends.size:
        up[k:], down[k:] = cumulative(means[k:], limits.allowance), cumulative(-means[k:], limits.allowance)
        over = np.flatnonzero((up[k:] > limits.limit) | (down[k:] > limits.limit))
        by_cusum = float(ends[k + over[0]]) if over.size else None
        began = float(ends[k]) - 1.0
        later = jumps[jumps >= began]
        by_threshold = float(later[0]) if later.size else None
        if by_cusum is None and by_threshold is None:
            break
        first = min(t for t in (by_cusum, by_threshold) if t is not None)
        calm = _calm_from(quiet, int(np.searchsorted(ends, first)) + 1)
        end = float(ends[calm - 1]) if calm is not None else None
        last = max(end if end is not None else float(time[-1]), first)
        by = tuple(t if t is not None and t <= last else None for t in (by_threshold, by_cusum))
        found.append(described(tap, len(found) + 1, (by[0], by[1]), (began, last), end, time, residual))
        if calm is None:
            break
        k = calm
    return Watched(tuple(found), ends, means, up, down)


def _calm_from(quiet: np.ndarray, start: int) -> int | None:
    """Return the first index from `start` from which `_QUIET` seconds in a row are quiet; None where there are none."""
    if quiet.size - start < _QUIET:
        return None
    rows = np.convolve(quiet[start:].astype(int), np.ones(_QUIET, int), "valid")
    place = np.flatnonzero(rows == _QUIET)
    return int(place[0]) + start if place.size else None
