"""The reader of MCAP logs: JSON, ROS 1, ROS 2 and Protobuf messages, whole or damaged files.

Each topic is a table. Its time is the log time, in seconds from the first message of the log.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from pipeline.errors import InputError, counted, listing
from pipeline.ingest.mcap_log import records
from pipeline.ingest.mcap_log.batches import Messages
from pipeline.ingest.mcap_log.declared import is_unit_key
from pipeline.ingest.mcap_log.fields import Plan, plan
from pipeline.ingest.mcap_log.layout import Damage, Layout, survey_layout
from pipeline.ingest.mcap_log.noticed import loss_notes
from pipeline.ingest.mcap_log.table import TopicTable
from pipeline.ingest.mcap_log.topics import SUPPORTED, Topic, raw_fields, survey
from pipeline.ingest.reader import RawLog, Reader
from pipeline.recording import QualityFinding

# Log times beyond this (ns; spring of 1973) count from 1970; smaller ones from the start of some machine.
_EPOCH = 10**17
# Metadata that recorders write about themselves; no conditions of a run.
_RECORDERS_OWN = {
    "offered_qos_profiles", "topic_type_hash", "callerid", "latching", "md5sum", "message_definition", "type", "topic",
}  # fmt: skip
_RECORDERS_RECORDS = {"rosbag2"}


class McapReader(Reader):
    """Reads MCAP files of format version 0."""

    name = "mcap"
    version = 3
    suffixes = (".mcap",)

    def recognises(self, head: bytes, suffix: str) -> bool:
        """Tell by the magic at the front; a file named .mcap is taken too, to say what is wrong with it."""
        return head.startswith(records.MAGIC[:5]) or suffix in self.suffixes

    def open(self, path: Path) -> RawLog:
        """Map the file, look at messages of every topic and list their fields.

        Raises
        ------
        InputError
            If it is no MCAP, holds no message, or none that can be read.
        """
        layout = survey_layout(path)
        return log_of(Messages(layout), "MCAP", _about(layout))


def log_of(messages: Messages, format: str, about: Mapping[str, str]) -> RawLog:
    """Return the log that these messages are: a table a topic.

    Parameters
    ----------
    messages
        Of a file that was mapped; also of other containers of such messages (ROS bags).
    format, about
        What the container is called and what `rigfit check` tells of it.

    Raises
    ------
    InputError
        If there is no message, or none that can be read.
    """
    layout = messages.layout
    topics = survey(messages)
    _refuse_if_empty(layout, messages, topics, format)
    zero = _second_zero(topics)
    readable = [topic for topic in topics if topic.samples and topic.problem is None]
    plans = {topic.name: plan(topic.samples, topic.declared.lengths) for topic in readable}
    notes = tuple(_notes(layout, messages, topics, plans, zero))
    tables = [
        TopicTable(messages, topic, plans[topic.name], zero, _clock(topic, plans[topic.name])) for topic in readable
    ]
    for table in tables:
        table.absolute_start = _iso(zero) if zero > _EPOCH else None
    for topic in topics:
        topic.forget()
    conditions, _ = _conditions(layout, readable)
    return RawLog(layout.path, format, tables, conditions, {**about, **_details(layout, topics, plans)}, notes)


def _refuse_if_empty(layout: Layout, messages: Messages, topics: Sequence[Topic], format: str) -> None:
    path = layout.path
    what = [f"{damage.reason} (byte {damage.start} of {layout.size})" for damage in layout.damages]
    for loss in messages.losses.values():
        held = (loss.end_time - loss.start_time) / 1e9
        lasted = f", which held {held:.6g} s," if held > 0 else ""
        what.append(f"a chunk (byte {loss.offset}){lasted} was left out: {loss.reason}")
    with_messages = [topic for topic in topics if topic.found]
    if not with_messages:
        unknown = _messages_without_channel(messages) if messages.portions else 0
        if unknown:
            raise InputError(f"{path}: {counted(unknown, 'message')}, but of no channel that the file defines.")
        if what:
            raise InputError(
                f"{path}: nothing could be read of this {format} file: {'; '.join(what[:3])}. It is damaged or was cut "
                "off; copy it again from the recorder. Smaller chunks lose less when a recording is cut off."
            )
        raise InputError(f"{path}: this {format} file holds no messages. Was the recorder started on the right topics?")
    if all(topic.problem is not None or not topic.samples for topic in with_messages):
        told = "; ".join(f"topic '{topic.name}': {_why_unreadable(topic)}" for topic in with_messages[:5])
        raise InputError(f"{path}: none of its messages can be read: {told}. Supported are {SUPPORTED}.")


def _messages_without_channel(messages: Messages) -> int:
    return sum(messages.batch(portion).starts.size for portion in range(min(8, len(messages.portions))))


def _why_unreadable(topic: Topic) -> str:
    return topic.problem or f"all {topic.malformed} messages looked at are malformed {topic.encoding}"


def _second_zero(topics: Sequence[Topic]) -> int:
    """Return the earliest log time (ns); a stamp of another clock than 1970's is no start for those of it."""
    times = np.concatenate([log for topic in topics for log, _ in topic.stamps])
    dated = times[times > _EPOCH]
    return int((dated if dated.size else times).min())


def _clock(topic: Topic, fields: Plan) -> str | None:
    """Return the stamp that tells the rows apart: log, else publish, None for neither."""
    if topic.found == 1 and fields.has_blocks and fields.times is None and fields.step is None:
        return None
    for clock, which in (("log", 0), ("publish", 1)):
        times = np.concatenate([stamps[which] for stamps in topic.stamps])
        if times.size < 2 or (times != times[0]).any():
            return clock
    return None


def _iso(nanoseconds: int) -> str:
    seconds, rest = divmod(nanoseconds, 10**9)
    return (datetime.fromtimestamp(seconds, UTC) + timedelta(microseconds=rest // 1000)).isoformat()


def _conditions(layout: Layout, topics: Sequence[Topic]) -> tuple[dict[str, str], list[str]]:
    """Return what metadata records and channels say of the run, and the keys that contradict each other."""
    said: dict[str, set[str]] = {}
    found: dict[str, str] = {}
    for name, pairs in layout.metadata:
        if name in _RECORDERS_RECORDS:
            continue
        for key, value in pairs.items():
            said.setdefault(key, set()).add(value)
            found.setdefault(key, value)
    contradicting = [key for key, values in said.items() if len(values) > 1]
    from_channels: dict[str, set[str]] = {}
    for topic in topics:
        for key, value in topic.declared.metadata.items():
            if key not in _RECORDERS_OWN and not is_unit_key(key) and key not in found:
                from_channels.setdefault(key, set()).add(value)
    for key, values in from_channels.items():
        if len(values) == 1:
            found[key] = next(iter(values))
        else:
            contradicting.append(key)
    return {key: value for key, value in found.items() if key not in contradicting}, contradicting


def _about(layout: Layout) -> dict[str, str]:
    """Return how the file is built."""
    kinds = Counter(s.chunk.compression or "none" for s in layout.segments if s.chunk is not None)
    chunks = ", ".join(f"{count} ({compression})" for compression, count in kinds.items())
    return {
        "profile": layout.profile or "none",
        "written by": layout.library or "unknown",
        "chunks": chunks or "none",
        "summary": "yes" if layout.message_counts is not None else "no",
    }


def _details(layout: Layout, topics: Sequence[Topic], plans: Mapping[str, Plan]) -> dict[str, str]:
    details = {}
    for topic in topics:
        schema = f"{topic.schema.encoding or 'schema'} {topic.schema.name}".strip() if topic.schema else "no schema"
        count = _count(layout, topic)
        told = [f"{topic.encoding} ({schema})", counted(count, "message") if count is not None else ""]
        told += plans[topic.name].remarks if topic.name in plans else ()
        details[f"topic {topic.name}"] = "; ".join(part for part in told if part)
    if layout.metadata:
        details["metadata records"] = listing(name or "(unnamed)" for name, _ in layout.metadata)
    if layout.attachments:
        details["attachments"] = f"{layout.attachments}, not read"
    return details


def _count(layout: Layout, topic: Topic) -> int | None:
    """Return the number of messages of a topic where the file tells it."""
    if layout.message_counts is not None:
        return sum(layout.message_counts.get(channel, 0) for channel in topic.ids)
    if any(segment.counts is None for segment in layout.segments):
        return None
    return sum((s.counts or {}).get(channel, 0) for s in layout.segments for channel in topic.ids)


def _notes(
    layout: Layout,
    messages: Messages,
    topics: Sequence[Topic],
    plans: Mapping[str, Plan],
    zero: int,
) -> Iterator[QualityFinding]:
    yield from _damage_notes(layout, messages, zero)
    for topic in topics:
        if not topic.found:
            if layout.message_counts is None or not any(layout.message_counts.get(i) for i in topic.ids):
                yield QualityFinding("note", f"topic '{topic.name}' has no messages.")
        elif topic.problem is not None or not topic.samples:
            reason = _why_unreadable(topic)
            yield QualityFinding("warning", f"topic '{topic.name}' was left out: {reason}. Supported are {SUPPORTED}.")
        elif topic.raw:
            yield QualityFinding("note", f"topic '{topic.name}': raw bytes were left out: {raw_fields(topic)}.")
    for name, fields in plans.items():
        for left_out in fields.left_out:
            yield QualityFinding("warning", f"topic '{name}': a field was left out: {left_out}.")
    for key in _conditions(layout, topics)[1]:
        yield QualityFinding("warning", f"the log's metadata give several values for '{key}'; none was used.")
    for text in layout.bad_definitions:
        yield QualityFinding("warning", f"{text}.")


def _damage_notes(layout: Layout, messages: Messages, zero: int) -> Iterator[QualityFinding]:
    """Tell what is lost: bytes of the file, chunks, and until when the rest can be read."""
    for damage in layout.damages:
        if layout.data_end is not None and damage.start >= layout.data_end:
            text = (
                f"the index at the end of the file is damaged (byte {damage.start} of {layout.size}: {damage.reason})"
            )
            yield QualityFinding("note", f"{text}; all messages stand before it.")
            continue
        lost = damage.stop - damage.start
        share = 100.0 * lost / layout.size
        if damage.stop < layout.size:
            text = f"bytes {damage.start} to {damage.stop} of {layout.size} ({share:.2g} %) cannot be read: "
            yield QualityFinding("warning", f"{text}{damage.reason}. Reading went on behind them.")
            continue
        yield QualityFinding("warning", _cut_off(layout, messages, damage, zero))
    if not layout.has_footer and not layout.damages:
        until = _last_time(messages, zero)
        told = f" It can be read up to {until:.6g} s." if until is not None else ""
        yield QualityFinding(
            "warning", f"the file ends without its closing records: the recorder or the copy was interrupted.{told}"
        )
    yield from loss_notes(messages, zero)


def _cut_off(layout: Layout, messages: Messages, damage: Damage, zero: int) -> str:
    """Say where the file breaks off and how much that costs, as far as what is left of it tells."""
    until = _last_time(messages, zero)
    text = f"the file is cut off or damaged at byte {damage.start} of {layout.size}: {damage.reason}. "
    if until is not None:
        text += f"The log can be read up to {until:.6g} s. "
    cut = layout.segments[-1] if layout.segments and layout.segments[-1].cut else None
    if cut is None or cut.chunk is None:
        return text + "How much came after that is lost, and nothing in the file tells how much it was."
    there, was = cut.length, cut.chunk.data_length
    got = messages.salvaged.get(cut.offset, 0)
    text += (
        f"Its last chunk had {was} bytes, {was - there} of them ({100.0 * (was - there) / was:.3g} %) are not in the file; "
        f"of its {cut.chunk.size} bytes unpacked {got} ({100.0 * got / max(cut.chunk.size, 1):.3g} %) could be had"
    )
    text += ", the front part, unchecked. " if got else ". "
    if cut.chunk.end_time > zero:
        end = (cut.chunk.end_time - zero) / 1e9
        text += f"That chunk once reached to {end:.6g} s at least"
        text += f": at least {end - until:.4g} s are lost. " if until is not None and end > until else ". "
    return text + "What came behind it is lost too, and nothing tells how much that was."


def _last_time(messages: Messages, zero: int) -> float | None:
    """Return the time (s) of the last message that can be read."""
    for portion in reversed(range(len(messages.portions))):
        times = messages.batch(portion).log_times
        if times.size:
            return (int(times.max()) - zero) / 1e9
    return None


READER = McapReader()
