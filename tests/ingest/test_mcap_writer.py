"""The writer of synthetic logs: what it writes, our reader and the official one read back."""

from __future__ import annotations

import json

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_logs import EPOCH, open_log, rows, table

from pipeline.ingest.mcap_log.writer import write
from pipeline.recording import Channel, Recording, Stream


def recording(seconds: np.ndarray) -> Recording:
    force = 100 * np.sin(40 * seconds)
    force[3] = np.nan
    state = np.array([f"s{i // 7}" for i in range(seconds.size)], dtype=object)
    fast = {"force": Channel("force", force, "N"), "state": Channel("state", state, "")}
    slow = {"temperature": Channel("temperature", np.linspace(290, 300, 20), "K")}
    return Recording(
        "r1",
        {"fast": Stream("fast", seconds, fast), "slow": Stream("slow", np.arange(20) * 0.12, slow)},
        {"static_load": 52e3, "sample": "b", "preloaded": True},
    )


EVEN = np.arange(2500) / 1000
UNEVEN = np.cumsum(np.random.default_rng(0).uniform(0.5e-3, 1.5e-3, 2500)) - 0.5e-3


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
@pytest.mark.parametrize("samples", [1, 5, 100, 10_000])
@pytest.mark.parametrize("seconds", [EVEN, UNEVEN])
def test_values_times_units_and_conditions_come_back(tmp_path, compression, samples, seconds):
    written = recording(seconds - seconds[0])
    write(written, tmp_path / "r1.mcap", compression=compression, samples_per_message=samples)
    log = open_log(tmp_path / "r1.mcap")
    assert log.metadata == {"static_load": "52000.0", "sample": "b", "preloaded": "true"}
    assert not log.notes
    for name, stream in written.streams.items():
        read = rows(table(log, name))
        units = {c.name: c.unit for c in table(log, name).channels}
        np.testing.assert_allclose(read["log_time"], stream.time, rtol=0, atol=1e-9)
        for channel in stream.channels.values():
            np.testing.assert_array_equal(read[channel.name], channel.values)
            assert units[channel.name] == (channel.unit or None)


def test_the_official_reader_reads_it_in_time_order(tmp_path):
    write(recording(EVEN), tmp_path / "r1.mcap", start=EPOCH)
    with (tmp_path / "r1.mcap").open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    stamps = [message.log_time for _, _, message in messages]
    assert stamps == sorted(stamps)
    schema, channel, first = messages[0]
    assert channel.topic == "/fast"
    assert json.loads(first.data) == {"force": 0.0, "state": "s0"}
    assert json.loads(schema.data)["properties"]["force"] == {"type": "number", "unit": "N"}
    assert table(open_log(tmp_path / "r1.mcap"), "fast").absolute_start == "2023-11-14T22:13:20+00:00"


def test_the_same_recording_gives_the_same_bytes(tmp_path):
    write(recording(EVEN), tmp_path / "a.mcap")
    write(recording(EVEN), tmp_path / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_a_failed_write_leaves_nothing_behind(tmp_path):
    with pytest.raises(KeyError):
        write(recording(EVEN), tmp_path / "a.mcap", compression="rar")
    assert list(tmp_path.iterdir()) == []
