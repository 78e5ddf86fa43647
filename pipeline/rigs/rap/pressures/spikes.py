"""Lone samples far off their neighbours: electric interference, no pressure. They are told, and left out before anything is judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pipeline.errors import listing
from pipeline.recording import QualityFinding, Recording, Stream
from pipeline.rigs.rap.conditions import TAPS, pressure
from pipeline.rigs.rap.pressures.record import READERS, WORDS
from pipeline.rigs.rap.tables import Signal, signal

# A spike is at most so many samples wide; it stands off the median of so many neighbours on either side.
_WIDEST = 3
# It stands off by that many robust standard deviations of what samples do, and by half of the channel's usual range.
_SIGMAS, _RANGE = 12.0, 0.5
# Usual range: without that share at either end.
_TAIL = 0.02
# More than that share of a channel is no interference but the channel itself.
_MOST = 0.05
# Slower logs see a real rise of pressure in one sample, Hz.
_SLOWEST = 8.0


def spikes(one: Signal) -> np.ndarray:
    """Return which samples of a pressure are spikes, shape (n,); none where they are so many that they are no exception."""
    nothing = np.zeros(one.values.size, dtype=bool)
    if one.values.size < 10 * _WIDEST or not one.rate >= _SLOWEST:
        return nothing
    padded = np.pad(one.values, _WIDEST, mode="reflect")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _WIDEST + 1), axis=1)
    off = np.abs(one.values - around)
    low, high = np.quantile(one.values, (_TAIL, 1.0 - _TAIL))
    # Coarse readings of a pump at rest stand still for the most part: their noise is a step of the converter at least.
    step = float(np.diff(np.unique(one.values)).min()) if low < high else 0.0
    usual = max(1.4826 * float(np.median(off)), step)
    found = off > max(_SIGMAS * usual, _RANGE * float(high - low))
    found[:_WIDEST] = found[-_WIDEST:] = False  # neighbours on one side only: a steep flank is no spike
    return found if high > low and found.sum() <= _MOST * found.size else nothing


def without_spikes(recording: Recording) -> tuple[Recording, list[QualityFinding]]:
    """Return a recording whose pressures lack their spikes, and a warning for each reader that has some."""
    told: list[QualityFinding] = []
    spiky: dict[str, np.ndarray] = {}
    for reader in READERS:
        hit: dict[str, tuple[Signal, np.ndarray]] = {}
        for tap in TAPS:
            one = signal(recording, pressure(tap, reader))
            if one is not None and (found := spikes(one)).any():
                hit[one.name] = (one, found)
        if hit:
            told.append(_told(recording.run, reader, hit))
        spiky |= {name: one.time[found] for name, (one, found) in hit.items()}
    if not spiky:
        return recording, told
    streams = {name: _stream(stream, spiky) for name, stream in recording.streams.items()}
    return replace(recording, streams=streams), told


def _stream(stream: Stream, spiky: Mapping[str, np.ndarray]) -> Stream:
    channels = dict(stream.channels)
    for name in channels.keys() & spiky.keys():
        values = np.where(np.isin(stream.time, spiky[name]), np.nan, channels[name].values)
        channels[name] = replace(channels[name], values=values)
    return Stream(stream.name, stream.time, channels)


def _told(run: str, reader: str, hit: Mapping[str, tuple[Signal, np.ndarray]]) -> QualityFinding:
    shares = listing([f"{name} ({100.0 * found.mean():.2g} % of the samples)" for name, (_, found) in hit.items()], 8)
    first = min(float(one.time[found][0]) for one, found in hit.values())
    last = max(float(one.time[found][-1]) for one, found in hit.values())
    largest = max(float(np.abs(one.values[found]).max()) for one, found in hit.values())
    text = (
        f"lone spikes of up to {1e-3 * largest:.3g} kPa in {shares}, {WORDS[reader]} readings, one to {_WIDEST} samples wide, first at {first:.5g} s: electric "
        "interference and no pressure. These samples are not used; look at shield and ground of the sensor cables"
    )
    return QualityFinding("warning", text, run, next(iter(hit)), (first, last))
