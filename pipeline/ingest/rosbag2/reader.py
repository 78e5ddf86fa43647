"""The reader of ROS 2 bags in SQLite (``.db3``): each topic is a table, its time is when the recorder got the message.

The rows are read here, their messages as those of MCAP are. The ``metadata.yaml`` beside a bag is not needed.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from pipeline.errors import InputError, listing
from pipeline.ingest.mcap_log.layout import Layout
from pipeline.ingest.mcap_log.reader import log_of
from pipeline.ingest.mcap_log.records import Channel, Schema, printable
from pipeline.ingest.misnamed import misnamed
from pipeline.ingest.reader import RawLog, Reader
from pipeline.ingest.rosbag2.definitions import Definitions, definitions_beside
from pipeline.ingest.rosbag2.rows import RowMessages, broken, connected, has_waiting, survey_rows
from pipeline.recording import QualityFinding

_MAGIC = b"SQLite format 3\0"
_TABLES = {"messages", "topics"}
_COMPUTED = re.compile(r"\b(generated|as)\s*(always\b|\()", re.IGNORECASE)
_SPLIT = re.compile(r"^(.*)_\d+$")


class Rosbag2Reader(Reader):
    """Reads SQLite files with the tables of rosbag2, of any version of their layout."""

    name = "rosbag2"
    version = 1
    suffixes = (".db3",)

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by SQLite's mark; a file named .db3 is taken too, to say what is wrong with it."""
        return head.startswith(_MAGIC) or suffix in self.suffixes

    def beside(self, path: Path) -> Sequence[Path]:
        """Return the rows of a killed recorder and the definitions of messages beside a bag."""
        waiting = path.with_name(f"{path.name}-wal")
        return [*([waiting] if waiting.is_file() else []), *definitions_beside(path)]

    def open(self, path: Path) -> RawLog:
        """List topics and their types, and look at messages of each.

        Raises
        ------
        InputError
            If it is no SQLite, or another program's, is broken, holds no message or none that can be read, or takes
            definitions of messages from a library that is not installed.
        """
        with path.open("rb") as file:
            head = file.read(len(_MAGIC))
            size = file.seek(0, 2)
        if head != _MAGIC:
            raise misnamed(path, "SQLite file of a ROS 2 bag")
        layout = Layout(path, size, profile="ros2")
        about: dict[str, str] = {}
        try:
            with closing(connected(path)) as base:
                _refuse_foreign(path, base)
                _list_topics(layout, base, about)
                lost = survey_rows(layout, base)
        except sqlite3.Error as error:
            raise broken(path, error) from error
        log = log_of(RowMessages(layout), "ROS 2 bag", about)
        return replace(log, notes=(*_notes(path, lost), *log.notes))


def _refuse_foreign(path: Path, base: sqlite3.Connection) -> None:
    made = "SELECT name, sql FROM sqlite_master WHERE type = 'table' AND rootpage > 0"
    # A column that is computed is as long as its author likes.
    tables = {str(name) for name, sql in base.execute(made) if not _COMPUTED.search(str(sql))}
    if not tables >= _TABLES:
        raise InputError(
            f"{path}: is an SQLite file, but of another program than ROS 2's recorder: it has the tables "
            f"{listing(sorted(map(printable, tables)), 8)} where {listing(sorted(_TABLES))} were expected. Export the table "
            "with the measurements as CSV."
        )


def _list_topics(layout: Layout, base: sqlite3.Connection, about: dict[str, str]) -> None:
    """Take in the topics as channels, each with the definition of its type."""
    path = layout.path
    if distribution := _distribution(base):
        about["recorded by"] = f"ROS 2 {distribution}"
    definitions = Definitions(path, dict(_embedded(base)))
    listed = "SELECT id, name, type, serialization_format FROM topics WHERE typeof(id) = 'integer'"
    for topic_id, topic, kind, encoding in base.execute(listed):
        topic, kind = printable(str(topic)), printable(str(kind))
        schema, problem = None, None
        if str(encoding) == "cdr":
            found = definitions.of(kind)
            if isinstance(found, str):
                problem = found
            else:
                schema = layout.schemas[topic_id] = Schema(topic_id, kind, *found)
        layout.channels[topic_id] = Channel(topic_id, schema.id if schema else 0, topic, str(encoding), {}, problem)
    if definitions.sources:
        about["message definitions"] = listing(sorted(definitions.sources))


def _distribution(base: sqlite3.Connection) -> str:
    try:
        found = base.execute("SELECT ros_distro FROM schema").fetchone()
    except sqlite3.OperationalError:  # recorded before there was such a table
        return ""
    return printable(str(found[0])) if found else ""


def _embedded(base: sqlite3.Connection) -> Iterator[tuple[str, tuple[str, bytes]]]:
    """Yield the types that the bag itself defines, each with the definition's language and text."""
    try:
        rows = base.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        ).fetchall()
    except sqlite3.OperationalError:  # recorded before there was such a table
        return
    for kind, encoding, text in rows:
        if encoding in ("ros2msg", "ros2idl") and text:
            yield str(kind), (str(encoding), text if isinstance(text, bytes) else str(text).encode())


def _notes(path: Path, lost: Sequence[tuple[int, int]]) -> Iterator[QualityFinding]:
    if lost:
        rows = listing(
            (f"from row {start} on" if start == stop else f"rows {start} to {stop - 1}" for start, stop in lost), 5
        )
        yield QualityFinding(
            "warning", f"the file is damaged or was cut off: of its messages {rows} cannot be read; the others are."
        )
    if waiting := has_waiting(path):
        yield QualityFinding(
            "note",
            f"{path.name}: the recorder was not closed; {waiting} bytes of it stand in the {path.name}-wal beside it and are "
            "read with it.",
        )
    split = _SPLIT.match(path.stem)
    parts = sorted(
        other.name
        for other in path.parent.glob("*.db3")
        if (m := _SPLIT.match(other.stem)) and split and m[1] == split[1]
    )
    if len(parts) > 1:
        yield QualityFinding(
            "note",
            f"{path.name}: is one of {len(parts)} files beside each other that look like one split recording "
            f"({listing(parts, 4)}); each is read as a run of its own. To join them: 'ros2 bag convert'.",
        )


READER = Rosbag2Reader()
