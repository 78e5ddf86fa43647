"""Short therapy runs of the synthetic device and what is done to their logs in tests."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.synthetic.rig import synthesize_therapy
from pipeline.rigs.rap.therapy.declaration import TherapySettings
from pipeline.rigs.rap.therapy.identify import identify

SHORT = 2400.0


def made(seed: int = 4, **truth: Any) -> Recording:
    """Return one run; R4 cut to `SHORT` seconds with 0.2 L in the tank unless told otherwise."""
    usual = {"runs": ["rap_therapy_312"], "duration": SHORT, "initial_volume": 0.2e-3}
    return synthesize_therapy({**usual, **truth}, seed)[0]


@cache
def short() -> Recording:
    """Return the short therapy run that most tests alter."""
    return made()


@cache
def faults() -> Recording:
    """Return R6."""
    return synthesize_therapy({"runs": ["rap_faults"]}, 4)[0]


def altered(
    run: Recording,
    change: Callable[[str, np.ndarray], np.ndarray] | None = None,
    drop: Collection[str] = (),
    tables: Collection[str] = (),
    conditions: Mapping[str, float | str | None] | None = None,
) -> Recording:
    """Return the run with samples changed, channels left out, only some tables kept, conditions set or taken away (None)."""
    streams = {}
    for name, stream in run.streams.items():
        if tables and name not in tables:
            continue
        kept = {k: c for k, c in stream.channels.items() if k not in drop}
        made = {k: Channel(k, change(k, c.values) if change else c.values, c.unit) for k, c in kept.items()}
        if made:
            streams[name] = Stream(name, stream.time, made)
    stated = {**run.conditions, **(conditions or {})}
    return replace(run, streams=streams, conditions={k: v for k, v in stated.items() if v is not None})


def cut(run: Recording, start: float, end: float) -> Recording:
    """Return what a run logged between two moments of each clock, s."""
    streams = {}
    for name, stream in run.streams.items():
        rows = (stream.time >= start) & (stream.time <= end)
        if rows.any():
            channels = {k: Channel(k, c.values[rows], c.unit) for k, c in stream.channels.items()}
            streams[name] = Stream(name, stream.time[rows], channels)
    return replace(run, streams=streams)


def found(*runs: Recording, **settings: Any) -> Findings:
    """Identify runs."""
    return identify(list(runs), TherapySettings(**settings), Context("test", {}))


def said(findings: Findings) -> str:
    """Return everything that the findings say of the data and of the verdict."""
    return "\n".join([*findings.reasons, *(q.message for q in findings.quality)])
