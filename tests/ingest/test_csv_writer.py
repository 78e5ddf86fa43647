"""Logs of the synthetic rigs as CSV: read back as one run, whatever clocks it has."""

from pathlib import Path

import numpy as np

from pipeline.ingest.delimited.writer import write_csv
from pipeline.ingest.naming import plain
from pipeline.recording import Channel, Recording, Stream


def _stream(name: str, rate: float) -> Stream:
    time = np.arange(50) / rate
    return Stream(name, time, {f"{name}_force": Channel(f"{name}_force", np.sin(time), "N")})


def test_each_stream_of_a_run_is_a_file_with_the_conditions(tmp_path: Path) -> None:
    run = Recording("r1", {"device": _stream("device", 100.0), "bench": _stream("bench", 10.0)}, {"preload": 2.5})
    files = write_csv(run, tmp_path / "r1.csv", {"preload": "N"})
    assert [file.name for file in files] == ["r1.device.csv", "r1.bench.csv"]
    for file in files:
        first, heading, *rows = file.read_text().splitlines()
        assert first == "# preload: 2.5 N"
        assert plain(heading) == f"time_[s],{file.name.split('.')[1]}_force_[n]"
        assert len(rows) == 50


def test_one_stream_is_the_file_that_was_asked_for(tmp_path: Path) -> None:
    run = Recording("r1", {"device": _stream("device", 100.0)})
    assert write_csv(run, tmp_path / "r1.csv") == [tmp_path / "r1.csv"]
