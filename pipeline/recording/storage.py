"""Recordings on disk: one Parquet file a stream, its metadata in the schema.

``<run>.parquet`` holds the only stream of a run, ``<run>.<stream>.parquet`` one of several. Columns are
``time`` (s) and the channels in SI, each field with its unit; the schema's metadata key ``rigfit``
holds the rest as JSON. Pandas, Polars and DuckDB read these files as plain tables.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.errors import InputError
from pipeline.recording.recording import Channel, Provenance, QualityFinding, Recording, SourceFile, Stream

KEY = b"rigfit"


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


def description(recording: Recording, stream: str) -> dict[str, Any]:
    """Return what the metadata of one stream's file says: run, conditions, quality, provenance."""
    return {
        "run": recording.run,
        "stream": stream,
        "conditions": dict(recording.conditions),
        "quality": [asdict(finding) for finding in recording.quality],
        "provenance": asdict(recording.provenance),
    }


def schema(stream: Stream) -> pa.Schema:
    """Return the Arrow schema of a stream: time first, units in the fields' metadata."""
    fields = [pa.field("time", pa.float64(), nullable=False, metadata={"unit": "s"})]
    for channel in stream.channels.values():
        kind = pa.string() if channel.is_text else pa.float64()
        fields.append(pa.field(channel.name, kind, metadata={"unit": channel.unit}))
    return pa.schema(fields)


def file_names(recording: Recording) -> dict[str, str]:
    """Return the file name of each stream."""
    if len(recording.streams) == 1:
        return {next(iter(recording.streams)): f"{recording.run}.parquet"}
    return {name: f"{recording.run}.{name}.parquet" for name in recording.streams}


def write(recording: Recording, folder: Path) -> list[Path]:
    """Write a recording into `folder`; each file appears whole or not at all."""
    written = []
    for name, file_name in file_names(recording).items():
        stream = recording.streams[name]
        metadata = {KEY: json.dumps(description(recording, name)).encode()}
        arrays = [pa.array(stream.time)] + [pa.array(channel.values) for channel in stream.channels.values()]
        table = pa.Table.from_arrays(arrays, schema=schema(stream).with_metadata(metadata))
        with whole_or_not(folder / file_name) as partial:
            pq.write_table(table, partial, compression="zstd", compression_level=1, use_dictionary=False)
        written.append(folder / file_name)
    return written


def read(paths: Path | Iterable[Path]) -> Recording:
    """Read the recording that `paths` (one file a stream) hold.

    Raises
    ------
    InputError
        If a file is no Parquet file or was not written by rigfit.
    """
    paths = [paths] if isinstance(paths, Path) else list(paths)
    streams: dict[str, Stream] = {}
    about: dict[str, Any] = {}
    for path in paths:
        try:
            table = pq.read_table(path, partitioning=None)
            about = json.loads((table.schema.metadata or {})[KEY])
        except (pa.ArrowException, OSError, KeyError, json.JSONDecodeError) as error:
            raise InputError(f"{path} is not a recording written by rigfit; run 'rigfit ingest' again.") from error
        channels = {}
        for entry in table.schema:
            if entry.name != "time":
                unit = (entry.metadata or {}).get(b"unit", b"1").decode()
                channels[entry.name] = Channel(entry.name, table[entry.name].to_numpy(), unit)
        name = str(about["stream"])
        streams[name] = Stream(name, table["time"].to_numpy(), channels)
    quality = tuple(
        QualityFinding(**{**entry, "span": tuple(entry["span"]) if entry["span"] else None})
        for entry in about["quality"]
    )
    told = about["provenance"]
    files = tuple(SourceFile(**entry) for entry in told["files"])
    provenance = Provenance(files, tuple(told["repairs"]), told["condition_sources"], told["version"])
    return Recording(about["run"], streams, about["conditions"], quality, provenance)


def read_folder(folder: Path) -> list[Recording]:
    """Read every recording of a folder, ordered by run."""
    by_run: dict[str, list[Path]] = {}
    for path in sorted(folder.glob("*.parquet")):
        try:
            metadata = pq.read_schema(path).metadata or {}
        except (pa.ArrowException, OSError) as error:
            raise InputError(f"{path} is not a recording written by rigfit; run 'rigfit ingest' again.") from error
        run = json.loads(metadata.get(KEY, b"{}")).get("run", path.stem)
        by_run.setdefault(run, []).append(path)
    return [read(by_run[run]) for run in sorted(by_run)]
