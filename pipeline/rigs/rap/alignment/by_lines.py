"""From a coarse lag to lag, rate and poles: windows of strokes, which stroke is which, eq. (2) (rap.md, 5.1 b and c)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.alignment.clock import Clock
from pipeline.rigs.rap.alignment.features import step_gain
from pipeline.rigs.rap.alignment.fine import Fine, Rows, fit_ratios, model_of, rows_of
from pipeline.rigs.rap.alignment.pair import Pair
from pipeline.rigs.rap.alignment.result import Coarse, Track
from pipeline.rigs.rap.alignment.stamps import evened
from pipeline.rigs.rap.alignment.strokes import Lines, Strokes, follow, lines
from pipeline.rigs.rap.alignment.unwrap import unwrapped
from pipeline.rigs.rap.pulsation.pump import Pump, pump
from pipeline.rigs.rap.pulsation.windows import Windows, cut, joined
from pipeline.rigs.rap.tables import Signal

# Windows, s; long records are looked at every so often.
_WINDOW, _SHORTEST, _LONG, _EVERY = 15.0, 5.0, 3600.0, 30.0
# What the pump needs to be up to speed, s.
_SETTLES = 1.0
# Two channels of one pressure differ in the size of their lines by no more than that, or in that of their steps.
_GAIN, _STEPS = (0.7, 1.4), (0.85, 1.18)
# A pole to start from, s; the coarse lag is right to that, s.
_POLE, _COARSE = 0.02, 0.05
_FEWEST_ROWS, _FEWEST_WINDOWS = 6, 2
# A clock steps where the lag of so many windows behind differs from those before by that, s, and by so many of its errors.
_SIDE, _STEP, _CLEAR = 3, 3e-3, 10.0
# A lag that strays from a line by less is not told, s.
_WANDER = 0.5e-3
# Even stamps are taken where the residual's square falls by that share.
_BETTER = 2e-3


@dataclass(frozen=True, eq=False)
class ByLines:
    """What the pump's lines tell: the clock that was laid under them, eq. (2) on top of it, lag window by window."""

    clock: Clock
    fine: Fine
    pairs: tuple[Pair, ...]
    strange: tuple[str, ...]
    strokes: Strokes
    track: Track
    sure: bool
    device_evened: bool
    bench_evened: bool
    bench_pole: float
    with_rate: bool

    def refitted(self, bench_pole: float) -> Fine:
        """Return the fit for another pole of the bench's sensors (s)."""
        return fit_ratios(self.fine.rows, (0.0, 0.0), bench_pole, with_rate=self.with_rate)


def by_lines(pairs: Sequence[Pair], coarse: Coarse, bench_pole: float) -> ByLines | None:
    """Return what the pump's lines tell; None where no channel pulsates on both sides.

    Parameters
    ----------
    pairs
        Alike ones.
    coarse
        Lag to some hundredths of a second.
    bench_pole
        Pole of the bench's sensors, s.
    """
    first, last = _overlap(pairs, coarse.lag)
    reference = 0.5 * (first + last)
    chosen = max(pairs, key=_pulsation)
    turning = pump(chosen.bench.time, chosen.bench.values)
    windows = _windows(turning, first, last)
    if windows.size < _FEWEST_WINDOWS:
        return None
    strokes = follow(chosen.bench.time, chosen.bench.values, windows)
    if strokes.turning.sum() < _FEWEST_WINDOWS:
        return None
    bench_time, bench_even = _better_stamps(chosen.bench, strokes, None)
    if bench_even:
        strokes = follow(bench_time, chosen.bench.values, windows)
    clock = Clock(reference, coarse.lag)
    tracked = _tracked(chosen, strokes, clock, coarse, bench_pole, bench_even)
    if tracked is None:
        return None
    clock, sure = tracked
    _, even = _better_stamps(chosen.device, strokes, clock)
    bench = [_lines_of(pair.bench, strokes, None, bench_even) for pair in pairs]
    device = [_lines_of(pair.device, strokes, clock, even) for pair in pairs]
    kept, strange = _alike_in_size(pairs, device, bench, coarse.lag)
    rows = rows_of([device[i] for i in kept], [bench[i] for i in kept], strokes, reference)
    if rows.size < _FEWEST_ROWS or np.unique(rows.window).size < _FEWEST_WINDOWS:
        return None
    with_rate = np.unique(rows.window).size >= 4
    fine = fit_ratios(rows, (0.0, 0.0), bench_pole, with_rate=with_rate)
    return ByLines(
        clock,
        fine,
        tuple(pairs[i] for i in kept),
        strange,
        strokes,
        _track(fine, strokes, clock, bench_pole),
        sure,
        even,
        bench_even,
        bench_pole,
        with_rate,
    )


def clock_step(track: Track) -> tuple[float, float] | None:
    """Return when a clock steps (s on the bench's) and by how much (s); None where the lag follows a line.

    The medians of some windows before and behind each moment are compared; drift is taken off.
    """
    n, time, lag = track.time.size, track.time, track.lag
    if n < 2 * _SIDE + 2:
        return None
    rate = float(np.median(np.diff(lag) / np.maximum(np.diff(time), 1e-9)))
    flat = lag - rate * (time - time[0])
    places = np.arange(_SIDE, n - _SIDE + 1)
    jumps = np.array([np.median(flat[k : k + _SIDE]) - np.median(flat[k - _SIDE : k]) for k in places])
    usual = 1.4826 * float(np.median(np.abs(np.diff(flat)))) / np.sqrt(2.0)
    most = int(np.argmax(np.abs(jumps)))
    if not abs(jumps[most]) > max(_STEP, _CLEAR * usual):
        return None
    return float(time[places[most]]), float(jumps[most])


def wander(track: Track) -> float:
    """Return how far the lag strays from one line beyond its noise, rms in s; 0 where it does not."""
    n, time, lag = track.time.size, track.time, track.lag
    if n < 2 * _SIDE + 2:
        return 0.0
    left = lag - np.polyval(np.polyfit(time - time[0], lag, 1), time - time[0])
    size = 2 * _SIDE - 1
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(left, size), axis=1)
    usual = 1.4826 * float(np.median(np.abs(np.diff(left)))) / np.sqrt(2.0)
    strays = float(np.sqrt(np.mean(smooth**2)))
    # The median of five scatters by about 0.54 of one.
    return strays if strays > max(_WANDER, 2.0 * 0.54 * usual) else 0.0


def _windows(turning: Pump, first: float, last: float) -> Windows:
    """Return windows of 15 s (less where the pump turns for less than two of them) within its stretches."""
    every = _EVERY if last - first > _LONG else 0.0
    parts = []
    for stretch in turning.stretches:
        begin = max(first, stretch.first + _SETTLES)
        end = min(last, stretch.last - _SETTLES)
        count = max(int((end - begin) / _WINDOW), 2)
        length = min((end - begin) / count, 1.2 * _WINDOW)
        if length >= _SHORTEST:
            parts.append(cut(begin, end, length, max(every, length)))
    return joined(parts)


def _overlap(pairs: Sequence[Pair], lag: float) -> tuple[float, float]:
    """Return the first and last bench time that both sides of every pair hold, s."""
    first = max(max(pair.bench.time[0], pair.device.time[0] + lag) for pair in pairs)
    last = min(min(pair.bench.time[-1], pair.device.time[-1] + lag) for pair in pairs)
    return float(first), float(last)


def _pulsation(pair: Pair) -> float:
    """Return how strongly a pair pulsates: the smaller of the two sides' usual scatter within two seconds."""
    return min(_scatter(pair.device), _scatter(pair.bench))


def _scatter(signal: Signal) -> float:
    size = max(round(2.0 * signal.rate), 4)
    count = signal.values.size // size
    if not count:
        return 0.0
    return float(np.median(np.std(signal.values[: count * size].reshape(count, size), axis=1)))


def _lines_of(signal: Signal, strokes: Strokes, clock: Clock | None, even: bool) -> Lines:
    time = evened(signal.time) if even else signal.time
    return lines(time if clock is None else clock.to_bench(time), signal.values, strokes)


def _better_stamps(signal: Signal, strokes: Strokes, clock: Clock | None) -> tuple[np.ndarray, bool]:
    """Return the stamps under which the pulsation leaves the smaller residual: as logged, or on an even grid."""
    raw, even = (_lines_of(signal, strokes, clock, choice).sigma for choice in (False, True))
    both = np.isfinite(raw) & np.isfinite(even)
    smaller = both.any() and float((even[both] ** 2).sum()) < (1.0 - _BETTER) * float((raw[both] ** 2).sum())
    return (evened(signal.time), True) if smaller else (signal.time, False)


def _tracked(
    pair: Pair, strokes: Strokes, clock: Clock, coarse: Coarse, bench_pole: float, bench_even: bool
) -> tuple[Clock, bool] | None:
    """Return the clock to some milliseconds, from the phase of the first line in each window; None where there is none."""
    bench = _lines_of(pair.bench, strokes, None, bench_even)
    sure = True
    for _ in range(2):
        device = _lines_of(pair.device, strokes, clock, False)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = device.amplitude[:, 0] / bench.amplitude[:, 0]
            omega = 2.0 * np.pi * strokes.frequency
            ratio = ratio * (1.0 + 1j * omega * _POLE) / (1.0 + 1j * omega * bench_pole)
            delay = np.angle(ratio) / omega
            sd = (
                np.hypot(
                    device.error[:, 0] / np.abs(device.amplitude[:, 0]),
                    bench.error[:, 0] / np.abs(bench.amplitude[:, 0]),
                )
                / omega
            )
        delay[~(sd < 0.1 / strokes.frequency)] = np.nan
        at = strokes.windows.centre
        start = coarse.lag + _POLE - bench_pole - float(clock.lag_at(np.array(coarse.at)))
        found = unwrapped(at, delay, sd, 1.0 / strokes.frequency, coarse.at, start, _COARSE)
        known = np.isfinite(found.delay)
        if known.sum() < _FEWEST_WINDOWS:
            return None
        sure = sure and found.sure
        line = _line(at[known] - clock.reference, found.delay[known])
        clock = Clock(clock.reference, clock.lag + line[0], clock.rate + line[1])
        coarse_is_far = abs(line[1]) * float(np.ptp(at[known])) > 0.02 or abs(line[0]) > 0.02
        if not coarse_is_far:
            break
    return clock, sure


def _line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return intercept and slope of a line, strays left out; the slope is 0 where few points tell it."""
    if x.size < 4:
        return float(np.median(y)), 0.0
    kept = np.ones(x.size, dtype=bool)
    for _ in range(3):
        slope, start = np.polyfit(x[kept], y[kept], 1)
        off = np.abs(y - start - slope * x)
        kept = off <= 5.0 * max(1.4826 * float(np.median(off[kept])), 1e-6)
        if kept.sum() < 4:
            break
    return float(start), float(slope)


def _alike_in_size(
    pairs: Sequence[Pair], device: Sequence[Lines], bench: Sequence[Lines], lag: float
) -> tuple[list[int], tuple[str, ...]]:
    """Return the numbers of the pairs that are about the same size on both sides, and the names of the others.

    A slow sensor makes lines small and leaves steps as they are: a pair is strange where both are off.
    """
    kept, strange = [], []
    for i, (pair, ours, theirs) in enumerate(zip(pairs, device, bench, strict=True)):
        with np.errstate(invalid="ignore", divide="ignore"):
            strong = np.abs(theirs.amplitude[:, 0]) > 10.0 * theirs.error[:, 0]
            size = np.abs(ours.amplitude[:, 0] / theirs.amplitude[:, 0])[strong]
        size = size[np.isfinite(size)]
        if not size.size:
            continue
        if _GAIN[0] < float(np.median(size)) < _GAIN[1] or _STEPS[0] < step_gain(pair, lag) < _STEPS[1]:
            kept.append(i)
        else:
            strange.append(pair.name)
    return kept or list(range(len(pairs))), tuple(strange) if kept else ()


def _track(fine: Fine, strokes: Strokes, clock: Clock, bench_pole: float) -> Track:
    """Return the lag of each window with gain and poles as fitted: all its rows together, weighted."""
    rows: Rows = fine.rows
    still = model_of(rows, fine.fit.values, bench_pole, fine.separate, delayed=False)
    turn = np.angle(rows.ratio / still) / rows.omega
    weight = np.where(fine.used, (rows.omega * np.abs(still) / rows.sd) ** 2, 0.0)
    count = strokes.windows.size
    total = np.bincount(rows.window, weight, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        delay = np.bincount(rows.window, weight * turn, count) / total
        sd = 1.0 / np.sqrt(total)
    known = total > 0
    at = strokes.windows.centre[known]
    return Track(at, delay[known] + clock.lag_at(at), sd[known], np.ones(at.size, dtype=bool))
