"""`rigfit check` says of a log what `rigfit run` would say, and exits as it would, as far as the log alone tells."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Call = Callable[..., Any]
NAMES = "time [s],displacement [m],force [N]"


def loop() -> np.ndarray:
    """A clean elliptic loop, shape (n, 3): time s, displacement m, force N; 5 Hz at 500 Hz."""
    rng = np.random.default_rng(0)
    time = np.arange(1500) / 500.0
    x = 4e-4 * np.sin(2 * np.pi * 5.0 * time)
    force = 3e5 * x + 2000 * 4e-4 * 2 * np.pi * 5 * np.cos(2 * np.pi * 5 * time) + rng.normal(0, 1.0, time.size)
    return np.column_stack([time, x, force])


def scaled(x: float, force: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda rows: rows * [1.0, x, force]


FAULTS: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str, int, str]] = {
    "a sound loop": (scaled(1, 1), NAMES, 0, ""),
    "a dead force": (scaled(1, 0), NAMES, 2, "the channel force is dead"),
    "a dead displacement": (scaled(0, 1), NAMES, 2, "the channel displacement is dead"),
    "an inverted force": (scaled(1, -1), NAMES, 1, "the sign of one of them is wrong"),
    "swapped channels": (scaled(1, 1), "time [s],force [N],displacement [m]", 1, "they are swapped"),
    "a missing channel": (scaled(1, 1), "time [s],Weg [m],force [N]", 2, "the channel 'displacement'"),
    "an unknown unit": (scaled(1, 1), "time [s],displacement [m],force [kNn]", 2, "unknown unit 'kNn'"),
    "constant time": (lambda rows: rows * [0, 1, 1], NAMES, 2, "time stands still"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_check_exits_as_run_does_and_says_the_same(tmp_path: Path, rigfit: Call, fault: str) -> None:
    change, header, status, words = FAULTS[fault]
    log = tmp_path / "log.csv"
    rows = [",".join(f"{value:.9g}" for value in row) for row in change(loop())]
    log.write_text("\n".join([header, *rows]) + "\n")
    checked = rigfit("check", "-e", "mre.shear", log)
    ran = rigfit("run", "mre.shear", log, "--out", tmp_path / "out")
    assert (checked.status, ran.status) == (status, status), checked.out
    assert words in checked.out
    assert words in ran.err + ran.out


def test_swapped_channels_are_not_taken_for_another_unit(tmp_path: Path, rigfit: Call) -> None:
    log = tmp_path / "log.csv"
    rows = [",".join(f"{value:.9g}" for value in row) for row in loop()]
    log.write_text("\n".join(["time [s],force [N],displacement [m]", *rows]) + "\n")
    said = rigfit("check", "-e", "mre.shear", log).out
    assert "it looks swapped with 'force'" in said
    assert "labelled as" not in said


def test_check_takes_conditions_from_the_same_table_as_run(tmp_path: Path, rigfit: Call) -> None:
    assert rigfit("synthesize", "spring.pull", "--out", tmp_path / "logs").status == 0
    log = tmp_path / "pull.csv"
    text = (tmp_path / "logs" / "pull_1.csv").read_text()
    log.write_text("\n".join(line for line in text.splitlines() if "wire_diameter" not in line) + "\n")
    assert rigfit("check", "-e", "spring.pull", log).status == 2
    (tmp_path / "runs.csv").write_text("run,wire_diameter [mm]\npull.csv,1.5\n")
    answer = rigfit("check", "-e", "spring.pull", "--runs", tmp_path / "runs.csv", log)
    assert answer.status == 0
    assert "wire_diameter: 0.0015 m (from runs.csv)" in answer.out
    (tmp_path / "runs.csv").write_text("run,wire_diameter [mm],wire_diametre [mm]\npull,1.5,2\npul,1,2\n")
    said = rigfit("check", "-e", "spring.pull", "--runs", tmp_path / "runs.csv", log).out
    assert "Did you mean 'wire_diameter'?" in said
    assert "no log for 'pul' (Did you mean 'pull'?)" in said


def test_an_ad_hoc_run_of_one_log_bears_its_name(tmp_path: Path, rigfit: Call) -> None:
    log = tmp_path / "shaker 3.csv"
    rows = [",".join(f"{value:.9g}" for value in row) for row in loop() * [1, 1, 0]]
    log.write_text("\n".join([NAMES, *rows]) + "\n")
    answer = rigfit("run", "mre.shear", log, "--out", tmp_path / "out")
    assert "campaign" not in answer.err
    assert "run 'shaker 3'" in answer.err


def test_logs_that_cannot_be_read_are_all_named(tmp_path: Path, rigfit: Call) -> None:
    bad = []
    for name in ("a", "b", "c", "d", "e"):
        bad.append(tmp_path / f"{name}.csv")
        bad[-1].write_text("time [s],Weg [m],force [N]\n" + "0,1,2\n1,2,3\n2,3,4\n3,4,5\n" * (name != "e"))
    answer = rigfit("run", "mre.shear", *bad, "--out", tmp_path / "out")
    assert answer.status == 2
    assert "None of 5 logs can be read" in answer.err
    for log in bad:
        assert log.stem in answer.err.split("logs can be read")[1]
    good = tmp_path / "good.csv"
    good.write_text("\n".join([NAMES, *(",".join(f"{v:.9g}" for v in row) for row in loop())]) + "\n")
    answer = rigfit("run", "mre.shear", good, *bad, "--out", tmp_path / "out")
    assert answer.status == 0
    assert "Run a is left out" in answer.out
    assert "4 more logs cannot be read either" in answer.out
    assert "b, c, d, e" in answer.out
