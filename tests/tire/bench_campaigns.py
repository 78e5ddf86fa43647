"""Short synthetic bench campaigns for the tests, made once, and ways to spoil their logs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.recording import Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.tire.bench.declaration import BENCH, BenchSettings
from pipeline.rigs.tire.synthetic.rig import synthesize_bench


def identified(recordings: Sequence[Recording]) -> Findings:
    """Identify with the usual settings."""
    return BENCH.identify(recordings, BenchSettings(), Context("campaign", {}))


@cache
def logs(**truth: Any) -> tuple[Recording, ...]:
    """Return the seven runs of the sheet, 10 s each unless said otherwise."""
    return tuple(synthesize_bench({"duration": 10.0, **truth}, 3))


@cache
def findings() -> Findings:
    """Return the findings of the seven sound runs."""
    return identified(logs())


def few_logs() -> tuple[Recording, ...]:
    """Return the five of them that tell most."""
    return tuple(log for log in logs() if log.run in ("load_1000", "load_1500", "load_2000", "load_3000", "speed_20"))


def variant(name: str) -> Recording:
    """Return the log of a run with a fault."""
    return synthesize_bench({"runs": [], "variants": [name], "duration": 20.0}, 3)[0]


def without(recording: Recording, channel: str) -> Recording:
    """Return a log that lacks a channel."""
    streams = {
        name: Stream(name, s.time, {c: v for c, v in s.channels.items() if c != channel})
        for name, s in recording.streams.items()
    }
    return replace(recording, streams=streams)


def spoilt(recording: Recording, channel: str, change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    """Return a log with other samples in a channel."""
    stream = recording.stream_of(channel)
    channels = dict(stream.channels)
    channels[channel] = replace(channels[channel], values=change(channels[channel].values.copy()))
    return replace(recording, streams={**recording.streams, stream.name: Stream(stream.name, stream.time, channels)})


def told(recording: Recording, **conditions: Any) -> Recording:
    """Return a log with other conditions; None leaves one out."""
    kept = {name: value for name, value in recording.conditions.items() if conditions.get(name, value) is not None}
    return replace(recording, conditions={**kept, **{n: v for n, v in conditions.items() if v is not None}})


def without_ring(recordings: Sequence[Recording]) -> list[Recording]:
    """Return logs whose sensor length is not known: no ring is fitted, which takes most of the time."""
    return [told(log, sensor_length_flex=None) for log in recordings]


def shifted(recording: Recording, seconds: float) -> Recording:
    """Return a log whose reference table is late."""
    bench = recording.streams["bench"]
    return replace(recording, streams={**recording.streams, "bench": replace(bench, time=bench.time + seconds)})
