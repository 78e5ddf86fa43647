"""Memory at ingest does not follow the length of a log: each length in a process of its own, which tells its peak."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROWS = 300_000
CHANNELS = ("force", "displacement", "current")
_INGEST = """
import sys
from pathlib import Path
from pipeline.ingest.registry import open_log
from pipeline.recording.storage import StreamWriter
from pipeline.ingest.stream import StreamInSI
from pipeline.ingest.mapping import resolve, Source
from pipeline.ingest.passage import Passage
from pipeline.ingest.timebase import find_times
from pipeline.rigs.experiment import ChannelSpec
log = open_log(Path(sys.argv[1]))
sources = [Source(log, log.tables[0], "log", "")]
(selection,) = resolve(sources, [ChannelSpec(name, "N", name) for name in sys.argv[3:]], {})
(time,) = find_times([selection.source], None)
with Passage(selection.channels, Path(sys.argv[2])) as passage:
    StreamInSI(selection, time).pass_to(passage)
    passage.quality.finish()
    passage.close({})
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read from /proc (Linux)")


def peak_of(log: Path) -> float:
    """Return the peak memory (MB) of a process that ingests `log`."""
    command = [sys.executable, "-c", _INGEST, str(log), str(log.with_suffix(".parquet")), *CHANNELS]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(done.stdout) / 1024


def write_csv(path: Path, rows: int) -> Path:
    rng = np.random.default_rng(0)
    with path.open("w") as file:
        file.write("time [s]," + ",".join(f"{name} [N]" for name in CHANNELS) + "\n")
        noise = rng.standard_normal((ROWS // 4, len(CHANNELS)))
        lines = [",".join(f"{value:.5f}" for value in row) for row in noise.tolist()]
        for k in range(rows):
            file.write(f"{k / 5000:.4f},{lines[k % len(lines)]}\n")
    return path


def write_mcap(path: Path, rows: int, **options) -> Path:
    from mcap.writer import Writer

    noise = np.random.default_rng(0).standard_normal((ROWS // 4, len(CHANNELS))).tolist()
    remark = {"remark": "x" * 500}  # which nobody asks for
    payloads = [json.dumps({**dict(zip(CHANNELS, row, strict=True)), **remark}).encode() for row in noise]
    units = {"type": "object", "properties": {name: {"type": "number", "unit": "N"} for name in CHANNELS}}
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start()
        schema = writer.register_schema("rig", "jsonschema", json.dumps(units).encode())
        channel = writer.register_channel("/rig", "json", schema)
        for k in range(rows):
            writer.add_message(channel, 10**18 + k * 200_000, payloads[k % len(payloads)], 10**18 + k * 200_000)
        writer.finish()
    return path


# Of the longer CSV the numbers alone would take 58 MB more than of the shorter, of the longer MCAP its messages 200 MB.
GROWTH = 30.0


def test_a_longer_csv_needs_no_more_memory(tmp_path):
    short, long = (peak_of(write_csv(tmp_path / f"{n}.csv", n * ROWS)) for n in (2, 8))
    assert long < short + GROWTH


@pytest.mark.thorough
@pytest.mark.parametrize("use_chunking", [True, False])
def test_a_longer_mcap_needs_no_more_memory(tmp_path, use_chunking):
    lengths = (120_000, 420_000)
    short, long = (peak_of(write_mcap(tmp_path / f"{n}.mcap", n, use_chunking=use_chunking)) for n in lengths)
    assert long < short + GROWTH
