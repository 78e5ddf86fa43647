"""Logs of flow runs for the tests: synthetic campaigns, made once, and what may be done to them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.identify import identify
from pipeline.rigs.rap.synthetic.rig import synthesize_flow

ML_MIN = 1e-6 / 60.0
BOTH = ("calibration", "holdout")


def logs(sets: Sequence[str] = BOTH, seed: int = 1, **truth: Any) -> list[Recording]:
    """Return runs of the synthetic rig; 40 s at each setting."""
    return synthesize_flow({"sets": list(sets), "hold": 40.0, **truth}, seed)


@cache
def usual() -> tuple[Recording, ...]:
    """Return calibration and hold-out with the same tube."""
    return tuple(logs())


def identified(recordings: Sequence[Recording]) -> Findings:
    """Return the findings of a campaign."""
    return identify(list(recordings), FlowSettings(), Context("test", {}))


@cache
def of_the_usual() -> Findings:
    """Return the findings of `usual`."""
    return identified(usual())


def touched(
    recordings: Sequence[Recording], channel: str, change: Callable[[np.ndarray, np.ndarray], np.ndarray], run: str = ""
) -> list[Recording]:
    """Return the runs (or that one) with a channel changed as ``change(time, values)``."""

    def stream(one: Stream) -> Stream:
        if channel not in one.channels:
            return one
        own = one.channels[channel]
        return Stream(one.name, one.time, {**one.channels, channel: replace(own, values=change(one.time, own.values))})

    return [
        replace(r, streams={name: stream(one) for name, one in r.streams.items()}) if run in ("", r.run) else r
        for r in recordings
    ]


def without(recordings: Sequence[Recording], *channels: str, run: str = "") -> list[Recording]:
    """Return the runs (or that one) without these channels."""

    def stream(one: Stream) -> Stream:
        return Stream(one.name, one.time, {name: c for name, c in one.channels.items() if name not in channels})

    return [
        replace(r, streams={name: stream(one) for name, one in r.streams.items()}) if run in ("", r.run) else r
        for r in recordings
    ]


def told(recordings: Sequence[Recording], conditions: Mapping[str, float | str | None]) -> list[Recording]:
    """Return the runs with these conditions; None leaves one out."""
    return [
        replace(r, conditions={k: v for k, v in {**r.conditions, **conditions}.items() if v is not None})
        for r in recordings
    ]


def slowed(recordings: Sequence[Recording], step: int) -> list[Recording]:
    """Return the runs with every `step`-th row of the device's table only."""

    def stream(one: Stream) -> Stream:
        channels = {name: Channel(name, c.values[::step], c.unit) for name, c in one.channels.items()}
        return Stream(one.name, one.time[::step], channels)

    return [
        replace(r, streams={name: stream(one) if name == "device" else one for name, one in r.streams.items()})
        for r in recordings
    ]


def warnings(findings: Findings, run: str = "") -> str:
    """Return what is warned of, in one text."""
    return "\n".join(q.message for q in findings.quality if q.level != "note" and run in ("", q.run))
