"""`rigfit run` leaves the whole new state or the whole old one, whatever stops it and wherever."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from pipeline.campaign import identify_stage, report_stage
from pipeline.findings.together import together

Call = Callable[..., Any]
TOY_RIG = Path(__file__).resolve().parents[1] / "toy_rig"


def state(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def write(folder: Path, texts: dict[str, str]) -> None:
    with together(folder) as fresh:
        for name, text in texts.items():
            (fresh / name).parent.mkdir(exist_ok=True)
            (fresh / name).write_text(text)


@pytest.fixture
def logs(tmp_path: Path, rigfit: Call) -> list[Path]:
    assert rigfit("synthesize", "spring.pull", "--out", tmp_path / "logs").status == 0
    return sorted((tmp_path / "logs").glob("*.csv"))


@pytest.fixture
def out(tmp_path: Path, rigfit: Call, logs: list[Path]) -> Path:
    """The results of the first log, and a file of the user beside them."""
    folder = tmp_path / "out"
    assert rigfit("run", "spring.pull", logs[0], "--out", folder).status == 0
    (folder / "my notes.txt").write_text("mine")
    return folder


def interrupted(*_: object) -> NoReturn:
    raise KeyboardInterrupt


def terminated(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(5)


def full(*_: object) -> NoReturn:
    raise OSError(errno.ENOSPC, "No space left on device", "report.html")


STOPS = [(interrupted, 130, "stopped"), (terminated, 143, "stopped"), (full, 2, "the disk is full")]
PLACES = [
    (identify_stage, "write_metrics", "between the findings' files"),
    (identify_stage, "write", "before the findings"),
    (report_stage, "render_report", "between findings and report"),
]


@pytest.mark.parametrize(("stop", "status", "said"), STOPS)
@pytest.mark.parametrize(("module", "name", "where"), PLACES)
def test_a_run_that_is_stopped_between_the_stages_changes_nothing(
    out: Path,
    logs: list[Path],
    rigfit: Call,
    monkeypatch: pytest.MonkeyPatch,
    module: Any,
    name: str,
    where: str,
    stop: Callable[..., Any],
    status: int,
    said: str,
) -> None:
    before = state(out)
    monkeypatch.setattr(module, name, stop)
    answer = rigfit("run", "spring.pull", logs[1], "--out", out)
    assert answer.status == status, where
    assert said in answer.err
    assert state(out) == before
    assert not [path for path in out.iterdir() if path.name.startswith(".")]


def test_a_stopped_run_into_a_new_folder_leaves_no_folder(
    tmp_path: Path, logs: list[Path], rigfit: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report_stage, "render_report", interrupted)
    assert rigfit("run", "spring.pull", logs[1], "--out", tmp_path / "new").status == 130
    assert not (tmp_path / "new").exists()


def test_the_next_run_replaces_everything_of_rigfit_and_nothing_else(out: Path, logs: list[Path], rigfit: Call) -> None:
    before = state(out)
    assert rigfit("run", "spring.pull", logs[1], "--out", out).status == 0
    after = state(out)
    assert after["my notes.txt"] == b"mine"
    assert "recordings/pull_1.parquet" in before
    assert "recordings/pull_1.parquet" not in after
    assert "recordings/pull_2.parquet" in after
    for name in ("findings.json", "report.html", "arrays/pulls.parquet"):
        assert after[name] != before[name]


def test_a_full_disk_while_the_files_take_their_places_brings_the_old_ones_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").write_text("old a")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "inner").write_text("old b")
    rename = Path.rename

    def refuses_b(path: Path, target: Path) -> Path:
        if path.parent.name == ".new.partial" and path.name == "b":
            raise OSError(errno.ENOSPC, "No space left on device")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", refuses_b)
    with pytest.raises(OSError, match="No space"):
        write(tmp_path, {"a": "new a", "b/inner": "new b", "c": "new c"})
    assert state(tmp_path) == {"a": b"old a", "b/inner": b"old b"}


def test_a_swap_that_was_cut_by_a_kill_is_undone_by_the_next(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("new a")
    (tmp_path / ".old.partial").mkdir()
    (tmp_path / ".old.partial" / "a").write_text("old a")
    (tmp_path / "b").write_text("old b")
    with pytest.raises(KeyError), together(tmp_path):
        raise KeyError
    assert state(tmp_path) == {"a": b"old a", "b": b"old b"}


def test_a_signal_while_the_files_take_their_places_waits_for_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename = Path.rename
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores Ctrl-C

    def with_signal(path: Path, target: Path) -> Path:
        os.kill(os.getpid(), signal.SIGINT)
        return rename(path, target)

    (tmp_path / "a").write_text("old")
    (tmp_path / "b").write_text("old")
    monkeypatch.setattr(Path, "rename", with_signal)
    try:
        with pytest.raises(KeyboardInterrupt):
            write(tmp_path, {"a": "new", "b": "new"})
    finally:
        signal.signal(signal.SIGINT, handler)
    assert state(tmp_path) == {"a": b"new", "b": b"new"}


def _as_in_a_terminal() -> None:
    """Undo what a job in the background, or one under nohup, hands on to its children."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_the_program_ends_it_with_its_status_and_the_old_state(
    out: Path, logs: list[Path], number: signal.Signals
) -> None:
    before = state(out)
    # A report that takes long, so that the signal comes between findings and report.
    slow = (
        "import sys, time\n"
        "from pipeline.campaign import report_stage\n"
        "def render(*_):\n    print('here', flush=True)\n    time.sleep(30)\n"
        "report_stage.render_report = render\n"
        "from pipeline.cli.main import main\n"
        "sys.argv[0] = 'rigfit'\nmain()\n"
    )
    command = [sys.executable, "-c", slow, "run", "spring.pull", str(logs[1]), "--out", str(out)]
    environment = {**os.environ, "PYTHONPATH": str(TOY_RIG)}
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=_as_in_a_terminal,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "here\n"
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert said.strip() == "rigfit: stopped; nothing half-written is left, run the same command again."
    assert state(out) == before
