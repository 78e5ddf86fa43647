"""Logs of the synthetic hold and step tests with a fault put in, and what findings must then hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Figure, Table
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.hold.declaration import HOLD, HoldSettings
from pipeline.rigs.mre.step.declaration import STEP, StepSettings

Change = Callable[[np.ndarray, np.ndarray], np.ndarray]


def hold(recordings: Sequence[Recording], **settings: Any) -> Findings:
    return _with_its_report(HOLD, HOLD.identify(list(recordings), HoldSettings(**settings), Context("test", {})))


def step(recordings: Sequence[Recording], **settings: Any) -> Findings:
    return _with_its_report(STEP, STEP.identify(list(recordings), StepSettings(**settings), Context("test", {})))


def captions(findings: Findings) -> dict[str, str]:
    """Return the captions of the report on a hold or step test by the name of figure or table."""
    chapters = (STEP if findings.experiment == STEP.id else HOLD).sections(findings)
    blocks = [b for chapter in chapters for b in chapter.blocks if isinstance(b, Figure | Table)]
    return {block.name: block.caption for block in blocks}


def _with_its_report(experiment: Any, findings: Findings) -> Findings:
    assert experiment.sections(findings)
    assert all(experiment.methods(findings))
    declared = {spec.name: spec.unit for spec in experiment.parameters}
    assert all(declared[p.name] == p.unit for p in findings.parameters)
    return findings


def changed(recording: Recording, channel: str, change: Change) -> Recording:
    (stream,) = recording.streams.values()
    new = replace(stream.channels[channel], values=change(stream.time, stream.channels[channel].values.copy()))
    return replace(recording, streams={stream.name: replace(stream, channels={**stream.channels, channel: new})})


def with_channel(recording: Recording, channel: Channel) -> Recording:
    (stream,) = recording.streams.values()
    return replace(
        recording, streams={stream.name: replace(stream, channels={**stream.channels, channel.name: channel})}
    )


def without(recording: Recording, *names: str) -> Recording:
    (stream,) = recording.streams.values()
    kept = {name: channel for name, channel in stream.channels.items() if name not in names}
    return replace(recording, streams={stream.name: replace(stream, channels=kept)})


def rows(recording: Recording, kept: np.ndarray) -> Recording:
    (stream,) = recording.streams.values()
    channels = {name: replace(c, values=c.values[kept]) for name, c in stream.channels.items()}
    return replace(recording, streams={stream.name: Stream(stream.name, stream.time[kept], channels)})


def said(findings: Findings, *words: str) -> bool:
    """Tell whether one reason of the verdict holds all of the words."""
    return any(all(word in reason for word in words) for reason in findings.reasons)
