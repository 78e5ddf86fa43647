"""Logs of the synthetic dynamic test and ways to spoil them, for the tests of `tpjb.dynamic`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from unstated_gains import unstated

from pipeline.findings import Findings
from pipeline.recording import Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb import truth
from pipeline.rigs.tpjb.dynamic.declaration import DynamicSettings
from pipeline.rigs.tpjb.dynamic.identify import identify
from pipeline.rigs.tpjb.dynamic.synthetic import synthesize

NAMES = ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy")


def logs(seed: int = 1, **overrides: Any) -> list[Recording]:
    """One bearing at one load: an in-phase and an antiphase log."""
    return unstated(synthesize({"bearings": ["4pad-L1"], **overrides}, seed))


def found_in(recordings: list[Recording], settings: Mapping[str, Any] | None = None, **uses: Findings) -> Findings:
    return identify(recordings, DynamicSettings(**(settings or {})), Context("test", uses))


def changed(recording: Recording, channel: str, change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Recording:
    """The same recording with one channel's values as ``change(time, values)``."""
    stream = recording.stream_of(channel)
    new = replace(stream.channels[channel], values=change(stream.time, stream.channels[channel].values.copy()))
    return replace(recording, streams={stream.name: replace(stream, channels={**stream.channels, channel: new})})


def without(recording: Recording, *channels: str) -> Recording:
    (stream,) = recording.streams.values()
    kept = {name: channel for name, channel in stream.channels.items() if name not in channels}
    return replace(recording, streams={stream.name: replace(stream, channels=kept)})


def conditions(recording: Recording, **values: Any) -> Recording:
    """The same recording with other conditions; None takes one away."""
    merged = {**recording.conditions, **values}
    return replace(recording, conditions={k: v for k, v in merged.items() if v is not None})


def thinned(recording: Recording, every: int) -> Recording:
    """Every n-th row only: another rate."""
    (stream,) = recording.streams.values()
    channels = {n: replace(c, values=c.values[::every]) for n, c in stream.channels.items()}
    return replace(recording, streams={stream.name: Stream(stream.name, stream.time[::every], channels)})


def true_value(name: str, frequency: float, bearing: str = "4pad-L1") -> float:
    H = truth.bearing(bearing).impedance(frequency)["xy".index(name[1]), "xy".index(name[2])]
    return float(H.real if name[0] == "k" else H.imag / (2 * np.pi * frequency))


def worst_z(findings: Findings, bearing: str = "4pad-L1", shaft: float = truth.SHAFT_SPEED) -> float:
    """The largest error of a coefficient, at tones and synchronous, in half widths of its 95 % interval."""
    worst = 0.0
    for p in findings.parameters:
        if p.value is None or p.ci95 is None:
            continue
        frequency = shaft / (2 * np.pi) if "synchronous" in p.at else float(p.at["frequency"])
        half = (p.ci95[1] - p.ci95[0]) / 2
        worst = max(worst, abs(p.value - true_value(p.name, frequency, bearing)) / half)
    return worst


def messages(findings: Findings) -> str:
    return "\n".join([*findings.reasons, *(q.message for q in findings.quality)])
