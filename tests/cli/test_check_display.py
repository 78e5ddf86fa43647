"""What `rigfit check` shows of logs with many groups, topics and numbered channels: all of it, in few lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.cli.checking import show


def lines_of(path: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    show([str(path)], None, None)
    return capsys.readouterr().out.splitlines()


def test_twenty_groups_tell_their_rates_units_and_what_they_say(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from nptdms import ChannelObject, TdmsWriter

    rng = np.random.default_rng(0)
    begins = np.datetime64("2024-05-06T10:00:00", "us")
    with TdmsWriter(tmp_path / "big.tdms") as writer:
        for group in range(20):
            about = {
                "wf_increment": 1e-3 * (group + 1),
                "wf_start_time": begins,
                "unit_string": "mV",
                "serial": f"SN{group}",
            }
            channels = [ChannelObject(f"Mod{group}", f"ai{k}", rng.standard_normal(300), about) for k in range(10)]
            writer.write_segment(channels)
    lines = lines_of(tmp_path / "big.tdms", capsys)
    assert lines[1] == "20 tables with 200 channels"
    for group in range(20):
        (heading,) = [line for line in lines if line.startswith(f"table Mod{group}: ")]
        assert f"300 rows, {1000 / (group + 1):.6g} Hz" in heading
        assert heading.endswith("begins 2024-05-06 10:00:00")
    assert sum("  mV    V " in line for line in lines) == 200
    said = lines[lines.index("said by the log:") + 1 :]
    assert len(said) <= 30
    assert any("more, such as" in line for line in said)


def test_numbered_channels_that_are_alike_share_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = "time [s]," + ",".join(f"cov.{k}" for k in range(9)) + ",a1,a2,a3,b.7"
    rows = [f"{k * 0.01:.2f},{','.join(['0'] * 9)},{k % 7},{k % 5},{k % 3},0" for k in range(200)]
    (tmp_path / "r.csv").write_text("\n".join([head, *rows]) + "\n")
    names = [line.split("  ")[1] for line in lines_of(tmp_path / "r.csv", capsys) if line.startswith("  ")]
    assert names == ["channel", "cov.0 to .8", "a1", "a2", "a3", "b.7"]


def test_a_topic_is_told_under_its_table_and_stamps_as_dates(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    header, clock, heat = (
        store.types[kind]
        for kind in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/Temperature")
    )
    kind = "sensor_msgs/msg/Temperature"
    with Writer(tmp_path / "r.bag") as writer:
        topics = [writer.add_connection(f"/cell{k}/heat", kind, typestore=store) for k in range(2)]
        for second in range(30):
            for topic in topics:
                stamp = clock(sec=1_700_000_000 + second, nanosec=0)
                message = heat(header(second, stamp, "cell"), 20.0 + second, 0.0)
                writer.write(topic, (1_700_000_000 + second) * 10**9, store.serialize_ros1(message, kind))
    lines = lines_of(tmp_path / "r.bag", capsys)
    assert lines[0].endswith("r.bag: ROS 1 bag (chunks 1 (none), index yes)")
    at = next(k for k, line in enumerate(lines) if line.startswith("table cell0/heat: 30 rows, 1 Hz"))
    assert "sensor_msgs/Temperature" in lines[at + 1]
    assert "30 messages" in lines[at + 1]
    assert any(line.split()[:4] == ["header.stamp", "s", "s", "2023-11-14"] for line in lines)
