"""The topics of a log: which channels belong together, how their messages are decoded, what is in them.

A topic whose messages cannot be decoded is left out and told; the rest of the log is read.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import listing
from pipeline.ingest.mcap_log.batches import Messages
from pipeline.ingest.mcap_log.columns import Columns, Path, TooManyFieldsError
from pipeline.ingest.mcap_log.declared import Declared, from_json_schema
from pipeline.ingest.mcap_log.encodings import json_messages, ros_types
from pipeline.ingest.mcap_log.encodings.idl import parse_idl
from pipeline.ingest.mcap_log.encodings.protobuf_messages import ProtobufDecoder
from pipeline.ingest.mcap_log.encodings.ros_messages import RosDecoder
from pipeline.ingest.mcap_log.encodings.ros_types import DefinitionError, Struct
from pipeline.ingest.mcap_log.records import Channel, Schema

SUPPORTED = "json, cdr (ros2msg, ros2idl, omgidl), ros1 (ros1msg), protobuf"
# Of a larger file than this, only samples of its messages are looked at before reading.
_SURVEYED_WHOLE = 8 << 20
_SURVEYED_PORTIONS = 12
_SURVEYED_FIRST, _SURVEYED_LAST = 200, 20

Decode = Callable[[Sequence[bytes], Collection[Path] | None], tuple[Columns, np.ndarray | None]]


@dataclass
class Topic:
    """Channels of one topic that share encoding and schema.

    After the survey: `samples` (messages, columns) by batch, `stamps` (log and publish times, ns) of
    the surveyed messages, `malformed` of them, `problem` why the topic cannot be read at all.
    """

    name: str
    ids: list[int]
    encoding: str
    schema: Schema | None
    declared: Declared = field(default_factory=Declared)
    decode: Decode | None = None
    raw: Collection[Path] = ()
    problem: str | None = None
    samples: list[tuple[int, Columns]] = field(default_factory=list)
    stamps: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    malformed: int = 0

    @property
    def found(self) -> int:
        """Messages that the survey looked at."""
        return sum(log.size for log, _ in self.stamps)

    def forget(self) -> None:
        """Drop the surveyed messages, once they are no longer needed."""
        self.samples, self.stamps = [], []


def survey(messages: Messages) -> list[Topic]:
    """Look at messages of every topic: all of a small file, else some from throughout the file."""
    topics: dict[int, Topic] = {}
    whole = messages.size <= _SURVEYED_WHOLE
    every = range(len(messages.portions))
    chosen = set(every) if whole else _spread(len(every))
    for portion in sorted(every, key=lambda i: (i not in chosen, i)):
        if portion not in chosen and not _may_tell_more(messages, portion, topics):
            continue
        batch = messages.batch(portion)
        _register(messages, topics)
        for topic in _different(topics.values()):
            at = batch.of(topic.ids)
            if not at.size or (topic.found and portion not in chosen):
                continue
            if not whole and at.size > _SURVEYED_FIRST + _SURVEYED_LAST:
                at = np.concatenate((at[:_SURVEYED_FIRST], at[-_SURVEYED_LAST:]))
            _look_at(topic, batch.payloads(at), batch.log_times[at], batch.publish_times[at])
    return _different(topics.values())


def _spread(count: int) -> set[int]:
    return set(np.linspace(0, count - 1, min(count, _SURVEYED_PORTIONS)).astype(int).tolist())


def _may_tell_more(messages: Messages, portion: int, topics: dict[int, Topic]) -> bool:
    """Tell whether a portion may hold a topic that no message was seen of."""
    seen = {channel for channel, topic in topics.items() if topic.found}
    layout = messages.layout
    for segment in messages.portions[portion]:
        if segment.counts is not None:
            if not seen.issuperset(segment.counts):
                return True
        elif layout.message_counts is not None and layout.lists_channels:
            if any(count and channel not in seen for channel, count in layout.message_counts.items()):
                return True
        else:
            return True
    return False


def _different(topics: Iterable[Topic]) -> list[Topic]:
    return list({id(topic): topic for topic in topics}.values())


def _register(messages: Messages, topics: dict[int, Topic]) -> None:
    """Take in the channels that are known by now."""
    layout = messages.layout
    for channel in layout.channels.values():
        if channel.id in topics:
            continue
        schema = layout.schemas.get(channel.schema_id)
        alike = next((t for t in topics.values() if _is_alike(t, channel, schema)), None)
        if alike is not None:
            alike.ids.append(channel.id)
            alike.declared.metadata = {**channel.metadata, **alike.declared.metadata}
        else:
            name = channel.topic.removeprefix("/")
            if any(topic.name == name for topic in topics.values()):
                name = f"{name}~{channel.id}"
            alike = Topic(name, [channel.id], channel.encoding.lower(), schema)
            _prepare(alike, channel)
        topics[channel.id] = alike


def _is_alike(topic: Topic, channel: Channel, schema: Schema | None) -> bool:
    same_schema = topic.schema is schema or (
        topic.schema is not None and schema is not None and topic.schema.data == schema.data
    )
    same_name = topic.name in (channel.topic.removeprefix("/"), f"{channel.topic.removeprefix('/')}~{topic.ids[0]}")
    return same_name and topic.encoding == channel.encoding.lower() and same_schema


def _prepare(topic: Topic, channel: Channel) -> None:
    """Choose the decoder; where there is none, say so in `problem`."""
    topic.declared = Declared(metadata=channel.metadata)
    topic.problem = channel.problem
    if topic.problem is not None:
        return
    schema = topic.schema
    kind = schema.encoding.lower() if schema else ""
    try:
        if topic.encoding == "json":
            topic.decode = json_messages.decode
            if schema is not None and kind == "jsonschema":
                topic.declared = from_json_schema(schema.data, channel.metadata)
        elif schema is None and topic.encoding in ("cdr", "ros1", "protobuf"):
            topic.problem = f"its schema is missing, without which {topic.encoding} messages cannot be read"
        elif schema is not None and (topic.encoding, kind) in (("cdr", "ros2msg"), ("ros1", "ros1msg")):
            text = schema.data.decode("utf-8", "replace")
            _prepare_ros(topic, ros_types.parse_msg(schema.name, text, ros=2 if topic.encoding == "cdr" else 1))
        elif schema is not None and (topic.encoding, kind) in (("cdr", "ros2idl"), ("cdr", "omgidl")):
            _prepare_ros(topic, parse_idl(schema.name, schema.data.decode("utf-8", "replace")))
        elif schema is not None and (topic.encoding, kind) == ("protobuf", "protobuf"):
            decoder = ProtobufDecoder(schema)
            topic.decode, topic.raw = decoder.decode, decoder.raw
        else:
            with_schema = f" with the schema encoding '{schema.encoding}'" if schema else ""
            topic.problem = f"its message encoding '{channel.encoding}'{with_schema} is not supported"
    except ModuleNotFoundError:
        topic.problem = "reading Protobuf needs a package more; install it with 'pip install mcap-protobuf-support'"
    except RecursionError:
        topic.problem = "its schema holds types within types without end"
    except DefinitionError as error:
        topic.problem = f"its schema '{schema.name if schema else ''}' cannot be understood: {error}"


def _prepare_ros(topic: Topic, root: Struct) -> None:
    decoder = RosDecoder(root, cdr=topic.encoding == "cdr")
    topic.decode, topic.raw = decoder.decode, decoder.raw
    topic.declared.lengths = ros_types.fixed_lengths(root)
    topic.declared.units = ros_types.declared_units(root)


def _look_at(topic: Topic, payloads: list[bytes], log_times: np.ndarray, publish_times: np.ndarray) -> None:
    topic.stamps.append((log_times, publish_times))
    if topic.decode is None or topic.problem is not None:
        return
    try:
        columns, good = topic.decode(payloads, None)
    except (TooManyFieldsError, RecursionError):
        topic.problem = "its messages have thousands of different fields, or fields within fields without end"
        return
    read = len(payloads) if good is None else int(np.count_nonzero(good))
    topic.malformed += len(payloads) - read
    if read:
        topic.samples.append((read, columns))


def raw_fields(topic: Topic) -> str:
    """Return the names of the fields that hold raw bytes, for a message; empty where there are none."""
    return listing(sorted(".".join(path) for path in topic.raw)) if topic.raw else ""
