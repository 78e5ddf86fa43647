"""Builds MCAP logs for the tests with the official writer, and reads tables back whole."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer

from pipeline.ingest.mcap_log import READER
from pipeline.ingest.reader import RawLog, RawTable

EPOCH = 1_700_000_000_000_000_000
COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}


def write_json(
    path: Path,
    topics: dict[str, Sequence[tuple[int, Any]]],
    *,
    schemas: dict[str, Any] | None = None,
    channel_metadata: dict[str, dict[str, str]] | None = None,
    records: dict[str, dict[str, str]] | None = None,
    compression: str = "zstd",
    attachment: bytes | None = None,
    **options: Any,
) -> Path:
    """Write messages (stamp in ns, object or raw bytes) by topic, interleaved by stamp."""
    with path.open("wb") as file:
        writer = Writer(file, compression=COMPRESSIONS[compression], **options)
        writer.start()
        for name, pairs in (records or {}).items():
            writer.add_metadata(name, pairs)
        if attachment is not None:
            writer.add_attachment(0, 0, "photo.jpg", "image/jpeg", attachment)
        feed = []
        for topic, messages in topics.items():
            schema = (schemas or {}).get(topic)
            schema_id = writer.register_schema("s", "jsonschema", json.dumps(schema).encode()) if schema else 0
            channel = writer.register_channel(topic, "json", schema_id, (channel_metadata or {}).get(topic, {}))
            feed += [(stamp, i, channel, message) for i, (stamp, message) in enumerate(messages)]
        if len(topics) > 1:
            feed.sort(key=lambda entry: entry[0])
        for stamp, _, channel, message in feed:
            payload = message if isinstance(message, bytes) else json.dumps(message).encode()
            writer.add_message(channel, stamp, payload, stamp)
        writer.finish()
    return path


def bare(**options: Any) -> dict[str, Any]:
    """Options of a writer that leaves summary and indexes out."""
    return {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
        **options,
    }


def stamped(objects: Iterable[Any], step: int = 1_000_000, start: int = EPOCH) -> list[tuple[int, Any]]:
    return [(start + i * step, message) for i, message in enumerate(objects)]


def open_log(path: Path) -> RawLog:
    return READER.open(path)


def table(log: RawLog, name: str | None = None) -> RawTable:
    found = [t for t in log.tables if name is None or t.name == name]
    assert len(found) == 1, [t.name for t in log.tables]
    return found[0]


def rows(of: RawTable, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Return all rows of a table."""
    blocks = list(of.blocks(names))
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]} if blocks else {}


def messages_of(notes: Iterable[Any]) -> str:
    return " | ".join(f"{note.level}: {note.message}" for note in notes)
