"""Samples of a TDMS group's channels: asked of the file one channel after another, or held while its segments pass.

LabVIEW writes a segment whenever it has some samples. Each channel that is asked for alone then costs a walk over all
segments; where these are many and small they are read once, in their order, for all channels.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.ingest.reader import BLOCK_ROWS

# Where the pieces have more bytes of each channel, asking for one channel after another is quicker.
_LARGEST_PIECE = 8 << 10
# So many samples of one channel may wait for those of another.
_MOST_WAITING = 8 * BLOCK_ROWS
# With less than this share of the file's channels asked for, most of what passes would be read in vain.
_LEAST_SHARE = 0.2


class Whole:
    """A group of an opened file."""

    def __init__(self, path: Path, file: Any, group: str) -> None:
        self.file = file
        self._path, self._group = path, group

    def samples(self, channel: str, start: int, stop: int) -> np.ndarray:
        """Return samples of a channel, shape (stop - start,)."""
        return np.asarray(self.file[self._group][channel].read_data(start, stop - start))

    def passes(self, channels: Iterable[str], block: int) -> Iterator[Held]:
        """Yield the samples of these channels as they pass, each time there are `block` rows of all, and at the end.

        Nothing is yielded of a file for which this is not worth it; it ends early where channels do not come together.
        """
        wanted = set(channels)
        if not wanted or not self._is_worth_it(len(wanted)):
            return
        held = Held(wanted)
        for chunk in self.file.data_chunks():
            held.add(chunk[self._group])
            if held.rows >= block:
                yield held
                held.drop()
            if held.waiting > _MOST_WAITING:
                return
        if held.rows:
            yield held

    def _is_worth_it(self, wanted: int) -> bool:
        total = sum(len(group.channels()) for group in self.file.groups())
        reader = getattr(self.file, "_reader", None)
        pieces = sum(int(getattr(segment, "num_chunks", 0)) for segment in getattr(reader, "_segments", None) or ())
        small = pieces > 1 and self._path.stat().st_size < pieces * total * _LARGEST_PIECE
        return small and wanted > 1 and wanted >= _LEAST_SHARE * total


class Held:
    """Samples that have passed and were not dropped yet; `start` and `rows` tell which ones all channels have."""

    def __init__(self, channels: set[str]) -> None:
        self.start = 0
        self._parts: dict[str, list[np.ndarray]] = {name: [] for name in channels}
        self._counts = dict.fromkeys(channels, 0)

    @property
    def rows(self) -> int:
        """Samples that every channel has."""
        return min(self._counts.values())

    @property
    def waiting(self) -> int:
        """Samples of the channel that is furthest ahead."""
        return max(self._counts.values())

    def add(self, chunk: Any) -> None:
        """Take in what a piece of the file has of the group's channels."""
        for name, parts in self._parts.items():
            values = np.asarray(chunk[name][:])
            if values.size:
                parts.append(values)
                self._counts[name] += values.size

    def samples(self, channel: str, start: int, stop: int) -> np.ndarray:
        """Return samples of a channel, shape (stop - start,); they must be among those held."""
        parts = self._parts[channel]
        if len(parts) > 1:
            parts[:] = [np.concatenate(parts)]
        return parts[0][start - self.start : stop - self.start]

    def drop(self) -> None:
        """Drop the samples that all channels have."""
        rows = self.rows
        for name, parts in self._parts.items():
            left = self.samples(name, self.start + rows, self.start + self._counts[name])
            parts[:] = [left.copy()] if left.size else []
            self._counts[name] -= rows
        self.start += rows
