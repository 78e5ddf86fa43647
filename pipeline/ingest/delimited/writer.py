"""A recording -> CSV as the reader takes it without any mapping: for the logs of synthetic rigs.

Conditions stand in comment lines ``# name: value unit``, units in the header (``force [N]``).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pa_csv

from pipeline.errors import InputError
from pipeline.recording import Recording
from pipeline.recording.storage import whole_or_not


def write_csv(recording: Recording, path: Path, units: Mapping[str, str] | None = None) -> None:
    """Write a recording of one stream, numbers in SI with all their digits.

    Parameters
    ----------
    units
        SI unit of the conditions by name, written behind their values.

    Raises
    ------
    InputError
        If the recording holds several streams: each has its own clock and belongs in its own file.
    """
    if len(recording.streams) != 1:
        raise InputError(f"run '{recording.run}' holds {len(recording.streams)} streams; CSV takes one, MCAP all.")
    stream = next(iter(recording.streams.values()))
    columns = {"time [s]": stream.time}
    for channel in stream.channels.values():
        columns[channel.name if channel.is_text else f"{channel.name} [{channel.unit}]"] = channel.values
    with whole_or_not(path) as partial, partial.open("wb") as file:
        for name, value in recording.conditions.items():
            unit = (units or {}).get(name, "")
            text = repr(value) if isinstance(value, float) else str(value)
            file.write(f"# {name}: {text}{f' {unit}' if unit not in ('', '1') else ''}\n".encode())
        table = pa.table({name: pa.array(values) for name, values in columns.items()})
        file.write((",".join(columns) + "\n").encode())
        pa_csv.write_csv(table, file, pa_csv.WriteOptions(include_header=False, quoting_style="needed"))
