"""The two units held against each other at one tap: skew removed, then threshold for speed, cumulative sums for drifts (rap.md, 3.10)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms.cusum import second_means, threshold_onsets
from pipeline.rigs.rap.alarms.frozen import LONGEST, frozen_spans
from pipeline.rigs.rap.alarms.limits import MismatchLimits
from pipeline.rigs.rap.alarms.mismatch_watch import watched
from pipeline.rigs.rap.alarms.pump import RATE_NEEDED
from pipeline.rigs.rap.alarms.rates import rate
from pipeline.rigs.rap.alarms.results import Mismatch, Redundancy
from pipeline.rigs.rap.alarms.skew import skew_of
from pipeline.rigs.rap.alarms.unit_faults import incomparable
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.tables import Signal
from pipeline.signals.resampling import interpolated

# Seconds that scatter by more than this share of the allowance make the cumulative sums wander.
_STEADY = 0.75
# A threshold this many standard deviations of the samples out is seldom crossed three times in a row.
_CLEAR = 4.0
# A skew this large makes the raw difference pulsate noticeably, s.
_SKEW_TOLD = 2e-3


def redundancy(run: str, tap: str, control: Signal, protective: Signal, limits: MismatchLimits) -> Redundancy | None:
    """Return what the two units make of one tap; None where they share no second of time."""
    grid, reference, other = _common(control, protective)
    if grid.size < 20:
        return None
    seconds = float(grid[-1] - grid[0])
    why = incomparable(reference, other)
    if why:
        return _not_compared(run, tap, why, seconds)
    raw = other - reference
    skew = skew_of(grid, reference, other)
    kept = raw.copy()
    if skew is not None and abs(skew.value) > 2.0 * skew.error:
        kept = other - interpolated(grid, reference, grid + skew.at_times(grid))
    still = _frozen(tap, grid, reference, other)
    for mismatch in still:
        kept[(grid >= mismatch.onset) & (grid <= (mismatch.end or grid[-1]))] = np.nan
    noise = 1.4826 * float(np.nanmedian(np.abs(kept - np.nanmedian(kept)))) if np.isfinite(kept).any() else float("nan")
    scatter, slow = _scatter(grid, kept)
    problems = _of_skew(run, tap, skew.value if skew is not None else 0.0)
    if scatter > _STEADY * limits.allowance:
        if slow:
            why = f"the units' difference scatters by {scatter:.0f} Pa, too much for a mismatch of {limits.allowance:g} Pa to be told; log both at 20 Hz"
            return _not_compared(run, tap, why, seconds)
        limits = _widened(limits, scatter, noise)
        problems += _of_widening(run, tap, scatter, limits)
    seen = watched(tap, grid, kept, noise, limits)
    ordered = sorted([*still, *seen.mismatches], key=lambda m: m.time)
    mismatches = tuple(replace(m, index=i) for i, m in enumerate(ordered, start=1))
    false_raw, false_kept = (
        rate(_outside(grid, threshold_onsets(r, limits.threshold, limits.samples), mismatches), seconds)
        for r in (raw, kept)
    )
    value, error = (skew.value, skew.error) if skew is not None else (float("nan"), float("nan"))
    return Redundancy(
        tap, value, error, noise, seen.ends, seen.means, seen.up, seen.down, mismatches, false_raw, false_kept, problems
    )  # fmt: skip


def _common(control: Signal, protective: Signal) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the stamps of the control unit that both units cover, and what either reads there, shape (n,) each."""
    start, end = max(control.time[0], protective.time[0]), min(control.time[-1], protective.time[-1])
    inside = (control.time >= start) & (control.time <= end)
    grid = control.time[inside]
    same = protective.time.size == control.time.size and np.array_equal(protective.time, control.time)
    other = protective.values[inside] if same else interpolated(protective.time, protective.values, grid)
    found = np.isfinite(other)
    return grid[found], control.values[inside][found], other[found]


def _widened(limits: MismatchLimits, scatter: float, noise: float) -> MismatchLimits:
    """Return limits that a difference which scatters more than usual does not cross by itself."""
    allowance = scatter / _STEADY
    limit = allowance * limits.limit / limits.allowance
    return replace(limits, allowance=allowance, limit=limit, threshold=max(limits.threshold, _CLEAR * noise))


def _frozen(tap: str, time: np.ndarray, control: np.ndarray, protective: np.ndarray) -> list[Mismatch]:
    """Return the mismatches in which one unit stands still and the other goes on."""
    difference = np.abs(protective - control)
    found = []
    for one, other in ((control, protective), (protective, control)):
        for start, end in frozen_spans(time, one, other):
            inside = (time >= start) & (time <= end)
            gone = end if end < time[-1] else None
            size = float(np.max(difference[inside]))
            error = float(np.median(np.diff(time))) / np.sqrt(12.0)
            found.append(Mismatch(tap, 0, start + LONGEST, float(error), start, "stuck", size, None, None, gone))
    return found


def _scatter(time: np.ndarray, residual: np.ndarray) -> tuple[float, bool]:
    """Return how far the seconds of a residual scatter (Pa), and whether the log is too slow for the pulsation.

    Such a log carries the skew's share of the pulsation as a slow wave: there the spread of the whole run counts.
    """
    _, means, _ = second_means(time, residual)
    slow = 1.0 / float(np.median(np.diff(time))) < RATE_NEEDED
    if means.size < 10:
        return 0.0, slow
    spread = np.abs(means - np.median(means)) if slow else np.abs(np.diff(means)) / np.sqrt(2.0)
    return float(np.median(spread)) / 0.6745, slow


def _not_compared(run: str, tap: str, why: str, seconds: float) -> Redundancy:
    nothing = np.zeros(0)
    told = QualityFinding("warning", f"{TAP_NAMES[tap]}: {why}. The two units are not compared at this tap.", run)
    none = rate(0, seconds)
    nan = float("nan")
    return Redundancy(tap, nan, nan, nan, nothing, nothing, nothing, nothing, (), none, none, (told,))


def _outside(grid: np.ndarray, onsets: np.ndarray, mismatches: tuple[Mismatch, ...]) -> int:
    times = grid[onsets]
    inside = np.zeros(times.size, bool)
    for m in mismatches:
        inside |= (times >= m.onset - 1.0) & (times <= (m.end if m.end is not None else np.inf))
    return int(np.sum(~inside))


def _of_widening(run: str, tap: str, scatter: float, limits: MismatchLimits) -> tuple[QualityFinding, ...]:
    message = (
        f"{TAP_NAMES[tap]}: the units' difference scatters by {scatter:.0f} Pa from second to second; the allowance of the cumulative "
        f"sums is widened to {limits.allowance:.0f} Pa, the threshold is {limits.threshold:.0f} Pa, and smaller mismatches are not seen."
    )
    return (QualityFinding("warning", message, run),)


def _of_skew(run: str, tap: str, skew: float) -> tuple[QualityFinding, ...]:
    if not abs(skew) > _SKEW_TOLD:
        return ()
    message = (
        f"{TAP_NAMES[tap]}: the protective unit samples {abs(1e3 * skew):.1f} ms {'later' if skew > 0 else 'earlier'} than the control "
        "unit. Their raw difference pulsates with the pump; a threshold on it is not valid. The skew is removed first."
    )
    return (QualityFinding("note", message, run),)
