"""`rigfit run --live`: a log is played through the online method, and the result is the same as without."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.cli import replaying
from pipeline.ingest.delimited.writer import write_csv
from pipeline.recording import Recording, Stream
from pipeline.rigs.mre.rich.declaration import SHEAR_RICH, RichSettings
from pipeline.rigs.mre.synthetic import synthesize_rich

Call = Callable[..., Any]


@pytest.fixture(scope="module")
def record() -> Recording:
    return synthesize_rich({"rate": 1000.0}, 1, 6.0, 12.0)


@pytest.fixture
def log(record: Recording, tmp_path: Path) -> Path:
    path = tmp_path / "rich_6a.csv"
    write_csv(record, path, {spec.name: spec.unit for spec in SHEAR_RICH.conditions})
    return path


def test_a_line_a_second_shows_the_parameters_and_the_result_is_that_of_a_run_without(
    log: Path, rigfit: Call, tmp_path: Path
) -> None:
    plain = rigfit("run", "mre.shear_rich", log, "--out", tmp_path / "plain")
    live = rigfit("run", "mre.shear_rich", log, "--out", tmp_path / "live", "--live")
    assert (plain.status, live.status) == (0, 0), live.err
    lines = live.out.splitlines()
    assert "k1 [N/mm]" in lines[1]
    times = [float(line.split()[0]) for line in lines[2:14]]
    assert times == pytest.approx([float(t) for t in range(1, 13)], abs=0.11)
    assert "collecting" in lines[2]
    assert all("+-" in line and "not converged" in line for line in lines[6:14])
    assert "the annealing has not faded" in live.out
    assert live.out.endswith(plain.out.replace("plain", "live"))
    found = [json.loads((tmp_path / name / "findings.json").read_text())["parameters"] for name in ("plain", "live")]
    assert found[0] == found[1]
    assert (tmp_path / "live" / "report.html").is_file()


def test_it_waits_for_the_log_at_the_speed_that_is_asked(
    record: Recording, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    monkeypatch.setattr(replaying.clock, "monotonic", lambda: now[0])
    monkeypatch.setattr(replaying.clock, "sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))
    replaying.play(SHEAR_RICH, RichSettings(), [record], 4.0)
    assert now[0] == pytest.approx(12.0 / 4, abs=0.01)
    assert capsys.readouterr().out.count("\n") >= 14


def test_samples_are_handed_over_in_small_pieces_whatever_the_blocks_of_the_file(record: Recording) -> None:
    fed: list[float] = []

    class Counts:
        channels = ("force",)

        def heading(self) -> list[str]:
            return []

        def feed(self, time: Any, values: Any) -> None:
            fed.extend([time[-1] - time[0], time.size])
            assert values[0].size == time.size

        def say(self) -> str:
            return ""

        def finish(self) -> list[str]:
            return []

    experiment = replace(SHEAR_RICH, live=lambda _recording, _settings: Counts())
    replaying.play(experiment, RichSettings(), [record], float("inf"))
    assert max(fed[::2]) < 0.11
    assert sum(fed[1::2]) == record.values("force").size


def test_an_experiment_without_an_online_method_says_so_and_names_those_that_have_one(
    log: Path, rigfit: Call, tmp_path: Path
) -> None:
    answer = rigfit("run", "mre.shear", log, "--out", tmp_path / "out", "--live")
    assert answer.status == 2
    assert "mre.shear has no online method" in answer.err
    assert "mre.shear_rich" in answer.err
    assert not (tmp_path / "out").exists()


def test_speed_is_for_live_only(log: Path, rigfit: Call, tmp_path: Path) -> None:
    answer = rigfit("run", "mre.shear_rich", log, "--out", tmp_path / "out", "--speed", "2")
    assert answer.status == 2
    assert "--live" in answer.err


@pytest.mark.parametrize("speed", ["nan", "-1"])
def test_a_speed_that_is_none_is_refused(log: Path, rigfit: Call, tmp_path: Path, speed: str) -> None:
    answer = rigfit("run", "mre.shear_rich", log, "--out", tmp_path / "out", "--live", "--speed", speed)
    assert answer.status == 2
    assert "speed" in answer.err


def test_a_log_that_will_be_refused_is_not_shown(record: Recording, capsys: pytest.CaptureFixture[str]) -> None:
    (stream,) = record.streams.values()
    force = stream.channels["force"]
    dead = replace(stream, channels={**stream.channels, "force": replace(force, values=0 * force.values)})
    replaying.play(SHEAR_RICH, RichSettings(), [replace(record, streams={stream.name: dead})], float("inf"))
    shown = capsys.readouterr().out
    assert "is not shown" in shown
    assert "+-" not in shown


def test_no_line_of_the_table_stands_twice(record: Recording, capsys: pytest.CaptureFixture[str]) -> None:
    replaying.play(SHEAR_RICH, RichSettings(), [record], float("inf"))
    times = [line.split()[0] for line in capsys.readouterr().out.splitlines()[2:-1]]
    assert len(times) == len(set(times))


def test_clocks_of_their_own_are_not_shown_and_identified_all_the_same(
    record: Recording, capsys: pytest.CaptureFixture[str]
) -> None:
    (stream,) = record.streams.values()
    parts = {
        name: Stream(name, stream.time, {name: stream.channels[name]}) for name in ("displacement", "force", "current")
    }
    replaying.play(SHEAR_RICH, RichSettings(), [replace(record, streams=parts)], float("inf"))
    assert "clocks of their own" in capsys.readouterr().out
