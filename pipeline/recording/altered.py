"""A recording with some channels altered while they are read: whatever lies on disk stays there until it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.recording.recording import Channel, Recording, Stream

Alteration = Callable[[np.ndarray], np.ndarray]


def altered(recording: Recording, changes: Mapping[str, Alteration]) -> Recording:
    """Return `recording` with the samples of the channels in `changes` run through them; texts stay as they are."""
    streams = {
        name: _AlteredStream(stream, changes) if changes.keys() & stream.channels.keys() else stream
        for name, stream in recording.streams.items()
    }
    return replace(recording, streams=streams)


class _AlteredChannels(Mapping[str, Channel]):
    def __init__(self, channels: Mapping[str, Channel], changes: Mapping[str, Alteration]) -> None:
        self._channels, self._changes = channels, changes
        self._made: dict[str, Channel] = {}

    def __getitem__(self, name: str) -> Channel:
        if name not in self._made:
            channel = self._channels[name]
            change = None if channel.is_text else self._changes.get(name)
            self._made[name] = channel if change is None else replace(channel, values=change(channel.values))
        return self._made[name]

    def __contains__(self, name: object) -> bool:
        return name in self._channels

    def __iter__(self) -> Iterator[str]:
        return iter(self._channels)

    def __len__(self) -> int:
        return len(self._channels)


class _AlteredStream(Stream):
    def __init__(self, stream: Stream, changes: Mapping[str, Alteration]) -> None:
        object.__setattr__(self, "name", stream.name)
        object.__setattr__(self, "channels", _AlteredChannels(stream.channels, changes))
        object.__setattr__(self, "_stream", stream)
        object.__setattr__(self, "_changes", changes)

    _stream: Stream
    _changes: Mapping[str, Alteration]

    def __getattr__(self, name: str) -> np.ndarray:
        # Only what is not there yet comes here: the time base, once.
        if name != "time":
            raise AttributeError(name)
        object.__setattr__(self, "time", self._stream.time)
        return self.time

    @property
    def size(self) -> int:
        return self._stream.size

    @property
    def span(self) -> tuple[float, float]:
        return self._stream.span

    @property
    def duration(self) -> float:
        return self._stream.duration

    def blocks(self, names: Sequence[str]) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
        for time, columns in self._stream.blocks(names):
            changed = [
                self._changes[name](values) if name in self._changes and values.dtype.kind == "f" else values
                for name, values in zip(names, columns, strict=True)
            ]
            yield time, changed
