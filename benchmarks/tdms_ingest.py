"""64 MB of TDMS and of MDF, 16 waveforms: log to recording, against what npTDMS and asammdf make a DataFrame of."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.csv_ingest import seconds_of

ROWS = 500_000
RATE = 5_000.0  # Hz
SEGMENT = 5_000
CHANNELS = tuple(f"channel_{k + 1}" for k in range(16))


def signals() -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    time = np.arange(ROWS) / RATE
    return [np.sin(2 * np.pi * (1 + 0.1 * k) * time) + 0.01 * rng.standard_normal(ROWS) for k in range(len(CHANNELS))]


def write_tdms(path: Path) -> Path:
    """Write what LabVIEW writes while it measures: a segment a second."""
    from nptdms import ChannelObject, TdmsWriter

    waveform = {
        "wf_increment": 1 / RATE,
        "wf_start_offset": 0.0,
        "wf_start_time": np.datetime64("2024-05-06T10:00:00", "us"),
        "unit_string": "kN",
    }
    columns = signals()
    with TdmsWriter(path) as writer:
        for start in range(0, ROWS, SEGMENT):
            writer.write_segment(
                [
                    ChannelObject("daq", name, column[start : start + SEGMENT], waveform)
                    for name, column in zip(CHANNELS, columns, strict=True)
                ]
            )
    return path


def write_mdf(path: Path, compressed: bool) -> Path:
    from asammdf import MDF, Signal

    time = np.arange(ROWS) / RATE
    with MDF(version="4.10") as mdf:
        channels = [Signal(x, time, name=name, unit="kN") for name, x in zip(CHANNELS, signals(), strict=True)]
        mdf.append(channels, common_timebase=True)
        mdf.save(path, overwrite=True, compression=2 if compressed else 0)
    return path


def ours(log: Path, folder: Path) -> Path:
    """The whole way: units, quality checks, Parquet written."""
    from pipeline.ingest.ingest import ingest_run
    from pipeline.rigs.experiment import ChannelSpec

    specs = [ChannelSpec(name, "N", name) for name in CHANNELS]
    (written,) = ingest_run("r1", [("", log)], specs, {}, {}, {}, folder)
    return written


def arrays_only(log: Path) -> int:
    """The reader alone: numbers as logged, block by block."""
    from pipeline.ingest.registry import open_log

    (table,) = open_log(log).tables
    return sum(block[CHANNELS[0]].size for block in table.blocks())


def with_nptdms(log: Path) -> Any:
    from nptdms import TdmsFile

    return TdmsFile.read(log).as_dataframe()


def with_asammdf(log: Path) -> Any:
    from asammdf import MDF

    with MDF(log) as mdf:
        return mdf.to_dataframe()


def assert_same(written: Path, frame: Any) -> None:
    """Compare all channels of the recording with the DataFrame."""
    from pipeline.recording import storage

    recording = storage.read(written)
    for name in CHANNELS:
        (column,) = (c for c in frame.columns if str(c).split("/")[-1].strip("'") == name)
        np.testing.assert_allclose(recording.values(name), frame[column].to_numpy() * 1e3, rtol=1e-15)
    np.testing.assert_allclose(recording.signal(CHANNELS[0])[0], np.arange(ROWS) / RATE, atol=1e-9)


def measure() -> list[dict[str, Any]]:
    from importlib.metadata import version

    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs: list[tuple[str, str, Path, Callable[[Path], Any]]] = [
            ("TDMS", f"npTDMS {version('npTDMS')} as_dataframe", write_tdms(folder / "a.tdms"), with_nptdms),
            ("MDF 4", f"asammdf {version('asammdf')} to_dataframe", write_mdf(folder / "a.mf4", False), with_asammdf),
            ("MDF 4, compressed", f"asammdf {version('asammdf')} to_dataframe", write_mdf(folder / "z.mf4", True), with_asammdf),
        ]  # fmt: skip
        for kind, against, log, frame_of in logs:
            assert_same(ours(log, folder / "out"), frame_of(log))
            whole, alone, reference = seconds_of(
                partial(ours, log, folder / "out"),
                partial(arrays_only, log),
                partial(frame_of, log),
                repeat=3,
            )
            size = log.stat().st_size / 1e6
            for what, took in ((f"{size:.0f} MB {kind}, 16 channels -> SI, checked, Parquet", whole), ("the same, reader alone", alone)):  # fmt: skip
                rows.append(
                    {
                        "what": what,
                        "against": against,
                        "ours": took,
                        "theirs": reference,
                        "goal": "",
                    }
                )
    return rows
