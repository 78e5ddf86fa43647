"""What kind of excitation a record holds, and which part of it is to be used.

Still stretches before and after the motion, then: ramp, half a cycle (one load-unload stroke),
periodic (how many whole cycles, steady or not), sweep, or non-periodic. Every verdict carries the
numbers that it rests on. Frequencies here are good enough to decide; the harmonic regression of the
estimation floor refines them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.errors import InputError
from pipeline.signals.cycles import Cycles, cut, turning_points
from pipeline.signals.periodogram import block_means, strongest_line

Kind = Literal["still", "ramp", "half_cycle", "periodic", "sweep", "non_periodic"]

# A cycle is steady whose amplitude is within 5 % of the median and whose shape is that of the others.
TOLERANCE = 0.05
_SAME_SHAPE = 0.985
# Neighbours of narrow-band noise may be alike; all of its cycles are not.
_SIMILAR, _COMMON = 0.85, 0.88
_MOST = 100_000


@dataclass(frozen=True)
class Excitation:
    """What was found.

    Attributes
    ----------
    kind
        The verdict; `reason` says in one sentence why, `remarks` what else is to be known.
    moving
        From when to when the signal moves, s.
    still_before, still_after
        Length of the still stretches at both ends, s.
    strokes
        Number of monotonic strokes of more than 5 % of the range.
    frequency
        Of a periodic record, Hz; None else.
    cycles
        Whole cycles in the moving part.
    steady
        From when to when the cycles are steady, s, a whole number of `steady_cycles` of them; None
        where no cycle is.
    amplitude
        Median amplitude of the cycles (rms times sqrt 2), or half the range, in the unit given.
    amplitude_change
        Range of the cycles' amplitudes over `amplitude`.
    mean_drift
        Range of the cycles' means over `amplitude`.
    similarity, common_share
        Correlation of neighbouring cycles, and share of the motion that all cycles have in common.
    band
        Lowest and highest frequency of a sweep; of a non-periodic record those between which 90 % of
        its power lie, Hz.
    """

    kind: Kind
    reason: str
    remarks: tuple[str, ...]
    moving: tuple[float, float]
    still_before: float = 0.0
    still_after: float = 0.0
    strokes: int = 0
    frequency: float | None = None
    cycles: int = 0
    steady: tuple[float, float] | None = None
    steady_cycles: int = 0
    amplitude: float = 0.0
    amplitude_change: float = float("nan")
    mean_drift: float = float("nan")
    similarity: float = float("nan")
    common_share: float = float("nan")
    band: tuple[float, float] | None = None


def classify(time: np.ndarray, values: np.ndarray, noise: float | None = None) -> Excitation:
    """Tell what kind of motion a record holds.

    Parameters
    ----------
    time, values
        Stamps (s, increasing) and samples, shape (n,), best of the driven quantity; NaN do not count.
    noise
        Standard deviation of the noise, if known; else it is taken from third differences.

    Raises
    ------
    InputError
        If fewer than 8 samples are valid.

    Examples
    --------
    >>> t = np.arange(0, 6, 0.01)
    >>> found = classify(t, np.where(t < 2, 0, np.sin(2 * np.pi * 1.5 * (t - 2))))
    >>> found.kind, round(found.frequency, 3), found.cycles, round(found.still_before, 1)
    ('periodic', 1.5, 6, 2.0)
    """
    kept = np.isfinite(values) & np.isfinite(time)
    t, x = np.asarray(time, dtype=float)[kept], np.asarray(values, dtype=float)[kept]
    if t.size < 8:
        raise InputError(f"{t.size} valid samples are too few to tell what motion this is; at least 8 are needed.")
    span = float(np.subtract(*np.quantile(x, [0.999, 0.001])))
    sigma = _noise(x) if noise is None else noise
    if span <= 1e-12 * np.abs(x).max() or (span <= 8 * sigma and (noise is not None or _is_white(x))):
        reason = f"the signal stays within {span:.3g}, no more than its noise of {sigma:.2g}"
        return Excitation("still", reason, (), (float(t[0]), float(t[0])), still_before=float(t[-1] - t[0]))
    start, end = _first_motion(t, x, span, sigma), -_first_motion(-t[::-1], x[::-1], span, sigma)
    height = min(max(6 * sigma, 0.05 * span), 0.2 * span)
    part = _Part(t, x, start, end, height)
    if part.turns.size > 2:  # a hold no longer than the strokes belongs to the motion
        stroke = (part.end - part.start) / part.turns.size
        start = start if start - t[0] > stroke else float(t[0])
        end = end if t[-1] - end > stroke else float(t[-1])
        part = _Part(t, x, start, end, height)
    before, after = part.start - float(t[0]), float(t[-1]) - part.end
    told = [f"nothing moves in the first {before:.3g} s"] if before > 0 else []
    told += [f"nothing moves in the last {after:.3g} s"] if after > 0 else []
    found = _of_motion(part)
    return replace(
        found,
        remarks=(*told, *found.remarks),
        still_before=before,
        still_after=after,
        amplitude=found.amplitude or span / 2,
    )


class _Part:
    """The moving part of a record, thinned where it is long, and where its strokes begin."""

    def __init__(self, t: np.ndarray, x: np.ndarray, start: float, end: float, height: float) -> None:
        inside = (t >= start) & (t <= end)
        if inside.sum() < 8:
            start, end, inside = float(t[0]), float(t[-1]), np.full(t.size, True)
        self.start, self.end = start, end
        self.t, self.x = t[inside], x[inside]
        self.thin_t, self.thin_x = block_means(self.t, self.x, -(-self.t.size // _MOST))
        self.turns = turning_points(self.thin_x, height)

    def found(self, kind: Kind, reason: str, *remarks: str) -> Excitation:
        return Excitation(kind, reason, remarks, (self.start, self.end), strokes=int(self.turns.size))


def _of_motion(part: _Part) -> Excitation:
    if part.turns.size < 3:
        return _few_strokes(part)
    cycles, why = _periodic(part)
    if cycles is not None:
        return _described(part, cycles)
    sweep = _sweep(part.thin_t[part.turns])
    if sweep:
        told = part.found("sweep", f"the frequency runs from {sweep[0]:.3g} to {sweep[1]:.3g} Hz in small steps")
        return replace(told, band=sweep)
    band = _band(part.thin_t, part.thin_x)
    width = f"90 % of the power from {band[0]:.3g} to {band[1]:.3g} Hz"
    reason = f"{part.turns.size} strokes without a common period ({why}); {width}"
    return replace(part.found("non_periodic", reason), band=band)


def _noise(x: np.ndarray) -> float:
    """Return the sd of white noise from third differences, which a smooth motion hardly has."""
    differences = np.diff(x, 3)
    return float(np.median(np.abs(differences)) / 0.6745 / np.sqrt(20))


def _is_white(x: np.ndarray) -> bool:
    """Tell noise from motion that is sampled so coarsely that differences take it for noise."""
    centred = x - x.mean()
    lags = range(1, min(12, x.size // 3))
    return all(abs(centred[lag:] @ centred[:-lag]) < 0.5 * (centred @ centred) for lag in lags)


def _first_motion(t: np.ndarray, x: np.ndarray, span: float, sigma: float) -> float:
    """Return when the motion begins; the first stamp where it is under way from the start.

    Still is what stays within a narrow band five times as long as it then takes to get twice the
    band further: a turning point of any smooth motion stays less than three times as long.
    """
    band = min(max(0.01 * span, 6 * sigma), 0.1 * span)
    first = int(np.argmax(np.abs(x - x[0]) > band))
    away = np.abs(x - np.median(x[: max(first, 1)]))
    # Three in a row, so that a single wrong sample starts nothing.
    lasting = np.minimum(np.minimum(away[:-2], away[1:-1]), away[2:])
    leaves = int(np.argmax(lasting > band))
    further = leaves + int(np.argmax(lasting[leaves:] > 3 * band))
    dwell, pace = t[leaves] - t[0], max(t[further] - t[leaves], 0.0)
    if leaves < 5 or dwell <= 5 * pace:
        return float(t[0])
    return float(max(t[leaves] - 0.5 * pace, t[0]))


def _few_strokes(part: _Part) -> Excitation:
    x, turns = part.thin_x, part.turns
    if turns.size < 2:
        return part.found("ramp", "one stroke without a reversal")
    top = x[turns[1]]
    there, back = abs(top - x[turns[0]]), float(np.abs(x[turns[1] :] - top).max())
    if back > 1.5 * there:
        return part.found("non_periodic", "two strokes, the second far beyond the start: less than one cycle")
    short = abs(x[-1] - top) / there
    remarks = [f"it comes back by {100 * short:.0f} % only"] if short < 0.9 else []
    return part.found("half_cycle", "one stroke there and one back: half a cycle only", *remarks)


def _periodic(part: _Part) -> tuple[Cycles | None, str]:
    """Return the cycles if the motion repeats, else in words why not."""
    try:
        line = strongest_line(part.t, part.x)
    except InputError as error:
        return None, str(error)
    duration = part.end - part.start
    if duration * line < 0.95:
        return None, "less than one cycle"
    best = cut(part.t, part.x, part.start, part.end, line)
    for multiple in (2, 3, 4):  # the strongest line may be a harmonic of the true period
        if duration * line / multiple < 1.98:
            break
        longer = cut(part.t, part.x, part.start, part.end, line / multiple, waves=multiple)
        if 1 - longer.similarity < 0.5 * (1 - best.similarity) and best.similarity < 0.99:
            best = longer
    if best.count == 1:
        share = best.simple_share
        return (best, "") if share > 0.95 else (None, f"one cycle of no simple form, three harmonics hold {share:.2f}")
    if not (best.similarity > _SIMILAR and best.common_share > _COMMON):
        return None, f"neighbouring cycles correlate by {best.similarity:.2f}, all share {best.common_share:.2f}"
    return best, ""


def _described(part: _Part, cycles: Cycles) -> Excitation:
    amplitude, gap = cycles.amplitude, ~np.isfinite(cycles.amplitude)
    typical = float(np.nanmedian(amplitude))
    change, drift = (float(np.ptp(series[~gap]) / typical) for series in (amplitude, cycles.mean))
    with np.errstate(invalid="ignore"):
        good = (np.abs(amplitude / typical - 1) < TOLERANCE) & (cycles.likeness > _SAME_SHAPE)
    first, last = _longest_run(good | gap)  # a gap costs samples, not the steady state
    steady = last - first if last - first > 1 or cycles.count < 3 else 0
    told = []
    if steady == 0:
        told.append(f"no two cycles are alike: the amplitude changes by {100 * change:.0f} %")
    elif steady < cycles.count:
        where = f"cycles {first + 1} to {last} of {cycles.count} are steady"
        if last == cycles.count:
            where = f"{_counted(first, cycles.count)} not steady yet"
        told.append(f"{where}; over all of them the amplitude changes by {100 * change:.0f} %")
    if drift > TOLERANCE:
        told.append(f"the mean drifts by {drift * typical:.3g}, {100 * drift:.0f} % of the amplitude")
    if gap.any():
        told.append(f"gaps fall into {int(gap.sum())} of the {cycles.count} cycles")
    frequency, begin = 1 / cycles.period, cycles.start + first * cycles.period
    several = f"s of {frequency:.4g} Hz, neighbours correlate by {cycles.similarity:.3f}"
    ending = several if cycles.count > 1 else f" of {frequency:.4g} Hz"
    return replace(
        part.found("periodic", f"{cycles.count} whole cycle{ending}", *told),
        frequency=frequency,
        cycles=cycles.count,
        steady=(begin, begin + steady * cycles.period) if steady else None,
        steady_cycles=steady,
        amplitude=typical,
        amplitude_change=change,
        mean_drift=drift,
        similarity=cycles.similarity,
        common_share=cycles.common_share,
    )


def _counted(first: int, count: int) -> str:
    return f"the first of {count} cycles is" if first == 1 else f"the first {first} of {count} cycles are"


def _longest_run(good: np.ndarray) -> tuple[int, int]:
    """Return first and last + 1 of the longest run of True; (0, 0) for none."""
    edges = np.flatnonzero(np.diff(np.r_[False, good, False].astype(int)))
    if not edges.size:
        return 0, 0
    starts, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]), int(ends[longest])


def _sweep(turns: np.ndarray) -> tuple[float, float] | None:
    """Return lowest and highest frequency if the time between turning points (s) changes smoothly."""
    if turns.size < 12:
        return None
    # Over whole cycles, from one maximum to the next and one minimum to the next alike.
    frequency = np.convolve(np.log(1 / (turns[3:] - turns[1:-2])), np.full(3, 1 / 3), "valid")
    low, high = float(frequency.min()), float(frequency.max())
    # Up and down again is twice the range; what wanders to and fro is noise.
    path = float(np.abs(np.diff(frequency)).sum())
    if high - low < np.log(1.3) or path > 3 * (high - low):
        return None
    return float(np.exp(low)), float(np.exp(high))


def _band(t: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Return the frequencies between which 90 % of the power lie, Hz."""
    grid = np.linspace(t[0], t[-1], t.size)
    power = np.cumsum(np.abs(np.fft.rfft(np.interp(grid, t, x - x.mean()))) ** 2)
    frequency = np.fft.rfftfreq(grid.size, grid[1] - grid[0])
    low, high = np.searchsorted(power, [0.05 * power[-1], 0.95 * power[-1]])
    return float(frequency[low]), float(frequency[high])
