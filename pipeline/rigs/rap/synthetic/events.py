"""The device's list of events: states, alarms, warnings, keys, clamps, on the device's clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recording import Channel, Stream
from pipeline.rigs.rap.synthetic.clocks import Clock

_TOGETHER = 1e-6
"""Seconds between rows of the same moment, as ingest keeps them apart."""


@dataclass(frozen=True)
class Event:
    """At the true moment `time` (s) the device writes `word` under `channel`; a number for a key."""

    time: float
    channel: str
    word: str | float


def events_table(events: Sequence[Event], clock: Clock) -> Stream:
    """Return the table; what came before the device's clock began stands at its second 0."""
    ordered = sorted(events, key=lambda event: event.time)
    stamps = np.maximum(clock.stamp(np.array([event.time for event in ordered], dtype=float)), 0.0)
    for i in range(1, stamps.size):
        stamps[i] = max(stamps[i], stamps[i - 1] + _TOGETHER)
    channels = {}
    for name in dict.fromkeys(event.channel for event in ordered):
        words = [event.word if event.channel == name else None for event in ordered]
        text = all(isinstance(word, str) for word in words if word is not None)
        values = np.array(words, dtype=object) if text else np.array([np.nan if w is None else w for w in words], float)
        channels[name] = Channel(name, values, "" if text else "1")
    return Stream("events", stamps, channels)
