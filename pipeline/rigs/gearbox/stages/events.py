"""When things happened, with their errors, each from the signal that tells it best (gearbox.md, 5.1 step 5).

A drive that droops under load passes what happens on to the input torque with a lag, and later still to the speed;
the lag is found with the brake's onset and allowed for. An error comes from noise, slope and sample interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.brake_events import GRIPS, brake_events
from pipeline.rigs.gearbox.stages.breaks import find_break, parabola, parabola_before, ramp, ramp_before, step
from pipeline.rigs.gearbox.stages.count_events import LAST, angle_in, hidden_in, slows_from, turns_from, turns_until
from pipeline.rigs.gearbox.stages.counts import Counts
from pipeline.rigs.gearbox.stages.input_torque import (
    BLOCK,
    CLEAR,
    FINE,
    STEADY,
    means,
    memory,
    ripple,
    steady_noise,
    turning,
)  # fmt: skip
from pipeline.rigs.gearbox.stages.lagged_breaks import delayed_ramp, delayed_step, find_lagged_break, passed_at_once
from pipeline.rigs.gearbox.stages.stage import EventName, EventTime, Stage

# With noise whose drift is known so many variances are enough to tell a change of the torque.
_SIGNIFICANT = 25.0
# What is fitted before and after a start, s, and how far from the first guess it may lie.
_WIND_UP, _SPEEDS_UP, _ASTRAY = 0.25, 0.2, 0.1
# A motor that was switched on has wound the shafts up when its torque is so large a share of that of FOS.
_WOUND = 0.33
# How far two readings of a start are apart is one draw: they may agree by chance, s.
_SHAPE = 0.005
# After the drive lets go only so much is fitted, s: soon the load drives the gearbox, and the lag is another.
_FALLS = 0.03
# Where the lag of the drive is not known: as much, s, as standard error too.
_ANY_LAG = 0.015
Found = dict[EventName, EventTime]


def drive_lag(found: Found) -> EventTime | None:
    """Return the event, brake onset or else run-down, that tells the lag of the drive under load; None where neither does."""
    known = [found[name] for name in ("brake_onset", "rundown") if name in found]
    return next((event for event in known if math.isfinite(event.lag)), None)


def startup_event(record: Record, counts: Counts, stages: Sequence[Stage], drive: EventTime | None = None) -> Found:
    """Return when the output began to turn out of a standstill.

    The drive winds the shafts up until friction lets go: there the input torque bends, and long before
    the first count. Where no bend is clear the first counts decide.

    Parameters
    ----------
    drive
        The event that tells the lag of the drive under load: the torque bends by that much after the motion began.
    """
    i = next((k for k, stage in enumerate(stages) if stage.name == "startup"), None)
    if i is None or i == 0 or stages[i - 1].name != "standstill":
        return {}
    first = stages[i - 1].end
    blunt = turns_from(counts, first, 0.3)
    near = min(blunt.time, first - 0.05)
    # The counts, which bend smoothly, are late rather than early.
    since = near - max(0.12, min(3.0 * blunt.sd, 0.25))
    motor_on = _wound_up(record, stages[i - 1], stages[i], stages[i + 1 :])
    since = max(since, motor_on + 2 * BLOCK)
    time, level = means(record, (max(since - 0.1, motor_on), first + 0.15), BLOCK)
    if time.size < 20 or not since < first:
        return {"startup": blunt}
    late = time - first
    columns = [np.ones_like(late), late, late**2]
    latest = min(first, max(blunt.time, near) + blunt.sd)
    bend, (without, bent) = find_break(time, level, columns, [ramp, parabola], (since, latest))
    if not without - bent > CLEAR * bent / time.size:
        return {"startup": blunt}
    if drive is None:
        # The straight bend is late by about the lag.
        return {"startup": EventTime(bend.time - _ANY_LAG, math.hypot(bend.sd, _ANY_LAG))}
    time, level = means(record, (max(bend.time - _WIND_UP, motor_on), bend.time + _SPEEDS_UP), BLOCK)
    late = time - bend.time
    columns = [np.ones_like(late), late, late**2]
    within = (max(bend.time - _ASTRAY, motor_on + BLOCK), bend.time + 0.5 * _ASTRAY)
    noise = steady_noise(record, counts, stages)
    lags = (drive.lag, max(drive.lag - drive.lag_sd, 0.1 * drive.lag), drive.lag + drive.lag_sd)
    found, less, more = (find_lagged_break(time, level, columns, _speeds_up, within, (lag,), noise)[0] for lag in lags)
    # The straight bend, earlier by the lag, tells the same: how far both are apart shows what the shape leaves open.
    shape = max(abs(bend.time - drive.lag - found.time), _SHAPE)
    return {"startup": EventTime(found.time, math.hypot(found.sd, 0.5 * (more.time - less.time), shape))}


def _wound_up(record: Record, standstill: Stage, startup: Stage, later: Sequence[Stage]) -> float:
    """Return when the input torque has come a third of the way to FOS, s: the motor's begin bends it, too, and before that."""
    fos = next((stage for stage in later if stage.name.startswith("fos")), None)
    time, level = means(record, (standstill.start, startup.start), BLOCK)
    if fos is None or time.size < 10:
        return standstill.start
    base = float(np.median(level[: max(time.size // 2, 5)]))
    running = float(np.median(means(record, (fos.start, fos.end), BLOCK)[1])) - base
    below = np.flatnonzero((level - base) * np.sign(running) < _WOUND * abs(running))
    return float(time[below[-1]]) if below.size else standstill.start


def _speeds_up(time: np.ndarray, t0: float, lag: float) -> np.ndarray:
    """Return what a beginning motion adds to the torque: the lagged ramp of its speed, and how drag changes with it."""
    late = time - t0
    return np.column_stack([delayed_ramp(late, lag), parabola(late)])


def rundown_event(record: Record, counts: Counts, stages: Sequence[Stage], drive: EventTime | None = None) -> Found:
    """Return when the drive began to slow the output down for good: the input torque falls, the speed follows.

    Where no fall is clear the bend of the speed decides, which comes later by the lag of the `drive`.
    """
    i = next((k for k, stage in enumerate(stages) if stage.name == "rundown"), None)
    if not i or not stages[i - 1].name.startswith("fos"):
        return {}
    stage = stages[i]
    bend = slows_from(counts, stage.start, min(0.5, 0.7 * stage.duration), 1.0)
    lag, lag_sd = (_ANY_LAG, _ANY_LAG) if drive is None else (drive.lag, drive.lag_sd)
    blunt = EventTime(bend.time - lag, math.hypot(bend.sd, lag_sd))
    span = (max(stages[i - 1].start, bend.time - STEADY), bend.time + _FALLS)
    time, level, turned = turning(record, counts, span, FINE)
    if time.size < 100:
        return {"rundown": blunt}
    within = (max(float(time[50]), bend.time - 0.15), bend.time + _FALLS - 0.01)
    fall, (without, fallen) = find_lagged_break(time, level, ripple(turned), _lets_go, within)
    before = time < within[0]
    clear = without - fallen > _SIGNIFICANT * memory(level[before], turned[before]) * fallen / time.size
    # Some fifteen samples tell step, ramp and lag: what their linear error says holds no better than to a sample.
    return {"rundown": replace(fall, sd=math.hypot(fall.sd, FINE / math.sqrt(12.0))) if clear else blunt}


def _lets_go(time: np.ndarray, t0: float, lag: float) -> np.ndarray:
    """Return what a drive that slows down takes off the torque: the load's deceleration, and drag that changes."""
    late = time - t0
    return np.column_stack([delayed_step(late, lag), ramp(late)])


def cycle_events(record: Record, counts: Counts, stages: Sequence[Stage], sos: Stage) -> Found:
    """Return the events around one SOS, as far as the record holds them.

    Parameters
    ----------
    stages
        As the motion bounds them.
    sos
        The stage whose cycle is meant.
    """
    i = list(stages).index(sos)
    found: Found = {}
    before = [stage for stage in stages[:i] if stage.name != "brake"]
    if i:
        found["sos_start"] = turns_until(counts, sos.start)
    if before and before[-1].name.startswith("fos"):
        found.update(brake_events(record, counts, before[-1], found["sos_start"].time))
        if "unlock" in found:
            found["sos_start"] = turns_until(counts, sos.start, found["unlock"].time)
    after = [stage for stage in stages[i + 1 :] if stage.name != "release"]
    if i + 1 < len(stages) and stages[i + 1].name not in ("standstill", "stall"):
        found["sos_end"] = turns_from(counts, sos.end, LAST)
        if after and after[0].name.startswith("fos"):
            found["relock"] = _relock(record, counts, found["sos_end"].time, after[0])
    return found


def _relock(record: Record, counts: Counts, free: float, fos: Stage) -> EventTime:
    """Return when the gears lock again: the speed bends from rising to steady, and the torque falls.

    The bend of the speed is sure and blunt, the fall of the torque sharp where there is one.
    """
    near = fos.start
    if (unseen := hidden_in(counts, free, near + 0.2, free)) is not None:
        return unseen
    span = (max(free + 0.05, near - 0.45), min(near + 0.5, fos.end))
    t, angle = angle_in(counts, span)
    within = (span[0] + 0.1, min(near + 0.2, span[1] - 0.1))
    blunt, _ = find_break(t, angle, [np.ones_like(t), t - near], [parabola_before], within)
    span = (max(free + 0.05, blunt.time - 0.4), min(blunt.time + 1.2, fos.end))
    time, level, turned = turning(record, counts, span, BLOCK)
    if time.size < 60:
        return blunt
    within = (max(time[0] + 0.1, blunt.time - 0.2), min(time[-1] - 0.1, blunt.time + 0.2))
    sharp, (without, with_step) = find_break(time, level, ripple(turned), [step, ramp_before], within)
    if not without - with_step > CLEAR * with_step / time.size:
        return blunt
    time, level, turned = turning(record, counts, (max(span[0], sharp.time - _ASTRAY), span[1]), FINE)
    if time.size < 60:
        return sharp
    within = (max(float(time[5]), sharp.time - 0.06), sharp.time + 0.04)
    found, _ = find_lagged_break(time, level, ripple(turned), _engages, within)
    found = passed_at_once(found)
    return replace(found, sd=math.hypot(found.sd, GRIPS))


def _engages(time: np.ndarray, t0: float, lag: float) -> np.ndarray:
    """Return what locking gears do to the torque: it changes slowly before and falls through the drive's lag after."""
    late = time - t0
    return np.column_stack([delayed_step(late, lag), ramp_before(late)])
