"""Which files are logs, which make up one run, and what the run is called."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.campaign import logs
from pipeline.errors import InputError


def touch(folder: Path, *names: str) -> list[Path]:
    paths = []
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
        paths.append(path)
    return paths


def test_notes_pictures_hidden_files_and_the_runs_table_are_no_logs(tmp_path: Path) -> None:
    touch(
        tmp_path, "b.csv", "a.mcap", "runs.csv", "README.md", "rig.jpg", ".gitkeep", ".cache/c.csv", "synthetic/s.csv"
    )
    names = [path.relative_to(tmp_path).as_posix() for path in logs.of_folder(tmp_path)]
    assert names == ["a.mcap", "b.csv", "synthetic/s.csv"]


def test_a_folder_without_logs_says_what_to_drop(tmp_path: Path) -> None:
    touch(tmp_path, "runs.csv", "notes.md")
    with pytest.raises(InputError, match=r"holds no logs; drop at least one log \(CSV, MCAP, .*rigfit fetch"):
        logs.of_folder(tmp_path)


def test_tables_of_one_run_are_its_streams(tmp_path: Path) -> None:
    paths = touch(tmp_path, "r1.device.csv", "r1.bench.csv", "r2.csv", "r10.csv")
    runs = logs.runs_of(paths)
    assert [run.run for run in runs] == ["r1", "r2", "r10"]
    assert [stream for stream, _ in runs[0].files] == ["bench", "device"]


def test_boards_with_numbers_are_streams_and_counted_endings_are_runs(tmp_path: Path) -> None:
    boards = touch(tmp_path, "b/r1.daq1.csv", "b/r1.usb6009.csv", "b/r1.phidget.csv")
    [run] = logs.runs_of(boards)
    assert (run.run, [stream for stream, _ in run.files]) == ("r1", ["daq1", "phidget", "usb6009"])
    counted = touch(tmp_path, "pad.run1.csv", "pad.run2.csv", "pad.v2.csv", "lone.daq1.csv")
    assert [run.run for run in logs.runs_of(counted)] == ["lone.daq1", "pad.run1", "pad.run2", "pad.v2"]


def test_dots_and_capitals_in_names_do_not_make_streams(tmp_path: Path) -> None:
    paths = touch(tmp_path, "ensaio.A.1.mat", "ensaio.A.3.mat", "test.A.csv", "test.B.csv", "0.4mm.csv")
    assert [run.run for run in logs.runs_of(paths)] == ["0.4mm", "ensaio.A.1", "ensaio.A.3", "test.A", "test.B"]


def test_runs_of_one_name_are_told_apart_and_what_they_are_called_is_said(tmp_path: Path) -> None:
    paths = touch(tmp_path, "a.csv", "a.mcap", "monday/x.csv", "tuesday/x.csv", "b.csv")
    runs = logs.runs_of(paths)
    assert sorted(run.run for run in runs) == ["a.csv", "a.mcap", "b", "monday-x", "tuesday-x"]
    said = [finding.message for finding in logs.said_shared(runs)]
    assert len(said) == 2
    assert "'monday-x' (monday/x.csv), 'tuesday-x' (tuesday/x.csv)" in said[1]


@pytest.mark.parametrize("name", ["..csv", "a\nb.csv", "über/../x.csv", "-rf.csv", "a:b*?.csv", " .csv"])
def test_a_run_name_cannot_leave_or_hide(tmp_path: Path, name: str) -> None:
    [run] = logs.runs_of([tmp_path / name])
    assert not {"/", "\\", "\n", ":", "*"} & set(run.run)
    assert not run.run.startswith(".")
    assert run.run


def test_paths_on_the_command_line_must_be_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        logs.as_given([tmp_path / "missing.csv"])
    with pytest.raises(InputError, match="is a folder; name the log files in it"):
        logs.as_given([tmp_path])
    (tmp_path / "there.csv").symlink_to(tmp_path / "back.csv")
    (tmp_path / "back.csv").symlink_to(tmp_path / "there.csv")
    with pytest.raises(InputError, match="a link that leads nowhere"):
        logs.as_given([tmp_path / "there.csv"])
