"""What the log gives as causes of an alarm: ratios out of their limits, flags, pressures out of range, mismatches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.alarms.limits import AlarmLimits
from pipeline.rigs.rap.alarms.ratios import RatioResult
from pipeline.rigs.rap.alarms.record import is_flag
from pipeline.rigs.rap.alarms.results import DeviceLog, Mismatch
from pipeline.rigs.rap.alarms.spans import joined, spans
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.tables import Signal


@dataclass(frozen=True)
class Cause:
    """From `began` (s) something is wrong, at `due` it is an alarm, at `ended` it is gone (None: the log ends first)."""

    code: str
    began: float
    due: float
    ended: float | None
    words: str
    std_error: float


# Ratio, above (True) or below its limit, code.
RULES = (
    ("access", True, "ACCESS_OCCLUDED"),
    ("access", False, "ACCESS_DISCONNECTED"),
    ("filter", True, "FILTER_COAGULATION"),
    ("return", True, "RETURN_OCCLUDED"),
    ("return", False, "RETURN_DISCONNECTED"),
    ("membrane", True, "MEMBRANE_COAGULATION"),
    ("membrane", False, "UF_LINE_OPEN"),
)
# Flag, the value that is wrong, code.
FLAGS = (
    ("air_detected", True, "AIR"),
    ("blood_leak_detected", True, "BLOOD_LEAK"),
    ("estop_pressed", True, "EMERGENCY_STOP"),
    ("watchdog_ok", False, "WATCHDOG"),
)
# A flag that is down for less than this has not cleared: bubbles come in trains, s.
_CHATTER = 5.0
# When in a stroke a fault sets in moves the crossing by this, s (1 sigma; simulated); the access pulsates most for its size.
_PHASE = {"access": 0.07, "filter": 0.035, "return": 0.035, "membrane": 0.035}
# The device wrote an alarm and stopped its pumps within this, s; a cause seen for this long before is the reason.
_REACTION, _GLIMPSE = 2.0, 0.15
_SYMBOLS = {"access": "r_a", "filter": "r_f", "return": "r_r", "membrane": "r_m"}


def causes(log: DeviceLog, found: RatioResult, mismatches: Sequence[Mismatch], limits: AlarmLimits) -> list[Cause]:
    """Return all causes of the run in order of the time at which they are due."""
    everything = [
        *_of_ratios(log, found, limits),
        *_out_of_range(found, limits),
        *(cause for flag, wrong, code in FLAGS for cause in _of_flag(log.flags.get(flag), wrong, code, flag)),
        *(_of_mismatch(mismatch) for mismatch in mismatches),
    ]
    return sorted(everything, key=lambda cause: cause.due)


def _of_ratios(log: DeviceLog, found: RatioResult, limits: AlarmLimits) -> list[Cause]:
    ratios = found.ratios
    if ratios is None:
        return []
    out = []
    time, step = ratios.time, float(np.median(np.diff(ratios.time)))
    stops = _stopped_by_alarm(log, found)
    for name, above, code in RULES:
        if name not in ratios.values:
            continue
        r = ratios.values[name]
        with np.errstate(invalid="ignore"):
            beyond = r > limits.high if above else r < limits.low
        for start, end in (*_lasting(time, beyond, limits.hold), *_cut_short(time, beyond, limits.hold, stops)):
            due = float(time[int(np.searchsorted(time[:-1], min(start + limits.hold - step, end) - 1e-9))])
            inside = r[(time >= start) & (time <= end)]
            extreme = float(np.nanmax(inside) if above else np.nanmin(inside))
            words = f"{_SYMBOLS[name]} {'up to' if above else 'down to'} {extreme:.2f} of the baseline"
            words += "; occlusion and clotting look alike" if code == "RETURN_OCCLUDED" else ""
            error = _crossing_error(time, r, start, ratios.noise[name], _PHASE[name])
            out.append(Cause(code, start, due, _gone(end, float(time[-1]), found), words, error))
    return out


def _gone(end: float, last: float, found: RatioResult) -> float | None:
    """Return when a cause was gone: one that the stop of the pump took out of sight stays until the pump runs again."""
    running = found.pump.running if found.pump is not None else ()
    for (_, stop), (start, _) in zip(running, (*running[1:], (float("inf"), 0.0)), strict=True):
        if abs(stop - end) <= _GLIMPSE:
            return start if start < last else None
    return end if end < last else None


def _stopped_by_alarm(log: DeviceLog, found: RatioResult) -> np.ndarray:
    """Return the moments at which the pump stopped and the device wrote an alarm, s."""
    told = np.array([*(e.time for e in log.codes), *(e.time for e in log.states if e.text.upper() == "ALARM")])
    stops = [end for _, end in found.pump.running] if found.pump is not None else []
    return np.array([stop for stop in stops if told.size and np.min(np.abs(told - stop)) <= _REACTION])


def _cut_short(time: np.ndarray, beyond: np.ndarray, hold: float, stops: np.ndarray) -> list[tuple[float, float]]:
    """Return the spans of `beyond` that the device itself ended before they had lasted: its means are not ours."""
    if stops.size == 0:
        return []
    step = float(np.median(np.diff(time)))
    short = [(a, b) for a, b in _unbroken(time, beyond, step) if _GLIMPSE <= b - a < hold - step - 1e-9]
    return [(a, b) for a, b in short if np.min(np.abs(stops - b)) <= _GLIMPSE]


def _lasting(time: np.ndarray, beyond: np.ndarray, hold: float) -> list[tuple[float, float]]:
    """Return the spans of `beyond` that last `hold` seconds; what is back for less than `hold` has not ended."""
    step = float(np.median(np.diff(time)))
    pieces = [piece for piece in _unbroken(time, beyond, step) if piece[1] - piece[0] >= hold - step - 1e-9]
    return joined(pieces, max(hold, step))


def _unbroken(time: np.ndarray, holds: np.ndarray, step: float) -> list[tuple[float, float]]:
    """Return spans of `holds`, broken where the stamps have a gap."""
    cut = np.concatenate([[False], np.diff(time) > 5.0 * step])
    return spans(time, holds & ~cut)


def _crossing_error(time: np.ndarray, ratio: np.ndarray, start: float, noise: float, phase: float) -> float:
    """Return the standard error of the moment at which a ratio crosses its limit: its noise over its slope, the stroke, the step."""
    step = float(np.median(np.diff(time)))
    i = int(np.searchsorted(time, start))
    n = max(round(0.25 / step), 1)
    near = ratio[max(i - n, 0) : i + n + 1]
    near = near[np.isfinite(near)]
    slope = abs(float(near[-1] - near[0])) / ((near.size - 1) * step) if near.size > 1 else 0.0
    from_noise = min(2.0 * noise / slope, 1.0) if slope > 0.0 else 1.0
    return float(np.sqrt(from_noise**2 + phase**2 + step**2 / 12.0))


def _out_of_range(found: RatioResult, limits: AlarmLimits) -> list[Cause]:
    out = []
    for tap, mean in found.means.items():
        with np.errstate(invalid="ignore"):
            beyond = np.abs(mean) > limits.pressure_most
        for start, end in joined(_lasting(found.grid, beyond, limits.hold), _CHATTER):
            words = f"{TAP_NAMES[tap]} pressure beyond {limits.pressure_most / 1e3:g} kPa"
            gone = end if end < found.grid[-1] else None
            out.append(Cause("PRESSURE_OUT_OF_RANGE", start, start + limits.hold, gone, words, 0.03))
    return out


def _of_flag(signal: Signal | None, wrong: bool, code: str, name: str) -> list[Cause]:
    if signal is None or not is_flag(signal):
        return []
    raised = (signal.values > 0.5) == wrong
    step = float(np.median(np.diff(signal.time))) if signal.time.size > 1 else 0.0
    error = min(step, 1.0) / np.sqrt(12.0) if signal.time.size > 20 else 0.0
    out = []
    for start, end in joined(spans(signal.time, raised), _CHATTER):
        later = signal.time[signal.time > end]
        gone = float(later[0]) if later.size else None
        out.append(Cause(code, start, start, gone, f"{name} = {int(wrong)}", error))
    return out


def _of_mismatch(mismatch: Mismatch) -> Cause:
    unit = "Pa/s" if mismatch.kind == "drift" else "Pa"
    words = f"{TAP_NAMES[mismatch.tap]}: {mismatch.kind} of {mismatch.size:.3g} {unit} between the two units"
    return Cause("SENSOR_MISMATCH", mismatch.onset, mismatch.time, mismatch.end, words, mismatch.std_error)
