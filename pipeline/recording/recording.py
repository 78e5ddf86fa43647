"""Recording: what a run is once it has been read. Names are canonical, numbers are SI.

A recording holds streams (one time base each), the run's conditions, what was found wrong with it,
and where it came from. It knows nothing of files; `storage` writes and reads it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pipeline.errors import InputError, listing

Level = Literal["note", "warning", "error"]
Condition = float | str | bool
# Samples of one block of a stream in memory; a stream on disk has the blocks of its file.
_BLOCK = 1 << 18


@dataclass(frozen=True)
class QualityFinding:
    """One plain sentence on the data: how bad, where, and what was seen.

    `run`, `channel` and `span` (seconds, in the run's time) are None where it concerns all of them.
    """

    level: Level
    message: str
    run: str | None = None
    channel: str | None = None
    span: tuple[float, float] | None = None


@dataclass(frozen=True)
class Channel:
    """Samples of one quantity: `values` has shape (n,), float64 in SI, or text with unit ``""``."""

    name: str
    values: np.ndarray
    unit: str

    @property
    def is_text(self) -> bool:
        """Tell whether the samples are words (states, codes) and not numbers."""
        return self.unit == "" and self.values.dtype.kind in "OUTS"


@dataclass(frozen=True)
class Stream:
    """Channels that share one time base: `time` has shape (n,), s, strictly increasing."""

    name: str
    time: np.ndarray
    channels: Mapping[str, Channel]

    @property
    def rate(self) -> float:
        """Samples per second, from the median step; NaN for fewer than two samples."""
        return float(1.0 / np.median(np.diff(self.time))) if self.time.size > 1 else float("nan")

    @property
    def duration(self) -> float:
        """Seconds from first to last sample."""
        return float(self.time[-1] - self.time[0]) if self.time.size else 0.0

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def span(self) -> tuple[float, float]:
        """Time of the first and of the last sample, s; NaN where there is none."""
        return (float(self.time[0]), float(self.time[-1])) if self.time.size else (float("nan"), float("nan"))

    def blocks(self, names: Sequence[str]) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
        """Yield the stream piece by piece: time, shape (n,), and the values of each channel in `names`.

        A stream that lies on disk holds one piece at a time in memory.
        """
        for start in range(0, self.time.size, _BLOCK):
            piece = slice(start, start + _BLOCK)
            yield self.time[piece], [self.channels[name].values[piece] for name in names]


@dataclass(frozen=True)
class SourceFile:
    """A log as dropped: `path` relative to where it was asked for, hash of its bytes, who read it."""

    path: str
    sha256: str
    size: int
    reader: str
    units_found: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Provenance:
    """Where a recording came from and every change made on the way.

    `begins` is the moment of second 0 in seconds since 1970, None where no clock of the logs had a date.
    """

    files: tuple[SourceFile, ...] = ()
    repairs: tuple[str, ...] = ()
    condition_sources: Mapping[str, str] = field(default_factory=dict)
    version: str = ""
    begins: float | None = None


@dataclass(frozen=True)
class Recording:
    """One run: streams by name, conditions in SI (or text), quality findings, provenance."""

    run: str
    streams: Mapping[str, Stream]
    conditions: Mapping[str, Condition] = field(default_factory=dict)
    quality: tuple[QualityFinding, ...] = ()
    provenance: Provenance = Provenance()

    def __iter__(self) -> Iterator[Channel]:
        for stream in self.streams.values():
            yield from stream.channels.values()

    def __contains__(self, channel: str) -> bool:
        return any(channel in stream.channels for stream in self.streams.values())

    @property
    def names(self) -> list[str]:
        """Names of all channels; none of their samples is read for that."""
        return [name for stream in self.streams.values() for name in stream.channels]

    def stream_of(self, channel: str) -> Stream:
        """Return the stream that holds `channel`.

        Raises
        ------
        InputError
            If the run has no such channel; the text lists those it has.
        """
        for stream in self.streams.values():
            if channel in stream.channels:
                return stream
        raise InputError(f"run '{self.run}' has no channel '{channel}'; it has {listing(self.names)}.")

    def signal(self, channel: str) -> tuple[np.ndarray, np.ndarray]:
        """Return time (s) and values (SI) of a channel, each of shape (n,)."""
        stream = self.stream_of(channel)
        return stream.time, stream.channels[channel].values

    def values(self, channel: str) -> np.ndarray:
        """Return the values (SI) of a channel, shape (n,)."""
        return self.stream_of(channel).channels[channel].values

    def condition(self, name: str, default: float | None = None) -> float:
        """Return a numeric condition in SI, or `default` where the run lacks it.

        Raises
        ------
        InputError
            If the run lacks it and there is no default, or it is text.
        """
        value = self.conditions.get(name, default)
        if value is None or isinstance(value, str):
            raise InputError(f"run '{self.run}' has no number for the condition '{name}', found {value!r}.")
        return float(value)
