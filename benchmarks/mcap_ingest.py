"""400 000 JSON messages with 4 fields, zstd: log to recording, against the official reader."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

MESSAGES = 400_000
UNITS = {"displacement": "m", "force": "N", "current": "A", "temperature": "degC"}
START = 1_700_000_000_000_000_000
STEP = 200_000  # ns


def write_log(path: Path) -> None:
    from mcap.writer import Writer

    rng = np.random.default_rng(0)
    seconds = np.arange(MESSAGES) * STEP * 1e-9
    columns = {
        "displacement": 4e-4 * np.sin(31.4 * seconds) + 1.5e-6 * rng.standard_normal(MESSAGES),
        "force": 1e3 * np.sin(31.4 * seconds + 0.2) + rng.standard_normal(MESSAGES),
        "current": 2 + 0.01 * rng.standard_normal(MESSAGES),
        "temperature": 22 + 0.1 * rng.standard_normal(MESSAGES),
    }
    properties = {name: {"type": "number", "unit": unit} for name, unit in UNITS.items()}
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = json.dumps({"type": "object", "properties": properties}).encode()
        channel = writer.register_channel("/rig", "json", writer.register_schema("rig", "jsonschema", schema))
        for i, row in enumerate(zip(*(column.tolist() for column in columns.values()), strict=True)):
            stamp = START + i * STEP
            writer.add_message(channel, stamp, json.dumps(dict(zip(UNITS, row, strict=True))).encode(), stamp)
        writer.finish()


def ours(log: Path, folder: Path) -> dict[str, np.ndarray]:
    """The whole way: units, quality checks, Parquet written and read back."""
    from pipeline.ingest.ingest import ingest_run
    from pipeline.recording import storage
    from pipeline.rigs.experiment import ChannelSpec

    si = {**UNITS, "temperature": "K"}
    specs = [ChannelSpec(name, unit, name) for name, unit in si.items()]
    recording = storage.read(ingest_run("r1", [("", log)], specs, {}, {}, {}, folder))
    stream = next(iter(recording.streams.values()))
    return {"time": stream.time, **{name: stream.channels[name].values for name in UNITS}}


def arrays_only(log: Path) -> dict[str, np.ndarray]:
    """The reader alone: times and numbers as logged, in memory."""
    from pipeline.ingest.mcap_log import READER

    blocks = list(READER.open(log).tables[0].blocks())
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def theirs(log: Path) -> dict[str, np.ndarray]:
    import pandas as pd
    from mcap.reader import make_reader

    with log.open("rb") as file:
        rows = [{"time": m.log_time, **json.loads(m.data)} for _, _, m in make_reader(file).iter_messages()]
    frame = pd.DataFrame(rows)
    return {name: frame[name].to_numpy() for name in frame}


def seconds_of(work: Callable[[], Any], repeat: int) -> tuple[float, Any]:
    """Return the best wall time of a few, and the last result."""
    times, result = [], None
    for _ in range(repeat):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
    return min(times), result


def measure() -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = folder / "rig.mcap"
        write_log(log)
        reference, expected = seconds_of(lambda: theirs(log), 2)
        rows = []
        for what, goal, work in (
            (
                "400 000 JSON messages, zstd MCAP -> Recording on disk",
                "at least 6",
                lambda: ours(log, folder / "out"),
            ),
            ("the same, reader alone", "", lambda: arrays_only(log)),
        ):
            took, found = seconds_of(work, 3)
            np.testing.assert_array_equal(found["force"], expected["force"])
            rows.append(
                {
                    "what": what,
                    "against": "mcap reader, json.loads, DataFrame",
                    "ours": took,
                    "theirs": reference,
                    "goal": goal,
                }
            )
    return rows
