"""Recordings on disk: one Parquet file a stream, its metadata in the schema.

``<run>.parquet`` holds the only stream of a run, ``<run>.<stream>.parquet`` one of several. Columns are
``time`` (s) and the channels in SI, each field with its unit; the schema's metadata key ``rigfit``
holds the rest as JSON. Pandas, Polars and DuckDB read these files as plain tables.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.errors import InputError
from pipeline.recording.recording import Channel, Provenance, QualityFinding, Recording, SourceFile, Stream

KEY = b"rigfit"
# Rows of one row group: what is held in memory at once when a file is written or read block by block.
ROW_GROUP = 1 << 18


@contextmanager
def whole_or_not(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path`; move it there when the block ends well, else remove it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, as hexadecimal text."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def description(recording: Recording, stream: str) -> dict[str, Any]:
    """Return what the metadata of one stream's file says: run, conditions, quality, provenance."""
    return {
        "run": recording.run,
        "stream": stream,
        "conditions": dict(recording.conditions),
        "quality": [asdict(finding) for finding in recording.quality],
        "provenance": asdict(recording.provenance),
    }


def file_names(run: str, streams: Sequence[str]) -> dict[str, str]:
    """Return the file name of each stream of a run."""
    if len(streams) == 1:
        return {streams[0]: f"{run}.parquet"}
    return {name: f"{run}.{name}.parquet" for name in streams}


class StreamWriter:
    """Writes one stream block by block; what the metadata says is told when it is closed.

    Parameters
    ----------
    path
        The file to write, see `whole_or_not`.
    units
        Unit of each channel in the order of the columns; ``""`` for text.
    """

    def __init__(self, path: Path, units: Mapping[str, str]) -> None:
        fields = [pa.field("time", pa.float64(), nullable=False, metadata={"unit": "s"})]
        for name, unit in units.items():
            fields.append(pa.field(name, pa.float64() if unit else pa.string(), metadata={"unit": unit}))
        self._schema = pa.schema(fields)
        # Measured on rig data: split bytes and snappy cost half of zstd and read back three times as fast.
        self._writer = pq.ParquetWriter(
            path,
            self._schema,
            compression="snappy",
            use_dictionary=[name for name, unit in units.items() if not unit],
            use_byte_stream_split=["time", *(name for name, unit in units.items() if unit)],
            write_statistics=["time"],
            store_schema=False,
        )

    def add(self, time: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        """Write one block: `time` (s) and every channel, each of shape (n,)."""
        values = [time, *(columns[name] for name in self._schema.names[1:])]
        arrays = [pa.array(v, type=f.type) for v, f in zip(values, self._schema, strict=True)]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema), row_group_size=ROW_GROUP)

    def close(self, about: Mapping[str, Any]) -> None:
        """Finish the file; `about` is what `description` returns.

        Arrow reads the schema, units and all, from a copy of its own in the file's metadata. That copy
        is written here and not at the start, because only now is it known what to say.
        """
        metadata = {KEY.decode(): json.dumps(about, ensure_ascii=False)}
        schema = self._schema.with_metadata(metadata).serialize().to_pybytes()
        self._writer.add_key_value_metadata({**metadata, "ARROW:schema": base64.b64encode(schema).decode()})
        self._writer.close()

    def abandon(self) -> None:
        """Close a file that will not be used."""
        self._writer.close()


def write(recording: Recording, folder: Path) -> list[Path]:
    """Write a recording into `folder`; each file appears whole or not at all."""
    written = []
    for name, file_name in file_names(recording.run, list(recording.streams)).items():
        stream = recording.streams[name]
        units = {c.name: "" if c.is_text else c.unit or "1" for c in stream.channels.values()}
        with whole_or_not(folder / file_name) as partial:
            writer = StreamWriter(partial, units)
            writer.add(stream.time, {c.name: c.values for c in stream.channels.values()})
            writer.close(description(recording, name))
        written.append(folder / file_name)
    return written


class _ChannelsOnDisk(Mapping[str, Channel]):
    """The channels of a file, each read when it is first asked for."""

    def __init__(self, path: Path, units: Mapping[str, str]) -> None:
        self._path, self._units = path, units
        self._read: dict[str, Channel] = {}

    def __getitem__(self, name: str) -> Channel:
        if name not in self._read:
            unit = self._units[name]
            self._read[name] = Channel(name, _columns(self._path, [name])[name].to_numpy(), unit)
        return self._read[name]

    def __contains__(self, name: object) -> bool:
        return name in self._units

    def __iter__(self) -> Iterator[str]:
        return iter(self._units)

    def __len__(self) -> int:
        return len(self._units)


class _StreamOnDisk(Stream):
    """A stream whose time and channels stay on disk until they are asked for."""

    def __init__(self, path: Path, name: str, units: Mapping[str, str]) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "channels", _ChannelsOnDisk(path, units))
        object.__setattr__(self, "_path", path)

    _path: Path

    def __getattr__(self, name: str) -> np.ndarray:
        # Only what is not there yet comes here: the time base, once.
        if name != "time":
            raise AttributeError(name)
        object.__setattr__(self, "time", _columns(self._path, ["time"])["time"].to_numpy())
        return self.time

    @property
    def size(self) -> int:
        return int(pq.read_metadata(self._path).num_rows)

    @property
    def span(self) -> tuple[float, float]:
        about = pq.read_metadata(self._path)
        groups = [about.row_group(i).column(0) for i in range(about.num_row_groups) if about.row_group(i).num_rows]
        if not groups or not all(group.is_stats_set and group.statistics.has_min_max for group in groups):
            return super().span
        return float(groups[0].statistics.min) + 0.0, float(groups[-1].statistics.max)  # a zero is kept as -0

    @property
    def duration(self) -> float:
        first, last = self.span
        return last - first if first == first else 0.0

    def blocks(self, names: Sequence[str]) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
        for block in read_blocks(self._path, list(names)):
            yield block["time"], [block[name] for name in names]


def read(paths: Path | Iterable[Path], *, lazily: bool = False) -> Recording:
    """Read the recording that `paths` (one file a stream) hold.

    Parameters
    ----------
    lazily
        Read a channel's samples when they are first used, and not at all otherwise; `Stream.blocks`
        then never holds more than one row group. The files must stay where they are for so long.

    Raises
    ------
    InputError
        If a file is no Parquet file or was not written by rigfit.
    """
    paths = [paths] if isinstance(paths, Path) else list(paths)
    streams: dict[str, Stream] = {}
    about: dict[str, Any] = {}
    for path in paths:
        schema, about = _opened(path)
        units = {entry.name: (entry.metadata or {}).get(b"unit", b"1").decode() for entry in schema}
        del units["time"]
        name = str(about.get("stream", ""))
        if lazily:
            streams[name] = _StreamOnDisk(path, name, units)
        else:
            table = _columns(path, None)
            channels = {channel: Channel(channel, table[channel].to_numpy(), unit) for channel, unit in units.items()}
            streams[name] = Stream(name, table["time"].to_numpy(), channels)
    try:
        told = about["provenance"]
        files = tuple(SourceFile(**entry) for entry in told["files"])
        provenance = Provenance(
            files, tuple(told["repairs"]), told["condition_sources"], told["version"], told["begins"]
        )
        return Recording(about["run"], streams, about["conditions"], _quality(about), provenance)
    except (KeyError, TypeError, AttributeError) as error:
        raise _foreign(paths[-1]) from error


def read_blocks(path: Path, channels: Sequence[str] | None = None) -> Iterator[dict[str, np.ndarray]]:
    """Yield one stream's file block by block: ``time`` and `channels` (all without) -> samples, in order.

    Raises
    ------
    InputError
        If the file is no Parquet file or was not written by rigfit.
    """
    _opened(path)
    names = None if channels is None else ["time", *channels]
    with pq.ParquetFile(path) as file:
        for group in range(file.num_row_groups):
            table = file.read_row_group(group, columns=names)
            yield {name: table[name].to_numpy() for name in table.column_names}


def add_quality(paths: Sequence[Path], findings: Sequence[QualityFinding]) -> None:
    """Add findings to the recording that `paths` (one file a stream) hold, block by block.

    Each file appears anew as a whole.
    """
    for path in paths:
        schema, about = _opened(path)
        about["quality"] = [*about["quality"], *(asdict(finding) for finding in findings)]
        units = {entry.name: entry.metadata[b"unit"].decode() for entry in schema if entry.name != "time"}
        with whole_or_not(path) as partial:
            writer = StreamWriter(partial, units)
            for block in read_blocks(path):
                writer.add(block["time"], block)
            writer.close(about)


def read_folder(folder: Path) -> list[Recording]:
    """Read every recording of a folder, ordered by run."""
    by_run: dict[str, list[Path]] = {}
    for path in sorted(folder.glob("*.parquet")):
        by_run.setdefault(run_of(path), []).append(path)
    return [read(by_run[run]) for run in sorted(by_run)]


def run_of(path: Path) -> str:
    """Return the run that a recording's file belongs to.

    Raises
    ------
    InputError
        If the file is no Parquet file or was not written by rigfit.
    """
    return str(_opened(path)[1]["run"])


def _opened(path: Path) -> tuple[pa.Schema, dict[str, Any]]:
    """Return the schema and what the metadata says."""
    try:
        schema = pq.read_schema(path)
        about = json.loads((schema.metadata or {})[KEY])
        if not isinstance(about, dict) or not isinstance(about["run"], str) or "time" not in schema.names:
            raise ValueError
        return schema, about
    except (pa.ArrowException, OSError, KeyError, ValueError, RecursionError) as error:
        raise _foreign(path) from error


def _foreign(path: Path) -> InputError:
    return InputError(f"{path} is not a recording written by rigfit; run 'rigfit ingest' again.")


def _columns(path: Path, names: list[str] | None) -> pa.Table:
    try:
        return pq.read_table(path, columns=names, partitioning=None)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path}: its samples cannot be read ({error}); run 'rigfit ingest' again.") from error


def _quality(about: Mapping[str, Any]) -> tuple[QualityFinding, ...]:
    return tuple(
        QualityFinding(**{**entry, "span": tuple(entry["span"]) if entry["span"] else None})
        for entry in about["quality"]
    )
