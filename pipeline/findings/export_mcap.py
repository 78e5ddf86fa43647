"""A run handed on as MCAP, for Foxglove and PlotJuggler: what was measured and what the findings tell over time, side by side.

JSON messages, one a sample, each topic with a JSON Schema that tells the SI unit of every field. ``timestamp`` is the time in
seconds of the run; the message's own time counts from the date of the log, or from 1970 where it has none.
"""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline import __version__
from pipeline.findings.export_json import as_json
from pipeline.findings.findings import Findings, Parameter, Quality, Run
from pipeline.findings.signals import Signals
from pipeline.recording import Recording, Stream

if TYPE_CHECKING:
    import pandas as pd

_ROWS = 1 << 15


@dataclass(frozen=True)
class Topic:
    """What one topic holds: SI unit of each field ('' for text), and its messages in time."""

    name: str
    units: Mapping[str, str]
    about: str
    blocks: Callable[[], Iterator[tuple[np.ndarray, list[np.ndarray]]]]

    def schema(self) -> bytes:
        """Return the JSON Schema of its messages; a field is absent where nothing was measured."""
        fields: dict[str, Any] = {"timestamp": {"type": "number", "unit": "s", "description": "time of the run"}}
        for name, unit in self.units.items():
            fields[name] = {"type": "number", "unit": unit} if unit else {"type": "string"}
        schema = {"title": self.name, "description": self.about, "type": "object", "properties": fields}
        return json.dumps(schema, ensure_ascii=False).encode()


def topics_of(run: str, recording: Recording | None, findings: Findings, signals: Sequence[Signals]) -> list[Topic]:
    """Return the topics of a run: ``/measured/...`` from its recording, ``/findings/...`` from the arrays of the findings.

    Parameters
    ----------
    recording
        None where it is not at hand.
    signals
        Which arrays hold signals over time; those that the findings lack are left out.
    """
    topics = [_measured(stream, len(recording.streams)) for stream in recording.streams.values()] if recording else []
    for one in signals:
        table = findings.arrays.get(one.array)
        if table is not None and {"run", "time", *one.units} <= set(table.columns):
            topics += _identified(table[table["run"] == run], one)
    return topics


def write(path: Path, run: Run, findings: Findings, topics: Sequence[Topic], unit_of: Callable[[str], str]) -> int:
    """Write one run; return the number of messages. The same findings and recording give the same bytes.

    Parameters
    ----------
    unit_of
        Gives the SI unit of a condition, '' for text.
    """
    import orjson
    from mcap.writer import CompressionType, Writer

    start = _start(run, topics)
    count = 0
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="", library=f"rigfit {__version__}")
        channels = []
        for topic in topics:
            schema = writer.register_schema(f"rigfit{topic.name.replace('/', '.')}", "jsonschema", topic.schema())
            channels.append(writer.register_channel(topic.name, "json", schema))
        for name, pairs in _metadata(run, findings, unit_of).items():
            writer.add_metadata(name, pairs)
        writer.add_attachment(start, start, "parameters.json", "application/json", as_json(findings, unit_of).encode())
        for time, place, fields in heapq.merge(*(_messages(topic, place) for place, topic in enumerate(topics))):
            content = orjson.dumps(fields, option=orjson.OPT_PASSTHROUGH_SUBCLASS, default=dict)
            writer.add_message(channels[place], start + time, content, start + time, count)
            count += 1
        writer.finish()  # type: ignore[no-untyped-call]
    return count


def _measured(stream: Stream, streams: int) -> Topic:
    name = f"/measured/{stream.name.strip('/')}" if stream.name.strip("/") and streams > 1 else "/measured"
    units = {channel.name: "" if channel.is_text else channel.unit or "1" for channel in stream.channels.values()}
    return Topic(name, units, "as ingest read it, SI", lambda: stream.blocks(list(units)))


def _identified(own: pd.DataFrame, signals: Signals) -> Iterator[Topic]:
    """Yield one topic, or one for each value of the column that tells signals apart."""
    parts = list(own.groupby(signals.by, sort=False)) if signals.by else [("", own)]
    for value, part in parts:
        if part.empty:
            continue
        ordered = part.sort_values("time", kind="stable")
        name = f"/findings/{signals.array}" + (f"/{signals.by}_{value}" if signals.by else "")
        yield Topic(name, signals.units, signals.about, partial(_blocks, ordered, list(signals.units)))


def _blocks(table: pd.DataFrame, names: list[str]) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
    yield table["time"].to_numpy(float), [table[name].to_numpy(float) for name in names]


def _messages(topic: Topic, place: int) -> Iterator[tuple[int, int, _Fields]]:
    names = list(topic.units)
    for time, columns in topic.blocks():
        for begin in range(0, time.size, _ROWS):
            piece = slice(begin, begin + _ROWS)
            seconds = time[piece].tolist()
            ticks = np.rint(time[piece] * 1e9).astype(np.int64).tolist()
            rows = zip(*(column[piece].tolist() for column in columns), strict=True) if columns else ((),) * len(ticks)
            for at, tick, row in zip(seconds, ticks, rows, strict=True):
                yield tick, place, _Fields(timestamp=at, **{n: v for n, v in zip(names, row, strict=True) if _told(v)})


class _Fields(dict[str, Any]):
    """The fields of a message. Messages of one time are ordered by their topics; never by this."""

    def __lt__(self, other: object) -> bool:
        return False


def _told(value: object) -> bool:
    return math.isfinite(value) if isinstance(value, float) else value is not None


def _start(run: Run, topics: Sequence[Topic]) -> int:
    """Return the time of second 0 in ns since 1970; later where a run without a date begins before its second 0."""
    if run.begins is not None and run.begins > 0:
        return round(run.begins * 1e6) * 1000  # as fine as the number is
    firsts = [float(time[0]) for topic in topics for time, _ in [next(topic.blocks(), (np.zeros(1), []))] if time.size]
    return max(0, math.ceil(-min(firsts, default=0.0))) * 10**9


def _metadata(run: Run, findings: Findings, unit_of: Callable[[str], str]) -> dict[str, dict[str, str]]:
    about = {
        "campaign": findings.campaign, "experiment": findings.experiment, "verdict": findings.verdict, "run": run.run,
        "version": str(findings.provenance.get("rigfit", __version__)), "used": "yes" if run.used else f"no: {run.reason}",
        "parameters are": "value ± standard error, SI; parameters.json holds all digits and the 95 % intervals",
        **{f"sha256 of {path}": digest for path, digest in zip(run.files, run.sha256, strict=False)},
    }  # fmt: skip
    own = [p for p in findings.parameters if p.at.get("run", run.run) == run.run]
    return {
        "rigfit": about,
        "conditions": {name: _condition(value, unit_of(name)) for name, value in run.conditions.items()},
        "parameters": {_label(p): _value(p) for p in own},
        "quality": _numbered(_noticed(q) for q in findings.quality if q.run in (None, run.run)),
        "verdict": _numbered(findings.reasons),
    }


def _numbered(texts: Iterable[str]) -> dict[str, str]:
    """Give texts keys that keep their order where a viewer sorts them."""
    return {f"{number:03d}": text for number, text in enumerate(texts, start=1)}


def _noticed(q: Quality) -> str:
    span = f", {q.span[0]:.6g} to {q.span[1]:.6g} s" if q.span else ""
    return f"{q.level}{f', {q.channel}' if q.channel else ''}{span}: {q.message}"


def _condition(value: float | str | bool, unit: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else f"{value:.12g} {'' if unit == '1' else unit}".strip()


def _label(p: Parameter) -> str:
    at = ", ".join(
        f"{key}={value:.6g}" if isinstance(value, float) else f"{key}={value}" for key, value in p.at.items()
    )
    return f"{p.name} [{at}]" if at else p.name


def _value(p: Parameter) -> str:
    if p.value is None:
        return p.description if p.description.startswith("not determined") else f"not determined: {p.description}"
    unit = "" if p.unit == "1" else p.unit
    if not p.std_error:
        return f"{p.value:.6g} {unit}".strip()
    value, error = (round(number, 1 - math.floor(math.log10(p.std_error))) for number in (p.value, p.std_error))
    return f"{value:.12g} ± {error:.12g} {unit}".strip()
