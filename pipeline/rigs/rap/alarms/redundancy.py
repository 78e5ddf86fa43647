"""The two units held against each other at one tap: skew removed, then threshold for speed, cumulative sums for drifts (rap.md, 3.10)."""

from __future__ import annotations

import numpy as np

from pipeline.recording import QualityFinding
from pipeline.rigs.rap.alarms.cusum import cumulative, second_means, threshold_onsets
from pipeline.rigs.rap.alarms.limits import MismatchLimits
from pipeline.rigs.rap.alarms.mismatch_kind import described
from pipeline.rigs.rap.alarms.rates import rate
from pipeline.rigs.rap.alarms.results import Mismatch, Redundancy
from pipeline.rigs.rap.alarms.skew import skew_of
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.tables import Signal
from pipeline.signals.resampling import interpolated

# The units agree again where the residual has been small for this many seconds.
_QUIET = 5
# A skew this large makes the raw difference pulsate noticeably, s.
_SKEW_TOLD = 2e-3


def redundancy(run: str, tap: str, control: Signal, protective: Signal, limits: MismatchLimits) -> Redundancy | None:
    """Return what the two units make of one tap; None where they share no second of time."""
    start, end = max(control.time[0], protective.time[0]), min(control.time[-1], protective.time[-1])
    grid = control.time[(control.time >= start) & (control.time <= end)]
    if grid.size < 20:
        return None
    reference = control.values[(control.time >= start) & (control.time <= end)]
    same = protective.time.size == control.time.size and np.array_equal(protective.time, control.time)
    other = protective.values if same else interpolated(protective.time, protective.values, grid)
    found = np.isfinite(other)
    grid, reference, other = grid[found], reference[found], other[found]
    if grid.size < 20:
        return None
    raw = other - reference
    skew = skew_of(grid, reference, other)
    kept = raw
    if skew is not None and abs(skew.value) > 2.0 * skew.error:
        moved = interpolated(grid, reference, grid + skew.at_times(grid))
        kept = np.where(np.isfinite(moved), other - moved, raw)
        kept[~np.isfinite(moved)] = np.nan
    noise = 1.4826 * float(np.nanmedian(np.abs(kept - np.nanmedian(kept))))
    ends, means, size = second_means(grid, kept)
    mismatches, up, down = _episodes(tap, grid, kept, ends, means, size, noise, limits, reference, other)
    hours = float(grid[-1] - grid[0])
    return Redundancy(
        tap,
        skew.value if skew is not None else float("nan"),
        skew.error if skew is not None else float("nan"),
        noise,
        ends,
        means,
        up,
        down,
        mismatches,
        rate(_outside(grid, threshold_onsets(raw, limits.threshold, limits.samples), mismatches), hours),
        rate(_outside(grid, threshold_onsets(kept, limits.threshold, limits.samples), mismatches), hours),
        _problems(run, tap, skew.value if skew is not None else float("nan"), reference, other),
    )


def _episodes(
    tap: str,
    grid: np.ndarray,
    kept: np.ndarray,
    ends: np.ndarray,
    means: np.ndarray,
    size: np.ndarray,
    noise: float,
    limits: MismatchLimits,
    control: np.ndarray,
    protective: np.ndarray,
) -> tuple[tuple[Mismatch, ...], np.ndarray, np.ndarray]:
    """Return the mismatches and the cumulative sums, which start anew behind each of them."""
    up, down = np.zeros(ends.size), np.zeros(ends.size)
    jumps = grid[threshold_onsets(kept, limits.threshold, limits.samples)]
    # The last second may be cut short; a mean of few samples is no ground.
    quiet = (np.abs(means) <= limits.allowance) & (size <= max(4.0 * noise, limits.allowance))
    found: list[Mismatch] = []
    k = 0
    while k < ends.size:
        up[k:], down[k:] = cumulative(means[k:], limits.allowance), cumulative(-means[k:], limits.allowance)
        over = np.flatnonzero((up[k:] > limits.limit) | (down[k:] > limits.limit))
        by_cusum = float(ends[k + over[0]]) if over.size else None
        began = ends[k] - 1.0
        later = jumps[jumps >= began]
        by_threshold = float(later[0]) if later.size else None
        if by_cusum is None and by_threshold is None:
            break
        first = min(t for t in (by_cusum, by_threshold) if t is not None)
        i = int(np.searchsorted(ends, first))
        calm = _calm_from(quiet, i + 1)
        end = float(ends[calm - 1]) if calm is not None and calm <= ends.size else None
        last = end if end is not None else float(grid[-1])
        times = tuple(t if t is not None and t <= last else None for t in (by_threshold, by_cusum))
        within = (float(began), last)
        found.append(described(tap, len(found) + 1, (times[0], times[1]), within, end, grid, kept, control, protective))
        if calm is None:
            break
        k = calm
    return tuple(found), up, down


def _calm_from(quiet: np.ndarray, start: int) -> int | None:
    """Return the first index from `start` from which `_QUIET` seconds in a row are quiet; None where there are none."""
    if quiet.size - start < _QUIET:
        return None
    rows = np.convolve(quiet[start:].astype(int), np.ones(_QUIET, int), "valid")
    place = np.flatnonzero(rows == _QUIET)
    return int(place[0]) + start if place.size else None


def _outside(grid: np.ndarray, onsets: np.ndarray, mismatches: tuple[Mismatch, ...]) -> int:
    times = grid[onsets]
    inside = np.zeros(times.size, bool)
    for m in mismatches:
        inside |= (times >= m.onset - 1.0) & (times <= (m.end if m.end is not None else np.inf))
    return int(np.sum(~inside))


def _problems(
    run: str, tap: str, skew: float, control: np.ndarray, protective: np.ndarray
) -> tuple[QualityFinding, ...]:
    name = TAP_NAMES[tap]
    told = []
    scatter = float(np.std(control)), float(np.std(protective))
    if min(scatter) > 0.0:
        factor = scatter[1] / scatter[0]
        alike = float(np.corrcoef(control, protective)[0, 1])
        if abs(alike) > 0.8 and not 0.5 < factor < 2.0:
            told.append(
                f"{name}: the protective unit's pressure is {factor:.3g} times the control unit's; look for mixed units (mmHg, kPa, Pa)"
            )
        if alike < -0.8:
            told.append(
                f"{name}: the protective unit's pressure runs against the control unit's; look for a turned sign"
            )
    if abs(skew) > _SKEW_TOLD:
        words = f"{name}: the protective unit samples {abs(1e3 * skew):.1f} ms {'later' if skew > 0 else 'earlier'} than the control unit"
        return (
            *(QualityFinding("warning", f"{message}.", run) for message in told),
            QualityFinding(
                "note",
                f"{words}. Their raw difference pulsates with the pump; a threshold on it is not valid. The skew is removed first.",
                run,
            ),
        )
    return tuple(QualityFinding("warning", f"{message}.", run) for message in told)
