"""Pressure runs of the synthetic device, as they are and spoilt: what the tests of `rap.pressures` feed in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.recording import Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.pressures.declaration import PressuresSettings
from pipeline.rigs.rap.pressures.identify import identify
from pipeline.rigs.rap.synthetic.rig import synthesize_pressures

ML_MIN = 1e-6 / 60.0
MMHG = 133.322
# A shorter R1: two speeds, all steps of the protocol.
SHORT: dict[str, Any] = {"flows": (60.0 * ML_MIN, 100.0 * ML_MIN), "duration": 260.0}

Columns = dict[str, np.ndarray]
Edit = Callable[[str, np.ndarray, Columns], tuple[np.ndarray, Columns]]


def pressures(seed: int = 1, **truth: Any) -> Recording:
    """Return a run of the synthetic device."""
    return synthesize_pressures(truth, seed)[0]


@cache
def usual() -> Recording:
    """Return the short run of the usual truth."""
    return pressures(**SHORT)


def edited(recording: Recording, edit: Edit) -> Recording:
    """Return a recording with each stream changed: ``edit(stream, time, columns) -> time, columns``."""
    streams = {}
    for name, stream in recording.streams.items():
        time, columns = edit(name, stream.time.copy(), {k: c.values.copy() for k, c in stream.channels.items()})
        channels = {k: replace(stream.channels[k], values=v) for k, v in columns.items()}
        streams[name] = Stream(name, time, channels)
    return replace(recording, streams=streams)


def changed(recording: Recording, **changes: Callable[[np.ndarray], np.ndarray]) -> Recording:
    """Return a recording with single channels changed: ``pressure_uf_rap=lambda p: 0.0 * p``."""

    def edit(_stream: str, time: np.ndarray, columns: Columns) -> tuple[np.ndarray, Columns]:
        return time, {k: changes[k](v) if k in changes else v for k, v in columns.items()}

    return edited(recording, edit)


def exchanged(recording: Recording, one: str, other: str) -> Recording:
    """Return a recording in which two channels of one stream bear each other's name."""

    def edit(_stream: str, time: np.ndarray, columns: Columns) -> tuple[np.ndarray, Columns]:
        if one in columns and other in columns:
            columns[one], columns[other] = columns[other], columns[one]
        return time, columns

    return edited(recording, edit)


def without(recording: Recording, *channels: str) -> Recording:
    """Return a recording that lacks channels; a stream that has none left goes with them."""
    streams = {}
    for name, stream in recording.streams.items():
        kept = {k: c for k, c in stream.channels.items() if k not in channels}
        if kept:
            streams[name] = Stream(name, stream.time, kept)
    return replace(recording, streams=streams)


def told(recording: Recording, conditions: Mapping[str, Any]) -> Recording:
    """Return a recording with conditions changed; None takes one away."""
    kept = {**recording.conditions, **conditions}
    return replace(recording, conditions={k: v for k, v in kept.items() if v is not None})


def found(*recordings: Recording, **settings: Any) -> Findings:
    """Identify runs."""
    return identify(list(recordings), PressuresSettings(**settings), Context("test", {}))
