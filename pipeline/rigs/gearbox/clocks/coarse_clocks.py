"""By how many seconds the boards' clocks are apart, from the motion alone: no stage has been named yet.

Where the shaft runs freely the motion gives the output torque (eq. A), between the first and the last steady
running the slip gives the mesh noise. Both are compared over many seconds of shift; the fine shift, with its
error, is in `clock_shifts`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.counts import Counts, line_slopes
from pipeline.rigs.gearbox.stages.levels import restlessness
from pipeline.rigs.gearbox.stages.motion import Span
from pipeline.signals.periodogram import block_means

# Shifts are looked for this far and in these steps, s; so much of the motion must lie inside the other board's log.
FAR = 10.0
_STEP, _OVERLAP = 0.05, 0.7
_RATE, _WINDOW = 40.0, 0.25
# A shift is sure that leaves so little unexplained, and so much less than any other further off than that (s);
# without what drives the signal so much more is left.
_LEFT, _BETTER, _APART, _DRIVEN = 0.15, 0.6, 1.0, 1.5
# At the begin of a release the brake still drags; so much of the stand before and the steady running behind is used, s.
_DRAGS, _RESTS, _STEADY = 0.4, 2.0, 3.0
_FEWEST = 60
COARSE_SD = 0.1
"""Standard error of a coarse shift at the least, s."""
# Shifts that leave up to so many times the least unexplained do nearly as well.
_ALIKE = 3.0
# Up to here the fine search is sure by itself, s.
_NEAR = 0.5


@dataclass(frozen=True)
class Coarse:
    """`shift` in s that brings the board to the torques' clock; `sure` where no other does nearly as well.

    `sd` is its standard error, s: how far the shift may move without much harm.
    `left` is the unexplained share there, `left_as_logged` the one without any shift (NaN: too little in common).
    """

    shift: float
    sure: bool
    left: float
    left_as_logged: float
    sd: float = COARSE_SD

    @property
    def needed(self) -> bool:
        """Tell whether the motion as logged contradicts the other board."""
        return not self.left_as_logged < max(_LEFT, 5.0 * self.left)

    @property
    def far(self) -> bool:
        """Tell whether the clocks are surely apart by more than the fine search reaches at its best."""
        return self.sure and abs(self.shift) > _NEAR


def encoder_shift(record: Record, counts: Counts, spans: Sequence[Span]) -> Coarse | None:
    """Return how far the encoder's stamps are behind the torques', from the free motion; None where there is too little."""
    grid = np.arange(counts.time[0], counts.time[-1], 1.0 / _RATE)
    speed = line_slopes(grid, np.interp(grid, counts.time, counts.angle), _WINDOW)
    moving = line_slopes(grid, np.cumsum(_turns(grid, spans)) / _RATE, _WINDOW)
    # Zero offsets are small beside the drag: a constant would fit any step of the torque as the begin of motion.
    columns = np.column_stack([moving, speed, line_slopes(grid, speed, _WINDOW)])
    size = max(round(record.torque.rate / _RATE), 1)
    time, torque = block_means(record.torque.time, record.torque["torque_out"], size)
    smooth = line_slopes(time, np.cumsum(torque) * float(np.median(np.diff(time))), _WINDOW)
    found = None
    # A stand at the begin of the log is a standstill, or else an SOS, of which the free motion tells nothing.
    for rests in (True, False):
        used = _free(grid, counts, spans, rests)
        tried = _search(grid[used], columns[used], time, smooth)
        if found is None or (tried is not None and (tried.sure or not tried.needed)):
            found = tried
        if found is not None and found.sure:
            break
    return found


def _free(grid: np.ndarray, counts: Counts, spans: Sequence[Span], rests: bool) -> np.ndarray:
    """Return where the shaft runs up to steady speed without brake; with `rests` the stand before it, too."""
    used = np.zeros(grid.size, dtype=bool)
    for i, span in enumerate(spans):
        if span.state != "moving" or i + 1 == len(spans) or spans[i + 1].state != "nominal":
            continue
        first = rests and i == 1 and spans[0].state == "zero"
        start = max(spans[0].start, span.start - _RESTS) if first else span.start + _DRAGS
        used |= (grid >= start) & (grid <= min(spans[i + 1].end - 0.5, span.end + _STEADY))
    for start, end in counts.gaps:
        used &= (grid < start - _WINDOW) | (grid > end + _WINDOW)
    return used


def vibration_shift(record: Record, counts: Counts, spans: Sequence[Span]) -> Coarse | None:
    """Return how far the vibration's stamps are behind, from where mesh noise should lie; None where nothing slips.

    Encoder and torques must be on one clock already.
    """
    steady = [span for span in spans if span.state == "nominal"]
    if record.vibration is None or len(steady) < 2:
        return None
    restless = restlessness(record.vibration)
    if not restless.values:
        return None
    noise = np.mean(list(restless.values.values()), axis=0)
    noise = noise - np.percentile(noise, 10)
    grid = np.arange(steady[0].start, steady[-1].end, 1.0 / _RATE)
    slip = np.clip(1.0 - np.interp(grid, counts.time, counts.speed()) / max(steady[0].speed, 1e-9), 0.0, 1.0)
    if np.ptp(slip) < 0.5:
        return None
    found = _search(grid, slip[:, None], restless.time, noise)
    return None if found is None else replace(found, shift=-found.shift)


def _turns(grid: np.ndarray, spans: Sequence[Span]) -> np.ndarray:
    turning = np.zeros(grid.size)
    for span in spans:
        if span.state != "zero":
            turning[(grid >= span.start) & (grid <= span.end)] = 1.0
    return turning


def _search(grid: np.ndarray, columns: np.ndarray, time: np.ndarray, signal: np.ndarray) -> Coarse | None:
    """Return the shift at which the columns explain ``signal(grid + shift)`` best: none, where they do as logged."""
    if grid.size < _FEWEST or time.size < _FEWEST:
        return None
    as_logged = _unexplained(grid, columns, time, signal)
    if as_logged < _LEFT:
        return Coarse(0.0, True, as_logged, as_logged)
    shifts = np.arange(-round(FAR / _STEP), round(FAR / _STEP) + 1) * _STEP
    left = np.array([_unexplained(grid + shift, columns, time, signal) for shift in shifts])
    drive = columns[:, -1] - columns[:, -1].mean()
    for k, shift in enumerate(shifts):
        inside = (grid + shift >= time[0]) & (grid + shift <= time[-1])
        if float(drive[inside] @ drive[inside]) < _OVERLAP * float(drive @ drive):
            left[k] = math.nan
    if not np.isfinite(left).any():
        return None
    best = int(np.nanargmin(left))
    others = left[(np.abs(shifts - shifts[best]) > _APART) & np.isfinite(left)]
    clear = not others.size or left[best] < _BETTER * float(others.min())
    inside = 0 < best < shifts.size - 1 and bool(np.isfinite(left[best - 1 : best + 2]).all())
    # What drives the signal, acceleration or slip, must be seen in it: levels alone fit at many shifts.
    undriven = _unexplained(grid + shifts[best], columns[:, :-1], time, signal)
    driven = undriven > _DRIVEN * float(left[best])
    sure = bool(left[best] < _LEFT and clear and inside and driven)
    # What does nearly as well beside it, without a break.
    worse = np.flatnonzero(~(left < _ALIKE * left[best]))
    first, last = worse[worse < best].max(initial=-1) + 1, worse[worse > best].min(initial=left.size) - 1
    sd = max(0.5 * float(shifts[last] - shifts[first]), COARSE_SD)
    return Coarse(float(shifts[best]), sure, float(left[best]), as_logged, sd)


def _unexplained(at: np.ndarray, columns: np.ndarray, time: np.ndarray, signal: np.ndarray) -> float:
    known = (at >= time[0]) & (at <= time[-1])
    if known.mean() < _OVERLAP:
        return math.nan
    y = np.interp(at[known], time, signal)
    total = float(y @ y)
    if total <= 0:
        return math.nan
    if not columns.shape[1]:
        return 1.0
    base, _ = np.linalg.qr(columns[known])
    along = base.T @ y
    return 1.0 - float(along @ along) / total
