"""85 MB of CSV with 17 columns: log to recording with units, checks and Parquet, against a bare ``pandas.read_csv``."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROWS = 490_000
RATE = 5_000.0  # Hz
UNITS = ("kN", "mm", "degC", "bar")
SI_UNITS = ("N", "m", "K", "Pa")
CHANNELS = tuple(f"channel_{k + 1}" for k in range(16))


def write_log(path: Path) -> None:
    """Write what a test machine writes: names with units, numbers with ten digits."""
    rng = np.random.default_rng(0)
    seconds = np.arange(ROWS) / RATE
    columns = [seconds]
    for k in range(len(CHANNELS)):
        wave = np.sin(2 * np.pi * (1 + 0.1 * k) * seconds)
        columns.append(10 * wave + 0.01 * rng.standard_normal(ROWS))
    names = ["time [s]", *(f"{name} [{UNITS[k % len(UNITS)]}]" for k, name in enumerate(CHANNELS))]
    with path.open("w") as file:
        file.write(",".join(names) + "\n")
        np.savetxt(file, np.column_stack(columns), delimiter=",", fmt=["%.4f"] + ["%.7f"] * len(CHANNELS))


def ours(log: Path, folder: Path) -> Path:
    """The whole way: units, quality checks, Parquet written."""
    from pipeline.ingest.ingest import ingest_run
    from pipeline.rigs.experiment import ChannelSpec

    specs = [ChannelSpec(name, SI_UNITS[k % len(SI_UNITS)], name) for k, name in enumerate(CHANNELS)]
    (written,) = ingest_run("r1", [("", log)], specs, {}, {}, {}, folder)
    return written


def arrays_only(log: Path) -> int:
    """The reader alone: numbers as logged, block by block."""
    from pipeline.ingest.delimited import READER

    return sum(block["time"].size for block in READER.open(log).tables[0].blocks())


def seconds_of(*works: Callable[[], Any], repeat: int = 5) -> list[float]:
    """Return the best wall time of each, taken in turns so that all meet the same load."""
    best = [float("inf")] * len(works)
    for _ in range(repeat):
        for k, work in enumerate(works):
            start = time.perf_counter()
            work()
            best[k] = min(best[k], time.perf_counter() - start)
    return best


def assert_same(log: Path, written: Path) -> None:
    """Compare one channel of the recording with what pandas reads."""
    import pandas as pd

    from pipeline.recording import storage

    theirs = pd.read_csv(log, usecols=["channel_1 [kN]"], engine="c")["channel_1 [kN]"].to_numpy()
    np.testing.assert_allclose(storage.read(written).values("channel_1"), theirs * 1e3, rtol=1e-15)


def measure() -> list[dict[str, Any]]:
    import pandas as pd

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = folder / "rig.csv"
        write_log(log)
        assert_same(log, ours(log, folder / "out"))
        size = log.stat().st_size / 1e6
        whole, alone, reference = seconds_of(
            lambda: ours(log, folder / "out"), lambda: arrays_only(log), lambda: pd.read_csv(log)
        )
    against = f"pandas {pd.__version__} read_csv"
    return [
        {
            "what": f"{size:.0f} MB CSV, 17 columns -> SI, checked, Parquet",
            "against": against,
            "ours": whole,
            "theirs": reference,
            "goal": "at least 0.4",
        },
        {
            "what": "the same, reader alone",
            "against": against,
            "ours": alone,
            "theirs": reference,
            "goal": "",
        },
    ]
