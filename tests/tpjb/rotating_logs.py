"""Logs of the synthetic rotating-load rig and changes to them, for the tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from unstated_gains import unstated

from pipeline.findings import Findings
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.tpjb.rotating.declaration import RotatingSettings
from pipeline.rigs.tpjb.rotating.identify import identify
from pipeline.rigs.tpjb.rotating.synthetic import synthesize
from pipeline.rigs.tpjb.truth import BEARINGS, Bearing

GAPS = [f"gap_{axis}{side}{plane}" for plane in "12" for axis in "uv" for side in "pm"]
NAMES = ("kxx", "kxy", "kyx", "kyy", "kxx2", "kxy2", "kyx2", "kyy2", "kxxy", "kyxy")
Change = Callable[[np.ndarray], np.ndarray]


def logs(*runs: str, seed: int = 1, **truth: object) -> list[Recording]:
    """Return synthetic logs of runs such as "A4"."""
    return unstated(synthesize({"runs": list(runs), **truth}, seed))


def changed(recording: Recording, **changes: Change | None) -> Recording:
    """Return the log with channels changed by a function, or without those set to None."""
    stream = recording.streams["lf"]
    channels = dict(stream.channels)
    for name, change in changes.items():
        if change is None:
            channels.pop(name)
        else:
            channels[name] = Channel(name, np.asarray(change(channels[name].values), dtype=float), channels[name].unit)
    return replace(recording, streams={"lf": Stream("lf", stream.time, channels)})


def without(recording: Recording, *conditions: str, **others: object) -> Recording:
    """Return the log without some conditions, and with others."""
    kept = {name: value for name, value in recording.conditions.items() if name not in conditions}
    return replace(recording, conditions={**kept, **others})


def found(recordings: list[Recording], **settings: object) -> Findings:
    """Return the findings of some logs."""
    return identify(recordings, RotatingSettings(**settings), Context("test", {}))


def coefficients(bearing: str) -> dict[str, float]:
    """Return the true coefficients of a synthetic bearing by name."""
    made: Bearing = BEARINGS[bearing]
    return dict(zip(NAMES, (*made.stiffness, *made.quadratic), strict=True))


def said(findings: Findings, text: str) -> bool:
    """Tell whether a warning or error of the quality findings holds a text."""
    return any(text in q.message for q in findings.quality if q.level != "note")
