"""Peak memory against length: ingest of CSV and MCAP, identification of the experiments that read blocks.

Each length is handled in a process of its own, whose peak is that of the whole process, imports and all. Flat is a peak
that does not follow the length; beside it stands what holding the same log in a table takes.

    python -m benchmarks.memory [--gigabytes 5]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).parents[1]
TIMES = (1, 4, 16)
LARGEST = 0.64  # GB
# Of a larger log than this the usual way is not tried: it may need more memory than there is.
_LARGEST_BESIDE = 1.0  # GB
FLAT = 1.3
_RATE = 5_000.0
_ROWS = 100_000
_UNITS = ("kN", "mm", "degC", "bar")
_SI = {"kN": "N", "mm": "m", "degC": "K", "bar": "Pa"}
_CSV = {f"channel_{k + 1}": _UNITS[k % len(_UNITS)] for k in range(16)}
_MCAP = {"displacement": "mm", "force": "kN", "pressure": "bar", "temperature": "degC"}
# Of 13 channels at 100 kHz, and of a drive at 12 kHz: seconds whose recording is as long as TIMES[0] asks for.
_TPJB_SECONDS, _ROAD_SECONDS = 15.0, 300.0


def measure(gigabytes: float = LARGEST) -> list[dict[str, Any]]:
    rows = []
    for name, write, beside in (
        ("CSV, 17 columns", write_csv, "pandas.read_csv"),
        ("MCAP, JSON", write_mcap, "mcap reader, DataFrame"),
    ):
        peaks: list[float] = []
        for times in TIMES:
            with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as folder:
                log = Path(folder) / f"rig.{'csv' if write is write_csv else 'mcap'}"
                write(log, gigabytes * 1e9 * times / TIMES[-1])
                size = log.stat().st_size / 1e9
                theirs = _peak_of("held_in_table", log) if size <= _LARGEST_BESIDE else None
                peaks.append(_peak_of("ingested", log))
            rows.append(_row(f"ingest of {size:.3g} GB of {name}", beside, peaks, theirs))
    scale = max(1.0, gigabytes / LARGEST)
    for name, lay_down, seconds in (
        ("tpjb.dynamic", _lay_down_tpjb, _TPJB_SECONDS),
        ("tire.road", _lay_down_road, _ROAD_SECONDS),
    ):
        peaks = []
        for times in TIMES:
            with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as folder:
                lay_down(Path(folder), seconds * scale * times)
                samples = _samples(Path(folder))
                peaks.append(_peak_of(f"identified_{name.replace('.', '_')}", Path(folder)))
            what = f"{name} of {seconds * scale * times:.0f} s, {samples / 1e6:.3g} million numbers"
            rows.append(_row(what, "the numbers in memory", peaks, samples * 8 / 1e6))
    return rows


def _row(what: str, against: str, peaks: list[float], theirs: float | None) -> dict[str, Any]:
    """Return one line of the table; all that is compared is megabytes at the peak."""
    grown = peaks[-1] / peaks[0]
    return {
        "what": f"{what}, peak memory",
        "unit": "MB",
        "against": against,
        "ours": peaks[-1],
        "theirs": theirs,
        "goal": f"{grown:.2f} times that of the shortest, at most {FLAT}" if len(peaks) > 1 else "under 1000 MB",
    }


def write_csv(path: Path, size: float) -> None:
    """Write what a test machine writes, at least `size` bytes, a few megabytes in memory at a time."""
    import pyarrow as pa
    from pyarrow import csv

    rng = np.random.default_rng(0)
    noise = 0.01 * rng.standard_normal((len(_CSV), _ROWS))
    options = csv.WriteOptions(include_header=False)
    with path.open("wb") as file:
        file.write((",".join(["time [s]", *(f"{name} [{unit}]" for name, unit in _CSV.items())]) + "\n").encode())
        row = 0
        while file.tell() < size:
            seconds = np.arange(row, row + _ROWS) / _RATE
            waves = (10 * np.sin(2 * np.pi * (1 + 0.1 * k) * seconds) for k in range(len(_CSV)))
            columns = [seconds, *(np.round(wave + e, 7) for wave, e in zip(waves, noise, strict=True))]
            csv.write_csv(pa.table([pa.array(c) for c in columns], names=["time", *_CSV]), file, options)
            row += _ROWS


def write_mcap(path: Path, size: float) -> None:
    """Write JSON messages in chunks that are not packed, at least `size` bytes."""
    from mcap.writer import CompressionType, Writer

    rng = np.random.default_rng(0)
    turns = 2 * np.pi * np.arange(_ROWS // 5)[:, None] / _RATE
    values = 10 * np.sin(turns * np.array([5.0, 5.5, 6.0, 6.5])) + 0.01 * rng.standard_normal((turns.size, len(_MCAP)))
    payloads = [json.dumps(dict(zip(_MCAP, row, strict=True))).encode() for row in values.tolist()]
    properties = {name: {"type": "number", "unit": unit} for name, unit in _MCAP.items()}
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        schema = json.dumps({"type": "object", "properties": properties}).encode()
        channel = writer.register_channel("/rig", "json", writer.register_schema("rig", "jsonschema", schema))
        stamp, step = 1_700_000_000_000_000_000, round(1e9 / _RATE)
        while file.tell() < size:
            for payload in payloads:
                writer.add_message(channel, stamp, payload, stamp)
                stamp += step
        writer.finish()


def ingested(log: Path) -> None:
    """Log to recording with units, checks and Parquet."""
    from pipeline.ingest.ingest import ingest_run
    from pipeline.rigs.experiment import ChannelSpec

    units = _CSV if log.suffix == ".csv" else _MCAP
    specs = [ChannelSpec(name, _SI[unit], name) for name, unit in units.items()]
    ingest_run("r1", [("", log)], specs, {}, {}, {}, log.parent / "recording")


def held_in_table(log: Path) -> None:
    """What a user would do otherwise: all of the log in one DataFrame."""
    import pandas as pd

    if log.suffix == ".csv":
        pd.read_csv(log)
        return
    from mcap.reader import make_reader

    with log.open("rb") as file:
        pd.DataFrame([{"time": m.log_time, **json.loads(m.data)} for _, _, m in make_reader(file).iter_messages()])


def identified_tpjb_dynamic(folder: Path) -> None:
    """Recording to findings."""
    from benchmarks.tpjb_dynamic import ours

    ours(folder / "long.parquet")


def identified_tire_road(folder: Path) -> None:
    """Recording to findings."""
    from benchmarks.tire_drive import bench_of_truth
    from pipeline.recording.storage import read
    from pipeline.rigs.experiment import Context
    from pipeline.rigs.tire.road.declaration import ROAD

    drive = read(sorted(folder.glob("drive.*.parquet")), lazily=True)
    ROAD.identify([drive], ROAD.settings(), Context("drive", {"b": bench_of_truth()}))


_WORKS: dict[str, Callable[[Path], None]] = {
    work.__name__: work for work in (ingested, held_in_table, identified_tpjb_dynamic, identified_tire_road)
}


def _lay_down_tpjb(folder: Path, seconds: float) -> None:
    from benchmarks.tpjb_dynamic import write_log

    write_log(folder, seconds)


def _lay_down_road(folder: Path, seconds: float) -> None:
    from benchmarks.tire_drive import write_drive

    write_drive(folder, seconds)


def _samples(folder: Path) -> int:
    """Return how many numbers the recordings of a folder hold."""
    import pyarrow.parquet as pq

    files = [pq.read_metadata(path) for path in folder.glob("*.parquet")]
    return sum(about.num_rows * about.num_columns for about in files)


def _peak_of(work: str, path: Path) -> float:
    """Do one of `_WORKS` in a process of its own; return its peak memory, MB."""
    command = [sys.executable, "-m", "benchmarks.memory", "--only", work, "--path", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{work} of {path} failed: {done.stderr[-2000:]}")
    return float(done.stdout.splitlines()[-1])


def own_peak() -> float:
    """Return the peak memory of this process, MB; getrusage would tell that of the process that started it as well."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gigabytes", type=float, default=LARGEST, help="size of the largest log")
    parser.add_argument("--only", choices=sorted(_WORKS), help=argparse.SUPPRESS)
    parser.add_argument("--path", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.only:
        _WORKS[arguments.only](arguments.path)
        print(own_peak())
    else:
        for row in measure(arguments.gigabytes):
            print(row)
