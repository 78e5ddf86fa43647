"""Faults of sensors and logs, done to the finished tables of the synthetic rig (rap.md, section 8)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fnmatch import fnmatch

import numpy as np

from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.rap.synthetic.faults import Fault

_DUPLICATE_AFTER = 1e-3
Change = Callable[[np.ndarray, np.ndarray, np.ndarray, Fault], np.ndarray]


def spoilt(recording: Recording, faults: Sequence[Fault]) -> Recording:
    """Return the recording with the faults of sensors and logs, in their order."""
    for fault in faults:
        if fault.kind in _TABLES:
            recording = _each(recording, _TABLES[fault.kind], fault)
        elif fault.kind in _VALUES:
            recording = _each(recording, _changed, fault)
        elif fault.kind in _ROWS:
            recording = _each(recording, _picked, fault)
    return recording


def _each(recording: Recording, done: Callable[[Stream, Fault], Stream], fault: Fault) -> Recording:
    tables = {name: done(table, fault) for name, table in recording.streams.items()}
    return replace(recording, streams={name: table for name, table in tables.items() if table.channels})


def _swapped(table: Stream, fault: Fault) -> Stream:
    pair = {fault.channel: fault.other, fault.other: fault.channel}
    if not all(name in table.channels for name in pair):
        return table
    channels = {name: replace(table.channels[pair.get(name, name)], name=name) for name in table.channels}
    return replace(table, channels=channels)


def _without(table: Stream, fault: Fault) -> Stream:
    return replace(table, channels={n: c for n, c in table.channels.items() if not fnmatch(n, fault.channel)})


def _changed(table: Stream, fault: Fault) -> Stream:
    during = (table.time >= fault.start) & (table.time < fault.end)
    channels: dict[str, Channel] = {}
    for name, channel in table.channels.items():
        if fnmatch(name, fault.channel) and during.any():
            channel = replace(channel, values=_VALUES[fault.kind](table.time, channel.values, during, fault))
        channels[name] = channel
    return replace(table, channels=channels)


def _scaled(_time: np.ndarray, values: np.ndarray, during: np.ndarray, fault: Fault) -> np.ndarray:
    return np.where(during, fault.size * values, values)


def _turned(_time: np.ndarray, values: np.ndarray, during: np.ndarray, _fault: Fault) -> np.ndarray:
    return np.where(during, -values, values)


def _stuck(_time: np.ndarray, values: np.ndarray, during: np.ndarray, _fault: Fault) -> np.ndarray:
    return np.where(during, values[np.argmax(during)], values)


def _limited(_time: np.ndarray, values: np.ndarray, during: np.ndarray, fault: Fault) -> np.ndarray:
    return np.where(during, np.clip(values, -fault.size, fault.size), values)


def _shifted(_time: np.ndarray, values: np.ndarray, during: np.ndarray, fault: Fault) -> np.ndarray:
    return np.where(during, values + fault.size, values)


def _drifting(time: np.ndarray, values: np.ndarray, during: np.ndarray, fault: Fault) -> np.ndarray:
    return np.where(during, values + fault.size * (time - max(fault.start, time[0])) / 3600.0, values)


def _dulled(time: np.ndarray, values: np.ndarray, during: np.ndarray, fault: Fault) -> np.ndarray:
    """An air bubble before the sensor: another pole, of the time constant `size` (s)."""
    from scipy.signal import lfilter

    first, last = np.flatnonzero(during)[[0, -1]]
    keep = float(np.exp(-np.median(np.diff(time)) / fault.size))
    slow, _ = lfilter([1.0 - keep], [1.0, -keep], values[first : last + 1], zi=[keep * values[first]])
    return np.concatenate([values[:first], slow, values[last + 1 :]])


_VALUES: dict[str, Change] = {
    "mmhg": _scaled,
    "kpa": _scaled,
    "unit": _scaled,
    "sign": _turned,
    "stuck": _stuck,
    "saturated": _limited,
    "zero_not_taken": _shifted,
    "scale_touched": _shifted,
    "scale_drift": _drifting,
    "air_at_sensor": _dulled,
}


def _picked(table: Stream, fault: Fault) -> Stream:
    if fault.table not in ("", table.name):
        return table
    time, at = _ROWS[fault.kind](table.time, fault)
    channels = {name: replace(channel, values=channel.values[at]) for name, channel in table.channels.items()}
    return Stream(table.name, time, channels)


def _lost(time: np.ndarray, fault: Fault) -> tuple[np.ndarray, np.ndarray]:
    at = np.flatnonzero((time < fault.start) | (time >= fault.end))
    return time[at], at


def _twice(time: np.ndarray, fault: Fault) -> tuple[np.ndarray, np.ndarray]:
    """Each row of the span again, a millisecond later."""
    again = np.flatnonzero((time >= fault.start) & (time < fault.end))
    at = np.concatenate([np.arange(time.size), again])
    stamps = np.concatenate([time, time[again] + _DUPLICATE_AFTER])
    order = np.argsort(stamps, kind="stable")
    return stamps[order], at[order]


def _cut(time: np.ndarray, fault: Fault) -> tuple[np.ndarray, np.ndarray]:
    at = np.flatnonzero(time < fault.start)
    return time[at], at


_ROWS: dict[str, Callable[[np.ndarray, Fault], tuple[np.ndarray, np.ndarray]]] = {
    "dropout": _lost,
    "duplicated": _twice,
    "truncated": _cut,
}
_TABLES: dict[str, Callable[[Stream, Fault], Stream]] = {"swapped": _swapped, "missing": _without}
