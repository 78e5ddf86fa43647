"""When the blood pump runs and what flow it makes, from what the device logged.

That it runs is seen in the pulsation of the pressures: a set-point stands in the log also while the pump stands. The
moments of starting and stopping are those that the device wrote (set-point, speed, state) where it did.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.alarms.results import DeviceLog
from pipeline.rigs.rap.alarms.spans import joined, spans
from pipeline.rigs.rap.alarms.windows import centred_deviation, held, trailing_mean
from pipeline.rigs.rap.tables import Signal

# Pulsation below this is noise of a sensor, Pa rms; a pump makes 400 and more.
_NOISE = 60.0
# The pump runs where the pulsation is this share of its usual size.
_SHARE = 0.3
# A pulsation slower than this is not seen in 1 s, Hz.
RATE_NEEDED = 5.0
# A standstill or a burst shorter than this is a ragged edge of the pulsation, s.
_RAGGED = 1.5
# What the device wrote of a start or stop stands no further than this from what pressures show, s.
_WRITTEN_WITHIN = 3.0
# Where the pressure before and after a stop is looked at, s.
_BEFORE, _AFTER = 6.0, 4.0
_RUNNING_STATES = {"THERAPY"}
# Stroke volume taken where the speed alone is logged, m^3; it cancels in every ratio.
_STROKE = 0.7e-6


@dataclass(frozen=True, eq=False)
class PumpRun:
    """The blood pump on the grid: `on` (n,) bool, `flow` (n,) m^3/s (0 while it stands), spans in s.

    `flow_source` says where the flow is from, `source` where it is from that the pump runs; '' where nothing tells.
    `set_changes` are the moments of a new set-point, `written_stops` those of stops that the device wrote itself.
    """

    on: np.ndarray
    flow: np.ndarray
    running: tuple[tuple[float, float], ...]
    source: str
    flow_source: str
    set_changes: np.ndarray
    written_stops: np.ndarray


def pump_run(log: DeviceLog, grid: np.ndarray) -> PumpRun:
    """Return when the pump runs and its flow at the moments of `grid`, shape (n,), s."""
    on, source = _on(log, grid)
    running = [(a, b) for a, b in joined(spans(grid, on), _RAGGED) if b - a >= _RAGGED]
    written = _written(log)
    fallen = log.control.get("prefilter") or log.protective.get("prefilter")
    running = [(_moment(a, written[True], grid), _moment(_fall(b, fallen), written[False], grid)) for a, b in running]
    on = np.zeros(grid.size, bool)
    for start, end in running:
        on |= (grid >= start) & (grid < end)
    if running and running[-1][1] >= grid[-1]:
        on[-1] = True
    flow, flow_source, changes = _flow(log, grid, on)
    return PumpRun(on, np.where(on, flow, 0.0), tuple(running), source, flow_source, changes, written[False])


def _on(log: DeviceLog, grid: np.ndarray) -> tuple[np.ndarray, str]:
    taps = [
        s
        for tap in ("prefilter", "return", "access")
        for s in (log.control.get(tap), log.protective.get(tap))
        if s is not None and s.time.size > 1 and s.rate >= RATE_NEEDED
    ]
    relative = np.full(grid.size, np.nan)
    seen = False
    for tap in taps:
        deviation = centred_deviation(tap, grid)
        usual = float(np.nanpercentile(deviation, 95)) if np.isfinite(deviation).any() else 0.0
        if usual > _NOISE:
            seen = True
            relative = np.fmax(relative, deviation / usual)
    if seen:
        return _carried(relative, grid) > _SHARE, "pulsation of the pressures"
    if log.pump_speed is not None:
        return held(log.pump_speed, grid) > 0.05, "speed of the pump"
    if log.flow_device is not None and np.ptp(log.flow_device.values) > 0.0:
        flow = trailing_mean(log.flow_device, grid, max(1.0, 1.5 / log.flow_device.rate))
        usual = float(np.nanpercentile(flow, 95)) if np.isfinite(flow).any() else 0.0
        return flow > max(0.3 * usual, 0.0), "blood flow as the device estimates it"
    if log.states:
        running = np.zeros(grid.size, bool)
        ends = [*(entry.time for entry in log.states[1:]), np.inf]
        for entry, end in zip(log.states, ends, strict=True):
            if entry.text.upper() in _RUNNING_STATES:
                running |= (grid >= entry.time) & (grid < end)
        return running, "logged state"
    if log.flow_set is not None and not taps:
        return held(log.flow_set, grid) > 0.0, "blood flow as set"
    return np.zeros(grid.size, bool), "" if not taps else "pulsation of the pressures"


def _carried(values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return `values` with those beside a gap, which are not known, as they were last."""
    known = np.flatnonzero(np.isfinite(values))
    if known.size == 0:
        return np.zeros(grid.size)
    place = np.searchsorted(known, np.arange(grid.size), side="right") - 1
    return np.asarray(values[known[np.maximum(place, 0)]])


def _written(log: DeviceLog) -> dict[bool, np.ndarray]:
    """Return the moments at which the device wrote that the pump starts (True) or stops (False), s."""
    moments: dict[bool, list[float]] = {True: [], False: []}
    for signal in (log.flow_set, log.pump_speed):
        if signal is None or signal.time.size < 2:
            continue
        running = signal.values > 0.0
        for i in np.flatnonzero(np.diff(running.astype(np.int8))) + 1:
            moments[bool(running[i])].append(float(signal.time[i]))
    for entry in log.states:
        moments[entry.text.upper() in _RUNNING_STATES].append(entry.time)
    return {starts: np.sort(np.asarray(found)) for starts, found in moments.items()}


def _fall(seen: float, pressure: Signal | None) -> float:
    """Return when the pump stopped, s, from the fall of its pressure; the pulsation, in means over a second, ends later."""
    if pressure is None or pressure.rate < RATE_NEEDED:
        return seen
    i, k = np.searchsorted(pressure.time, [seen - _BEFORE, seen + _AFTER])
    time, values = pressure.time[i:k], pressure.values[i:k]
    turning, resting = values[time < seen - 0.5 * _BEFORE], values[time > seen + 0.5 * _AFTER]
    if turning.size < 5 or resting.size < 5:
        return seen
    high, low = float(np.median(turning)), float(np.median(resting))
    if abs(high - low) < 5.0 * float(np.std(resting)) + _NOISE:
        return seen
    above = np.flatnonzero((values - low) / (high - low) > 0.5)
    return float(time[min(above[-1] + 1, time.size - 1)])


def _moment(seen: float, written: np.ndarray, grid: np.ndarray) -> float:
    if seen <= grid[0] or seen >= grid[-1]:
        return seen
    near = written[np.abs(written - seen) <= _WRITTEN_WITHIN]
    return float(near[0]) if near.size else seen


def _flow(log: DeviceLog, grid: np.ndarray, on: np.ndarray) -> tuple[np.ndarray, str, np.ndarray]:
    """Return the flow while the pump runs, where it is from, and the moments at which it was set anew."""
    none = np.zeros(0)
    if log.flow_set is not None and (log.flow_set.values > 0.0).any():
        flow = held(log.flow_set, grid)
        usual = float(np.median(flow[flow > 0.0])) if (flow > 0.0).any() else 1.0
        # A set-point of 0 while pressures pulsate is no flow that a ratio can stand on.
        if not on.any() or np.mean(flow[on] > 0.0) > 0.5 or log.flow_device is None:
            return np.where(on & (flow <= 0.0), np.nan, flow), "blood flow as set", _changes(log.flow_set, 0.03 * usual)
    if log.flow_device is not None and (log.flow_device.values > 0.0).any():
        width = max(1.0, 1.5 / log.flow_device.rate)
        flow = trailing_mean(log.flow_device, grid, width)
        usual = float(np.nanmedian(flow[on])) if on.any() and np.isfinite(flow[on]).any() else 1.0
        flow = np.where(flow > 0.2 * usual, flow, np.nan)
        return flow, "blood flow as the device estimates it", none
    if log.pump_speed is not None:
        return _STROKE * held(log.pump_speed, grid), "speed of the pump", _changes(log.pump_speed, 0.1)
    return np.where(on, 80e-6 / 60.0, 0.0), "", none


def _changes(signal: Signal, least: float) -> np.ndarray:
    """Return the moments at which a set-point becomes another one; starts and stops are none."""
    before, after = signal.values[:-1], signal.values[1:]
    place = np.flatnonzero((np.abs(after - before) > least) & (before > 0.0) & (after > 0.0)) + 1
    return np.asarray(signal.time[place], float)
