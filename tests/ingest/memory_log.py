"""Logs that exist in memory only, for tests of what comes after the readers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.ingest.clock import align
from pipeline.ingest.mapping import ChannelMap, SelectedChannel, Source, resolve
from pipeline.ingest.quality import StreamQuality
from pipeline.ingest.reader import RawChannel, RawLog, RawTable
from pipeline.ingest.stream import StreamInSI
from pipeline.ingest.timebase import find_times
from pipeline.recording import QualityFinding


@dataclass(frozen=True)
class Spec:
    """A channel's declaration."""

    name: str
    unit: str
    description: str = "a quantity"
    required: bool = True
    limit: float | None = None
    counts_samples: bool = False
    lists_entries: bool = False
    no_value: float | None = None
    may_rest: bool = False


class MemoryTable(RawTable):
    """A table of arrays; `units` by channel, None where the log declares none."""

    def __init__(
        self,
        columns: Mapping[str, np.ndarray],
        units: Mapping[str, str] | None = None,
        name: str = "",
        time_channel: str | None = None,
        absolute_start: str | None = None,
        block_rows: int = 1 << 18,
    ) -> None:
        self.columns = {key: np.asarray(values) for key, values in columns.items()}
        self.name, self.time_channel, self.absolute_start = name, time_channel, absolute_start
        self.channels = [
            RawChannel(key, (units or {}).get(key), values.dtype.kind == "O") for key, values in self.columns.items()
        ]
        self.block_rows = block_rows
        self.readings = 0

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
        self.readings += 1
        names = list(self.columns if names is None else names)
        n = max((values.size for values in self.columns.values()), default=0)
        for start in range(0, n, self.block_rows):
            yield {key: self.columns[key][start : start + self.block_rows] for key in names}


def log_of(*tables: MemoryTable, metadata: Mapping[str, str] | None = None, path: str = "r1.csv") -> RawLog:
    return RawLog(Path(path), "memory", tables, metadata or {})


def sources_of(*tables: MemoryTable, metadata: Mapping[str, str] | None = None) -> list[Source]:
    log = log_of(*tables, metadata=metadata)
    return [Source(log, table, "r1.csv", table.name.strip("/")) for table in tables]


def judged(
    values: np.ndarray | Mapping[str, np.ndarray],
    rate: float = 1000.0,
    time: np.ndarray | None = None,
    block: int = 1 << 18,
    unit: str = "N",
    required: bool = False,
) -> StreamQuality:
    """Pass signals through the checks in blocks of `block` rows."""
    signals = values if isinstance(values, Mapping) else {"force": values}
    n = len(next(iter(signals.values())))
    time = np.arange(n) / rate if time is None else time
    quality = StreamQuality(
        [SelectedChannel(name, RawChannel(name, unit), unit, unit, required=required) for name in signals]
    )
    for start in range(0, n, block):
        part = slice(start, start + block)
        quality.add(time[part], {name: np.asarray(signal, float)[part] for name, signal in signals.items()})
    quality.finish()
    return quality


def found(
    values: np.ndarray | Mapping[str, np.ndarray],
    rate: float = 1000.0,
    time: np.ndarray | None = None,
    block: int = 1 << 18,
    required: bool = False,
) -> list[QualityFinding]:
    return judged(values, rate, time, block, required=required).findings()


class Collected:
    """A sink that keeps what it is given."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        self._times: list[np.ndarray] = []
        self._blocks: list[Mapping[str, np.ndarray]] = []

    def add(self, time: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        self._times.append(time)
        self._blocks.append(columns)

    @property
    def time(self) -> np.ndarray:
        return np.concatenate(self._times)

    def values(self, name: str) -> np.ndarray:
        return np.concatenate([block[name] for block in self._blocks])


def streamed(
    *tables: MemoryTable,
    specs: Sequence[Spec],
    time: ChannelMap | None = None,
    metadata: Mapping[str, str] | None = None,
) -> tuple[list[StreamInSI], list[Collected]]:
    """Take tables of one run to SI, as ingest does."""
    selections = resolve(sources_of(*tables, metadata=metadata), specs, {})
    times = find_times([selection.source for selection in selections], time)
    streams = [StreamInSI(selection, source) for selection, source in zip(selections, times, strict=True)]
    align([stream.clock for stream in streams])
    sinks = [Collected() for _ in streams]
    for stream, sink in zip(streams, sinks, strict=True):
        stream.pass_to(sink)
    return streams, sinks
