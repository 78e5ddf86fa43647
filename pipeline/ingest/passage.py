"""The way of one stream's blocks through its checks and, when ingested, into its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from pipeline.ingest.mapping import SelectedChannel
from pipeline.ingest.quality import StreamQuality
from pipeline.recording.storage import StreamWriter


class Passage:
    """Takes the blocks of a stream through its checks and, where there is a path, into its file.

    A block is written in the background while it is checked and the next one is read.
    """

    def __init__(self, channels: Sequence[SelectedChannel], path: Path | None = None) -> None:
        self._channels, self._path = channels, path
        self._writer: StreamWriter | None = None
        self._background = ThreadPoolExecutor(1)
        self._writing: Future[None] | None = None
        self.restart()

    def __enter__(self) -> Passage:
        return self

    def __exit__(self, *_error: object) -> None:
        self._background.shutdown()
        if self._writer is not None:
            self._writer.abandon()

    def restart(self) -> None:
        """Begin anew."""
        if self._writer is not None:
            self._written()
            self._writer.abandon()
        self.quality = StreamQuality(self._channels)
        if self._path is not None:
            self._writer = StreamWriter(self._path, {channel.name: channel.unit for channel in self._channels})

    def add(self, time: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        """Take the next block."""
        if self._writer is not None:
            self._written()
            self._writing = self._background.submit(self._writer.add, time, columns)
        self.quality.add(time, columns)

    def close(self, about: Mapping[str, object]) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._written()
            self._writer.close(about)
        self._writer = None

    def _written(self) -> None:
        """Wait for the block that is being written."""
        if self._writing is not None:
            self._writing.result()
        self._writing = None
