"""What spoils logs on every rig: coloured noise, jitter of the clock, lost samples, wrong gains. On recordings, SI."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from pipeline.recording import Channel, Recording, Stream


def coloured(
    recordings: Iterable[Recording], rng: np.random.Generator, spread: Mapping[str, float], memory: float
) -> list[Recording]:
    """Add noise of first order to channels.

    Parameters
    ----------
    spread
        Standard deviation by channel, SI.
    memory
        Time in which its correlation falls to 1/e, s.
    """

    def add(stream: Stream, channel: Channel) -> np.ndarray:
        if channel.name not in spread:
            return channel.values
        return channel.values + spread[channel.name] * _memory(rng, stream.time, memory)

    return [_with_values(recording, add) for recording in recordings]


def gains(recordings: Iterable[Recording], rng: np.random.Generator, spread: Mapping[str, float]) -> list[Recording]:
    """Turn channels up or down by one draw each, of relative standard deviation `spread`, common to all runs."""
    factor = {name: 1.0 + share * rng.standard_normal() for name, share in spread.items()}
    return [_with_values(r, lambda _stream, c: c.values * factor[c.name] if c.name in factor else c.values)
            for r in recordings]  # fmt: skip


def scaled(recording: Recording, factor: Mapping[str, float]) -> Recording:
    """Return a recording with the named channels times a factor each: gains that are off."""
    return _with_values(recording, lambda _stream, c: c.values * factor[c.name] if c.name in factor else c.values)


def jitter(recordings: Iterable[Recording], rng: np.random.Generator, share: float) -> list[Recording]:
    """Stamp each sample late or early by a share (standard deviation) of its step, never past its neighbour."""

    def moved(stream: Stream) -> Stream:
        step = np.diff(stream.time, append=2 * stream.time[-1] - stream.time[-2])
        off = np.clip(share * rng.standard_normal(stream.size), -0.45, 0.45)
        return replace(stream, time=stream.time + off * step)

    return [_with_streams(recording, moved) for recording in recordings]


def dropouts(
    recordings: Iterable[Recording], rng: np.random.Generator, count: float, longest: int, keep: float = 0.0
) -> list[Recording]:
    """Lose stretches of samples.

    Parameters
    ----------
    count
        Mean number of stretches a stream.
    longest
        Most samples that one of them loses; each loses one at least.
    keep
        Seconds at both ends of which none is lost.
    """

    def thinned(stream: Stream) -> Stream:
        kept = np.ones(stream.size, dtype=bool)
        for _ in range(rng.poisson(count)):
            start = rng.integers(1, max(stream.size - longest - 1, 2))
            kept[start : start + rng.integers(1, longest + 1)] = False
        kept |= (stream.time < stream.time[0] + keep) | (stream.time > stream.time[-1] - keep)
        kept[[0, -1]] = True
        channels = {c.name: replace(c, values=c.values[kept]) for c in stream.channels.values()}
        return Stream(stream.name, stream.time[kept], channels)

    return [_with_streams(recording, thinned) for recording in recordings]


def _memory(rng: np.random.Generator, time: np.ndarray, memory: float) -> np.ndarray:
    """Return stationary noise of first order and variance one at these times, shape (n,)."""
    from scipy.signal import lfilter

    step = float(np.median(np.diff(time)))
    rho = float(np.exp(-step / memory))
    white = rng.standard_normal(time.size)
    white[1:] *= np.sqrt(1.0 - rho**2)
    return np.asarray(lfilter([1.0], [1.0, -rho], white))


def _with_streams(recording: Recording, change: Callable[[Stream], Stream]) -> Recording:
    return replace(recording, streams={name: change(s) for name, s in recording.streams.items()})


def _with_values(recording: Recording, change: Callable[[Stream, Channel], np.ndarray]) -> Recording:
    def changed(stream: Stream) -> Stream:
        channels = {c.name: c if c.is_text else replace(c, values=change(stream, c)) for c in stream.channels.values()}
        return Stream(stream.name, stream.time, channels)

    return _with_streams(recording, changed)
