"""When the brake begins to load the gearbox and when the lock breaks, both from the input torque (gearbox.md, 5.1 step 5)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.breaks import find_break, ramp
from pipeline.rigs.gearbox.stages.counts import Counts
from pipeline.rigs.gearbox.stages.input_torque import BLOCK, CLEAR, FINE, ripple, turning
from pipeline.rigs.gearbox.stages.lagged_breaks import delayed_ramp, find_lagged_break, passed_at_once
from pipeline.rigs.gearbox.stages.stage import EventName, EventTime, Stage
from pipeline.signals.filtering import low_pass

PEAK_CUTOFF = 20.0
"""Cutoff of the low-pass under which the torque's peak is read, Hz."""

GRIPS = 0.001 / math.sqrt(3.0)
"""A lock lets go and takes hold within a millisecond, in which the shafts exchange momentum: what that leaves open, s."""

# The rise under the brake up to that share of the peak; beyond, the breaking lock may bend it.
_RISE = 0.75
# A straight ramp is fitted so late at the most to one that a drive passes on with its lag, and the low-passed peak
# comes so late after the bend, s.
_LATE = 0.06
# A locked drive that droops under the brake keeps this share of its speed.
_LEAVES = 0.85


@dataclass(frozen=True)
class Rise:
    """The rise of the input torque under the brake: its span of fit, its straight onset and its low-passed peak, s."""

    span: tuple[float, float]
    onset: float | None
    peak: float


def brake_rise(record: Record, counts: Counts, fos: Stage, stop: float) -> Rise | None:
    """Return where the input torque rises under the brake until the lock breaks; None where it does not."""
    torque = record.torque.part(max(fos.start, fos.end - 4.0), stop + 0.5)
    if torque.time.size < 60:
        return None
    smooth = low_pass(torque.time, torque["torque_in"], PEAK_CUTOFF)
    smooth = smooth * np.sign(np.median(smooth))
    last = _slipping(counts, fos, stop)
    candidates = np.flatnonzero((torque.time >= fos.end - 0.8) & (torque.time <= last))
    if not candidates.size:
        return None
    peak = candidates[int(np.argmax(smooth[candidates]))]
    rough = float(torque.time[peak])
    early = smooth[torque.time < rough - 1.0]
    base = float(np.median(early)) if early.size else float(smooth[0])
    risen = np.flatnonzero(smooth[:peak] < base + _RISE * (smooth[peak] - base))
    span = (float(torque.time[0]), float(torque.time[risen[-1] if risen.size else 0]))
    time, level, turned = turning(record, counts, span, BLOCK)
    if time.size < 30:
        return Rise(span, None, rough)
    within = (max(float(time[0]) + 0.1, rough - 1.0), float(time[-1]))
    late, _ = find_break(time, level, ripple(turned), [ramp], within)
    return Rise(span, late.time, rough)


def _slipping(counts: Counts, fos: Stage, stop: float) -> float:
    """Return when the output has surely left the input, s: slip may need more torque than the lock carried."""
    inside = (counts.time >= fos.end - 0.8) & (counts.time <= stop)
    if not counts.whole(fos.end - 0.8, stop) or inside.sum() < 10:
        return stop + 0.1
    speed, usual = counts.speed()[inside], counts.rate(max(fos.start, fos.end - 2.0), fos.end - 0.2)[0]
    fast = np.flatnonzero(speed > _LEAVES * usual)
    return float(counts.time[inside][fast[-1]]) + 0.5 * counts.window if fast.size else stop + 0.1


def brake_events(record: Record, counts: Counts, fos: Stage, stop: float) -> dict[EventName, EventTime]:
    """Return when the brake began to load the gearbox and when the lock broke, both from the input torque."""
    rise = brake_rise(record, counts, fos, stop)
    if rise is None:
        return {}
    rough, span = rise.peak, rise.span
    found: dict[EventName, EventTime] = {"unlock": EventTime(rough, 0.25 / PEAK_CUTOFF)}
    if rise.onset is None:
        return found
    time, level, turned = turning(record, counts, span, BLOCK)
    within = (max(float(time[0]) + 0.1, rough - 1.0, rise.onset - _LATE), min(rise.onset + 0.01, float(time[-1])))
    onset, _ = find_lagged_break(time, level, ripple(turned), lambda t, t0, lag: _comes_on(t - t0, lag), within)
    found["brake_onset"] = passed_at_once(onset)
    time, level, turned = turning(record, counts, (span[0], rough), FINE)
    after = max(onset.time + min(0.02, 0.5 * (rough - onset.time)), rough - _LATE)
    if time.size < 100 or not rough - after > 2 * FINE:
        return found

    def breaks(t: np.ndarray, t0: float, lag: float) -> np.ndarray:
        return np.column_stack([_comes_on(t - onset.time, lag), ramp(t - t0)])

    bend, (_, bent) = find_lagged_break(time, level, ripple(turned), breaks, (after, rough - FINE))
    _, (_, straight) = find_lagged_break(
        time, level, ripple(turned), lambda t, t0, lag: _comes_on(t - t0, lag), (onset.time, onset.time + FINE)
    )
    if bend.time > after + FINE and straight - bent > CLEAR * bent / time.size:
        found["unlock"] = replace(bend, sd=math.hypot(bend.sd, GRIPS))
    return found


def _comes_on(late: np.ndarray, lag: float) -> np.ndarray:
    """Return what a brake that comes on in proportion to time does to the torque, shape (n, 1)."""
    return delayed_ramp(late, lag)[:, None]
