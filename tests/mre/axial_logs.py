"""Logs of the synthetic press with faults, for the tests of `mre.axial`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.recording import Channel, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.axial.declaration import AxialSettings
from pipeline.rigs.mre.axial.identify import identify
from pipeline.rigs.mre.axial.synthetic import synthesize

Change = Callable[[np.ndarray, dict[str, np.ndarray]], dict[str, np.ndarray]]


def press(seed: int = 1, **truth: Any) -> list[Recording]:
    """Return the runs of the synthetic press."""
    return synthesize(truth, seed)


def changed(recording: Recording, change: Change, keep: np.ndarray | None = None, **conditions: Any) -> Recording:
    """Return the recording with channels changed by ``change(time, {name: values})``; None drops a condition."""
    (stream,) = recording.streams.values()
    given = {name: channel.values.copy() for name, channel in stream.channels.items()}
    new = change(stream.time, given)
    rows = np.ones(stream.time.size, dtype=bool) if keep is None else keep
    units = {name: channel.unit for name, channel in stream.channels.items()}
    channels = {name: Channel(name, np.asarray(values)[rows], units[name]) for name, values in new.items()}
    told = {k: v for k, v in {**recording.conditions, **conditions}.items() if v is not None}
    return replace(
        recording, streams={"axial": replace(stream, time=stream.time[rows], channels=channels)}, conditions=told
    )


def unchanged(_time: np.ndarray, channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Change nothing."""
    return channels


def scaled(**factors: float) -> Change:
    """Return a change that multiplies channels."""
    return lambda _t, c: {name: values * factors.get(name, 1.0) for name, values in c.items()}


def found(*recordings: Recording, **settings: Any) -> Findings:
    """Identify recordings."""
    return identify(list(recordings), AxialSettings(**settings), Context("test", {}))


def words(findings: Findings) -> str:
    """Return all that is said, in one text."""
    return " ".join([*findings.reasons, *findings.advice, *(q.message for q in findings.quality)])
