"""A recording -> CSV as the reader takes it without any mapping: for the logs of synthetic rigs.

Conditions stand in comment lines ``# name: value unit``, units in the header (``force [N]``).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pa_csv

from pipeline.recording import Condition, Recording, Stream
from pipeline.recording.storage import whole_or_not


def write_csv(recording: Recording, path: Path, units: Mapping[str, str] | None = None) -> list[Path]:
    """Write a recording, numbers in SI with all their digits, and return the files.

    One stream is `path`; each of several, which has its own clock, a file ``<run>.<stream>.csv`` beside it.

    Parameters
    ----------
    units
        SI unit of the conditions by name, written behind their values.
    """
    if len(recording.streams) == 1:
        files = {path: next(iter(recording.streams.values()))}
    else:
        files = {path.with_name(f"{path.stem}.{name}{path.suffix}"): s for name, s in recording.streams.items()}
    for file, stream in files.items():
        _write_stream(stream, file, recording.conditions, units or {})
    return list(files)


def _write_stream(stream: Stream, path: Path, conditions: Mapping[str, Condition], units: Mapping[str, str]) -> None:
    columns = {"time [s]": stream.time}
    for channel in stream.channels.values():
        columns[channel.name if channel.is_text else f"{channel.name} [{channel.unit}]"] = channel.values
    with whole_or_not(path) as partial, partial.open("wb") as file:
        for name, value in conditions.items():
            unit = units.get(name, "")
            text = repr(value) if isinstance(value, float) else str(value)
            file.write(f"# {name}: {text}{f' {unit}' if unit not in ('', '1') else ''}\n".encode())
        table = pa.table({name: pa.array(values) for name, values in columns.items()})
        file.write((",".join(columns) + "\n").encode())
        pa_csv.write_csv(table, file, pa_csv.WriteOptions(include_header=False, quoting_style="needed"))
