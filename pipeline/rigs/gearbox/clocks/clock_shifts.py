"""What single parts of a run tell about the clocks of its boards: start-up, unlocking, release, run-down.

Shifts only; what is made of them is in `alignment`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.brake_events import PEAK_CUTOFF
from pipeline.rigs.gearbox.stages.breaks import find_break, parabola, ramp, step
from pipeline.rigs.gearbox.stages.counts import Counts, line_slopes
from pipeline.rigs.gearbox.stages.levels import restlessness
from pipeline.rigs.gearbox.stages.stage import EventTime, Stage
from pipeline.signals.filtering import low_pass
from pipeline.signals.periodogram import block_means

# Shifts are looked for this far, s, first in coarse and then in fine steps.
_FAR, _COARSE, _FINE = 1.5, 0.03, 0.001
_RATE, _WINDOW, _FEWEST = 100.0, 0.2, 50
# The parts of a run agree within this; what a smooth bend leaves open on a shift, s; what mesh noise leaves open, as a
# share of how long slip takes to come or go.
_NEAR, _BEND, _MESH = 0.15, 0.01, 0.1
# A shift that the motion as a whole tells is right within this, s.
_ROUGH = 0.4
# The shaft bends away already while the lock still holds: the peak of the torque is surely this near, s.
_UNLOCK = 0.03
_POWERS = (1, 2, 3)
# A part of the run has a shift of its own if it explains so much of the torque's variance.
_EXPLAINED = 0.5


@dataclass(frozen=True)
class Part:
    """The shift of one part of a run: when (s of the board), how much and with what error (s); what it leaves unexplained."""

    time: float
    shift: float
    sd: float
    misfit: float = 0.0


def encoder_parts(record: Record, counts: Counts, stages: Sequence[Stage], guess: float | None = None) -> list[Part]:
    """Return the shifts of the parts of a run: first about, from all of it, then of each part near that.

    `guess` is a shift (s) that the motion as a whole tells roughly, None where it tells none.
    """
    free = _FreeMotion(record, counts, stages)
    unlocks = [part for stage in stages if stage.name == "sos" for part in _unlocked(record, counts, stages, stage)]
    if guess is not None:
        unlocks = [part for part in unlocks if abs(part.shift - guess) < _ROUGH]
    if unlocks:
        about = float(np.median([part.shift for part in unlocks]))
    else:
        common = free.shift(free.spans, (-_FAR, _FAR) if guess is None else (guess - _ROUGH, guess + _ROUGH))
        if common is None:
            return []
        about = common.shift
    near = (about - _NEAR, about + _NEAR)
    parts = [*unlocks, *(part for span in free.spans if (part := free.shift([span], near)))]
    rundown = _run_down(record, counts, stages, about)
    return [*parts, *([rundown] if rundown else [])]


class _FreeMotion:
    """Start-up and release, where the brake is off: ``T_out = J w' + d_0 + d_1 w`` (eq. A), both sides smoothed alike."""

    def __init__(self, record: Record, counts: Counts, stages: Sequence[Stage]) -> None:
        size = max(round(record.torque.rate / _RATE), 1)
        self._time, torque = block_means(record.torque.time, record.torque["torque_out"], size)
        self._torque = _smooth(self._time, _smooth(self._time, torque))
        self._grid = np.arange(counts.time[0], counts.time[-1], 1.0 / _RATE)
        speed = line_slopes(self._grid, np.interp(self._grid, counts.time, counts.angle), _WINDOW)
        smooth = _smooth(self._grid, speed)
        self._columns = np.column_stack([np.ones_like(speed), smooth, line_slopes(self._grid, speed, _WINDOW)])
        self._gaps = counts.gaps
        self.spans = [span for span in _free(stages) if self._inside(span).sum() >= _FEWEST]

    def _inside(self, span: tuple[float, float]) -> np.ndarray:
        inside = (self._grid >= span[0]) & (self._grid <= span[1])
        for start, end in self._gaps:
            inside &= (self._grid < start - 2 * _WINDOW) | (self._grid > end + 2 * _WINDOW)
        return inside

    def shift(self, spans: Sequence[tuple[float, float]], within: tuple[float, float]) -> Part | None:
        """Return the shift that explains the output torque over `spans` best."""
        inside = np.any([self._inside(span) for span in spans], axis=0) if spans else np.zeros(1, dtype=bool)
        if inside.sum() < _FEWEST:
            return None
        return _best_shift(
            self._grid[inside], self._columns[inside], lambda at: np.interp(at, self._time, self._torque), within
        )


def _free(stages: Sequence[Stage]) -> list[tuple[float, float]]:
    """Return where the shaft speeds up without brake, with a second of steady speed behind it."""
    out = []
    for before, after in pairwise(stages):
        if before.name in ("startup", "release") and after.name.startswith("fos"):
            # At the begin of the release the brake still drags.
            start = before.start + (_WINDOW if before.name == "startup" else 0.3 + _WINDOW)
            out.append((start, min(before.end + 1.0, after.end - 0.3)))
    return out


def _unlocked(record: Record, counts: Counts, stages: Sequence[Stage], sos: Stage) -> list[Part]:
    """Return the shift between the peak of the input torque and the bend of the speed as the lock breaks."""
    i = list(stages).index(sos)
    before = [stage for stage in stages[:i] if stage.name.startswith("fos")]
    if not before:
        return []
    left = before[-1].end
    bend = _bend(counts, (max(left - 0.6, before[-1].start), min(left + 0.15, sos.start)))
    part = record.torque.part(left - _FAR, sos.start + _FAR)
    if bend is None or part.time.size < 100:
        return []
    smooth = low_pass(part.time, part["torque_in"], PEAK_CUTOFF)
    peak = float(part.time[int(np.argmax(smooth * np.sign(np.median(smooth))))])
    return [Part(bend.time, peak - bend.time, math.hypot(bend.sd, _UNLOCK))]


def _run_down(record: Record, counts: Counts, stages: Sequence[Stage], about: float) -> Part | None:
    """Return the shift between the fall of the input torque and the bend of the speed at the run-down."""
    i = next((k for k, stage in enumerate(stages) if stage.name == "rundown"), None)
    if not i:
        return None
    left = stages[i].start
    bend = _bend(counts, (max(left - 0.8, stages[i - 1].start), min(left + 0.3, stages[i].end)))
    if bend is None:
        return None
    part = record.torque.part(bend.time + about - 1.0, bend.time + about + 0.35)
    if part.time.size < 100:
        return None
    time, level = block_means(part.time, part["torque_in"], max(round(part.rate * 0.005), 1))
    if time.size < 100 or time[-1] < bend.time + about + 0.25:
        return None
    near = (bend.time + about - _NEAR, bend.time + about + _NEAR)
    fall, (without, fallen) = find_break(time, level, [np.ones_like(time)], [step, ramp], near)
    if without < 2.0 * fallen:
        return None
    return Part(bend.time, fall.time - bend.time, math.hypot(math.hypot(bend.sd, fall.sd), _BEND))


def _bend(counts: Counts, span: tuple[float, float]) -> EventTime | None:
    """Return when a steady speed begins to fall inside `span`."""
    inside = (counts.time >= span[0]) & (counts.time <= span[1])
    t, angle = counts.time[inside], counts.angle[inside]
    if t.size < 20 or span[1] - span[0] < 0.3:
        return None
    columns = [np.ones_like(t), t - t[0]]
    return find_break(t, angle, columns, [parabola], (t[0] + 0.1, t[-1] - 0.03), counts.step / math.sqrt(12))[0]


def vibration_parts(record: Record, counts: Counts, stages: Sequence[Stage]) -> list[Part]:
    """Return the shifts of unlocking and relocking: mesh noise grows with the slip ``w_n - w_2``."""
    if record.vibration is None:
        return []
    restless = restlessness(record.vibration)
    if not restless.values:
        return []
    noise = np.mean(list(restless.values.values()), axis=0)
    speed = counts.speed()
    nominal = float(np.percentile(speed, 98))
    best: list[Part] = []
    # How mesh noise grows with slip is not known: as the power that explains it best.
    for power in _POWERS:
        parts = []
        for start, end in _exchanges(stages):
            grid = np.arange(start, end, 0.02)
            slip = np.clip(1.0 - np.interp(grid, counts.time, speed) / nominal, 0.0, 1.0)
            columns = np.column_stack([np.ones_like(grid), slip**power])
            part = _best_shift(grid, columns, lambda at: np.interp(at, restless.time, noise), (-_FAR, _FAR))
            # The grid is on the torques' clock and the board's is asked for: the shift found is the board's lag.
            if part is not None:
                sd = math.hypot(part.sd, _MESH * (end - start - 2.0) + 0.02)
                parts.append(Part(part.time + part.shift, -part.shift, sd, part.misfit))
        if parts and (not best or _misfit(parts) < _misfit(best)):
            best = parts
    return best


def _misfit(parts: Sequence[Part]) -> tuple[int, float]:
    return -len(parts), sum(part.misfit for part in parts)


def _exchanges(stages: Sequence[Stage]) -> list[tuple[float, float]]:
    """Return where slip comes and goes, with a second of steady motion beside it."""
    out = []
    for i, sos in enumerate(stages):
        if sos.name != "sos":
            continue
        before = [stage for stage in stages[:i] if stage.name.startswith("fos")]
        after = [stage for stage in stages[i + 1 :] if stage.name.startswith("fos")]
        if before:
            out.append((max(before[-1].end - 1.0, before[-1].start), min(sos.start + 1.0, sos.end)))
        if after:
            out.append((max(sos.end - 1.0, sos.start), min(after[0].start + 1.0, after[0].end)))
    return out


def _best_shift(
    grid: np.ndarray, columns: np.ndarray, signal: Callable[[np.ndarray], np.ndarray], within: tuple[float, float]
) -> Part | None:
    """Return the shift at which the columns explain ``signal(grid + shift)`` best; None where they hardly do."""
    base, upper = np.linalg.qr(columns)

    def unexplained(shift: float) -> float:
        y = signal(grid + shift)
        y = y - y.mean()
        total = float(y @ y)
        # The last column (acceleration, slip) drives the signal, it never works against it.
        along = base.T @ y
        if total <= 0 or along[-1] * upper[-1, -1] <= 0:
            return 1.0
        return (total - float(along @ along)) / total

    low, high = within
    for pace in (_COARSE, _FINE):
        shifts = np.arange(low, high + pace, pace)
        shares = np.array([unexplained(float(shift)) for shift in shifts])
        best = int(np.argmin(shares))
        low, high = float(shifts[max(best - 1, 0)]), float(shifts[min(best + 1, shifts.size - 1)])
    shift = float(shifts[best])
    if shares[best] > 1.0 - _EXPLAINED or not within[0] + _FINE < shift < within[1] - _FINE:
        return None
    y = signal(grid + shift)
    residual = y - base @ (base.T @ y)
    slope = (signal(grid + shift + 0.01) - signal(grid + shift - 0.01)) / 0.02
    slope = slope - base @ (base.T @ slope)
    independent = effective_size(residual, columns.shape[1])
    variance = float(residual @ residual) / max(independent - columns.shape[1] - 1, 1.0)
    information = float(slope @ slope) * independent / grid.size
    sd = math.sqrt(variance * independent / grid.size / max(information, 1e-30))
    return Part(float(grid.mean()), shift, sd, float(shares[best]))


def _smooth(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Smooth as a line fit smooths a slope: the slope of the integral."""
    steps = np.diff(time)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)])
    return line_slopes(time, integral, _WINDOW)
