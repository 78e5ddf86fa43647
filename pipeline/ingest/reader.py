"""What every reader of a log format gives: tables of raw channels, block by block.

Readers know formats, not rigs: they keep the names and units that they find, join nothing, scale
nothing. `pipeline.ingest.registry` picks the reader by the file's content.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from pipeline.recording import QualityFinding

# Rows of one block: 13 channels of float64 stay near 25 MB.
BLOCK_ROWS = 1 << 18


@dataclass(frozen=True)
class RawChannel:
    """A column or field as the log names it. `unit` is None where the log declares none."""

    name: str
    unit: str | None = None
    is_text: bool = False


class RawTable(ABC):
    """Channels with one row index: a CSV's body, an MCAP topic, the vectors of a MAT file.

    `name` is the topic or table, '' where a file has only one. `time_channel` names the channel
    that the format itself says is time (MCAP's log time); None where a name must tell.
    `block_stamp` tells, where a block of samples has one stamp only, which of its samples that is: ``first`` is assumed,
    and may be set to ``last`` before reading; None where every row has its own.
    `absolute_start` is set where times were absolute: ISO 8601 text of second zero of the time channel.
    """

    name: str
    channels: Sequence[RawChannel]
    time_channel: str | None = None
    absolute_start: str | None = None
    block_stamp: str | None = None

    @abstractmethod
    def blocks(self, names: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
        """Yield blocks of rows in file order: channel name -> values of equal length.

        Numbers are float64 (NaN where the log has none), text is an object array. Only `names` are
        decoded where given. May be called again. Raises InputError where the file cannot be read on.
        """

    def place_of(self, row: int) -> str:
        """Name the place in the file of a row (from 0) that the last reading gave: ``line 12``, else ``row 11``."""
        return f"row {row + 1}"

    def notes(self) -> Sequence[QualityFinding]:
        """Return what the reader noticed or mended in this table; complete after `blocks` ran out."""
        return ()


@dataclass(frozen=True)
class Entry:
    """One thing that a log says of itself, as text, and where: ``line 3``, ``the column 'fs'``."""

    key: str
    value: str
    place: str


@dataclass(frozen=True)
class RawLog:
    """An opened log: its tables, what it says of itself, and how the reader understood it.

    `metadata` are conditions that the log itself gives, as text (``{"static_load": "52 kN"}``); `entries` are all
    that it gives, with their places, also those that contradict each other, () where the reader keeps no places.
    `details` tell `rigfit check` how the file was understood (encoding, delimiter, compression).
    `notes` are findings of the whole file, without run.
    """

    path: Path
    format: str
    tables: Sequence[RawTable]
    metadata: Mapping[str, str] = field(default_factory=dict)
    details: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[QualityFinding] = ()
    entries: Sequence[Entry] = ()


class Reader(ABC):
    """One file format. Subclasses live one a file in this folder and export ``READER``.

    `version` goes into the provenance and into the hash that decides whether a log is read again:
    raise it whenever the same file would be read differently.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1
    suffixes: ClassVar[tuple[str, ...]]

    @property
    def named(self) -> str:
        """Name and version, as the provenance says them."""
        return f"{self.name} {self.version}"

    @abstractmethod
    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell from the first 64 KiB whether this is the format; `suffix` (lower case) only helps."""

    def beside(self, path: Path) -> Sequence[Path]:
        """Return the other files that a log at `path` is read with, where there are any: it changes when they do."""
        del path
        return ()

    @abstractmethod
    def open(self, path: Path) -> RawLog:
        """Read what is needed to list channels and metadata.

        Raises
        ------
        InputError
            If the file is empty, broken or not this format: what was found, at which byte or line,
            what to do.
        """
