"""Writes a recording as an MCAP log with JSON messages, as a test rig's recorder would.

Units stand in the JSON Schema, conditions in a metadata record. For synthetic campaigns and tests;
the export of findings is elsewhere.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import orjson

from pipeline.recording import Condition, Recording, Stream
from pipeline.recording.storage import whole_or_not

Compression = Literal["zstd", "lz4", "none"]

# Steps that differ by less than this part of the mean step count as one rate.
_UNIFORM = 1e-6


def write(
    recording: Recording,
    path: Path,
    *,
    compression: Compression = "zstd",
    samples_per_message: int = 1,
    start: int = 0,
) -> None:
    """Write `recording` to `path`, which appears whole or not at all.

    Parameters
    ----------
    recording
        A topic a stream; the channels' SI units go into the schema, the conditions (SI) into a
        metadata record ``conditions``.
    compression
        Of the chunks.
    samples_per_message
        1: scalars. More: arrays of so many samples, with an array ``time`` (s) where the samples are
        not evenly spaced.
    start
        Log time of second zero, ns; since 1970 for logs with a date.
    """
    from mcap.writer import CompressionType, Writer

    kinds = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
    with whole_or_not(path) as partial, partial.open("wb") as file:
        writer = Writer(file, compression=kinds[compression])
        writer.start(profile="", library="rigfit")
        conditions = {name: _text(value) for name, value in recording.conditions.items()}
        if conditions:
            writer.add_metadata("conditions", conditions)
        feeds = []
        for stream in recording.streams.values():
            in_blocks = samples_per_message > 1
            with_times = in_blocks and (stream.time.size <= samples_per_message or not _is_uniform(stream.time))
            schema = orjson.dumps(_schema(stream, in_blocks, with_times))
            schema_id = writer.register_schema(stream.name or "samples", "jsonschema", schema)
            channel_id = writer.register_channel(f"/{stream.name or 'samples'}", "json", schema_id)
            messages = _blocks(stream, samples_per_message, with_times) if in_blocks else _scalars(stream)
            feeds.append(_stamped(messages, channel_id, start))
        for sequence, (stamp, channel_id, payload) in enumerate(heapq.merge(*feeds)):
            writer.add_message(channel_id, stamp, payload, stamp, sequence)
        writer.finish()  # type: ignore[no-untyped-call]


def _text(value: Condition) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _is_uniform(time: np.ndarray) -> bool:
    steps = np.diff(time)
    return bool(steps.size < 2 or np.ptp(steps) < _UNIFORM * steps.mean())


def _schema(stream: Stream, in_blocks: bool, with_times: bool) -> dict[str, Any]:
    properties: dict[str, dict[str, Any]] = {}
    if with_times:
        properties["time"] = {"type": "number", "unit": "s"}
    for channel in stream.channels.values():
        properties[channel.name] = {"type": "string"} if channel.is_text else {"type": "number", "unit": channel.unit}
    if in_blocks:
        properties = {name: {"type": "array", "items": items} for name, items in properties.items()}
    return {"type": "object", "properties": properties}


def _scalars(stream: Stream) -> Iterator[tuple[float, bytes]]:
    names = list(stream.channels)
    columns = [channel.values.tolist() for channel in stream.channels.values()]
    for time, *row in zip(stream.time.tolist(), *columns, strict=True):
        yield time, orjson.dumps(dict(zip(names, row, strict=True)))


def _blocks(stream: Stream, length: int, with_times: bool) -> Iterator[tuple[float, bytes]]:
    for first in range(0, stream.time.size, length):
        cut = slice(first, first + length)
        message = {"time": stream.time[cut].tolist()} if with_times else {}
        message |= {name: channel.values[cut].tolist() for name, channel in stream.channels.items()}
        yield float(stream.time[first]), orjson.dumps(message)


def _stamped(messages: Iterator[tuple[float, bytes]], channel: int, start: int) -> Iterator[tuple[int, int, bytes]]:
    return ((start + round(time * 1e9), channel, payload) for time, payload in messages)
