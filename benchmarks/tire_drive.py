"""An hour's drive at 12 kHz, 43 million samples: recording on disk to findings, in bounded memory.

The drive is a shorter synthetic one repeated in pieces, written to disk block by block. Each length is identified in a
process of its own, whose peak memory is told; it must not follow the length.

    python -m benchmarks.tire_drive [SECONDS...]
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

PIECE = 300.0
LENGTHS = (600.0, 3600.0)
GOAL = 100.0
_KMH = 1.0 / 3.6
# A town, a country road, and back: ends at the speed that it begins with.
_SPEEDS = [[0.0, 30.0], [40.0, 30.0], [48.0, 70.0], [120.0, 70.0], [130.0, 50.0], [200.0, 50.0], [206.0, 15.0],
           [240.0, 15.0], [246.0, 30.0]]  # fmt: skip
_ALONE = """
import json, sys, time
from pathlib import Path
from benchmarks.memory import own_peak
from benchmarks.tire_drive import bench_of_truth
from pipeline.recording.storage import read
from pipeline.rigs.experiment import Context
from pipeline.rigs.tire.road.declaration import ROAD
bench = bench_of_truth()
def known():
    return read(sorted(Path(sys.argv[1]).glob("drive.*.parquet")), lazily=True)
if len(sys.argv) > 2:
    ROAD.identify([known()], ROAD.settings(), Context("compiled", {"b": bench}))
begin = time.perf_counter()
found = ROAD.identify([known()], ROAD.settings(), Context("drive", {"b": bench}))
took = time.perf_counter() - begin
peak = own_peak()
print(json.dumps({"seconds": took, "peak": peak, "revolutions": len(found.arrays["revolutions"])}))
"""


def bench_of_truth() -> Any:
    """Return findings of a bench campaign that found the synthetic tire as it is, to 0.2 %."""
    from pipeline.findings import Findings, Parameter, Run
    from pipeline.rigs.tire.synthetic.truth import bench_truth

    truth = bench_truth({})
    values = {
        "rolling_radius": truth.R, "bending_stiffness": truth.EI, "belt_width": truth.b, "foundation_radial": truth.kw,
        "foundation_tangential": truth.kv, "tread_stiffness": truth.kt, "loss_factor": truth.eta, "sensor_gain": truth.c,
        "sensor_lag": truth.flex_lag,
    }  # fmt: skip
    parameters = [
        Parameter(name=name, symbol=name, value=value, std_error=2e-3 * value, unit="1")
        for name, value in values.items()
    ]
    conditions = {
        "tire_size": truth.tire_size, "inflation_pressure": truth.inflation_pressure, "sensor_length_flex": truth.flex_length,
    }  # fmt: skip
    runs = [Run(run=f"l{load}", conditions={**conditions, "nominal_load": float(load)}) for load in (1000, 3000)]
    return Findings(campaign="b", experiment="tire.bench", verdict="ok", parameters=parameters, runs=runs)


def write_drive(folder: Path, seconds: float) -> None:
    """Write the recording of a drive of that length (s) into `folder`, a few megabytes in memory at a time."""
    from pipeline.recording import Recording
    from pipeline.recording.storage import StreamWriter, description
    from pipeline.rigs.tire.synthetic.rig import synthesize_road

    speeds = [[t, v * _KMH] for t, v in _SPEEDS]
    (piece,) = synthesize_road({"duration": PIECE, "speeds": speeds}, 1)
    count = max(1, round(seconds / PIECE))
    for name, stream in piece.streams.items():
        writer = StreamWriter(folder / f"drive.{name}.parquet", {c.name: c.unit for c in stream.channels.values()})
        for number in range(count):
            columns = {c.name: c.values for c in stream.channels.values()}
            if name == "device":
                rate = float(piece.conditions["sample_rate"])
                columns["sample_index"] = columns["sample_index"] + number * PIECE * rate
                packet = columns["packet_counter"] + number * PIECE * rate / float(
                    piece.conditions["frames_per_packet"]
                )
                columns["packet_counter"] = np.mod(packet, 2.0 ** float(piece.conditions["counter_bits"]))
            inside = stream.time < PIECE
            writer.add(stream.time[inside] + number * PIECE, {name: values[inside] for name, values in columns.items()})
        writer.close(description(Recording("drive", piece.streams, piece.conditions), name))


def alone(folder: Path, compiled: bool) -> dict[str, float]:
    """Identify the drive in `folder` in a process of its own; return seconds and peak memory (MB)."""
    command = [sys.executable, "-c", _ALONE, str(folder), *(["warm"] if compiled else [])]
    root = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    told = json.loads(done.stdout.splitlines()[-1])
    return {"seconds": told["seconds"], "peak": told["peak"], "revolutions": told["revolutions"]}


def measure(lengths: tuple[float, ...] = LENGTHS) -> list[dict[str, Any]]:
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_drive(folder, PIECE)
        alone(folder, compiled=False)  # compiles what numba compiles, once
        for length in lengths:
            write_drive(folder, length)
            found = alone(folder, compiled=False)
            rows.append(
                {
                    "what": f"drive of {length / 60.0:.0f} min, {length * 12e3 / 1e6:.0f} million samples, "
                    f"{found['revolutions']:.0f} revolutions, peak memory {found['peak']:.0f} MB",
                    "against": "the drive itself",
                    "ours": found["seconds"],
                    "theirs": length,
                    "goal": f"{GOAL:g} times as fast; memory as of the shorter one",
                }
            )
    return rows


if __name__ == "__main__":
    for row in measure(tuple(float(word) for word in sys.argv[1:]) or LENGTHS):
        print(row)
