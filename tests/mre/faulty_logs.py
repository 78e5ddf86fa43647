"""Logs of the synthetic shear rig with a fault put in, and what findings must then hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from pipeline.findings import Findings
from pipeline.recording import Channel, Recording, Stream
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.shear.declaration import SHEAR, ShearSettings
from pipeline.rigs.mre.synthetic import ShearTruth

TRUTH = ShearTruth()
ODD = "sh_10hz_3a"
Change = Callable[[np.ndarray, np.ndarray], np.ndarray]


def identify(recordings: Iterable[Recording], **settings: object) -> Findings:
    # Two starts find what six do in these logs; the tests of the search itself use the usual number.
    findings = SHEAR.identify(list(recordings), ShearSettings(**{"starts": 2, **settings}), Context("test", {}))
    assert SHEAR.sections(findings)
    assert all(SHEAR.methods(findings))
    return findings


def changed(recording: Recording, channel: str, change: Change) -> Recording:
    (stream,) = recording.streams.values()
    old = stream.channels[channel]
    new = replace(old, values=change(stream.time, old.values.copy()))
    return replace(recording, streams={stream.name: replace(stream, channels={**stream.channels, channel: new})})


def in_one(recordings: list[Recording], channel: str, change: Change, run: str = ODD) -> list[Recording]:
    return [changed(r, channel, change) if r.run == run else r for r in recordings]


def in_all(recordings: list[Recording], channel: str, change: Change) -> list[Recording]:
    return [changed(r, channel, change) for r in recordings]


def with_channel(recording: Recording, name: str, values: np.ndarray | float, unit: str) -> Recording:
    (stream,) = recording.streams.values()
    new = Channel(name, np.broadcast_to(np.asarray(values, dtype=float), stream.time.shape).copy(), unit)
    return replace(recording, streams={stream.name: replace(stream, channels={**stream.channels, name: new})})


def without_channel(recording: Recording, name: str) -> Recording:
    (stream,) = recording.streams.values()
    kept = {key: channel for key, channel in stream.channels.items() if key != name}
    return replace(recording, streams={stream.name: replace(stream, channels=kept)})


def with_conditions(recording: Recording, **conditions: object) -> Recording:
    merged = {**recording.conditions, **conditions}
    return replace(recording, conditions={k: v for k, v in merged.items() if v is not None})


def said(findings: Findings, *words: str, run: str | None = None) -> bool:
    """Tell whether one quality finding or reason holds all of the words."""
    texts = [q.message for q in findings.quality if run is None or q.run == run]
    texts += [] if run is not None else [*findings.reasons, *findings.advice]
    return any(all(word in text for word in words) for text in texts)


def left_out(findings: Findings) -> dict[str, str]:
    return {run.run: run.reason for run in findings.runs if not run.used}


def assert_numbers_hold(findings: Findings) -> None:
    """Every number told is within 4.5 standard errors of the truth: chance of a miss below 1e-4."""
    truth = {name: getattr(TRUTH, name) for name in ("k1", "s1", "k2", "alpha_bw", "rho", "c_bw", "n_bw")}
    truth["tau"] = TRUTH.s1 / TRUTH.k1
    checked = 0
    for parameter in findings.parameters:
        current = float(parameter.at.get("coil_current", 0.0))
        true = truth.get(parameter.name)
        true = TRUTH.k_mr_at(current) if parameter.name == "k_mr" else true
        true = TRUTH.s_mr_at(current) if parameter.name == "s_mr" else true
        if true is not None and parameter.value is not None and parameter.std_error:
            assert abs(parameter.value - true) < 4.5 * parameter.std_error, parameter
            checked += 1
    assert checked > 7


def noise(seed: int, size: int, sigma: float = 1.0) -> np.ndarray:
    return sigma * np.random.default_rng(seed).standard_normal(size)


def on_rows(recording: Recording, kept: np.ndarray) -> Recording:
    """Return the recording with some of its rows only."""
    (stream,) = recording.streams.values()
    channels = {name: replace(channel, values=channel.values[kept]) for name, channel in stream.channels.items()}
    return replace(recording, streams={stream.name: Stream(stream.name, stream.time[kept], channels)})


def with_time(recording: Recording, factor: float) -> Recording:
    """Return the recording with stamps that are too long by a factor."""
    (stream,) = recording.streams.values()
    return replace(recording, streams={stream.name: replace(stream, time=factor * stream.time)})


def held(t: np.ndarray, values: np.ndarray, start: float, end: float) -> np.ndarray:
    """Return values that hang from `start` to `end` (s)."""
    there = (t > start) & (t < end)
    values[there] = values[np.argmax(there)]
    return values
