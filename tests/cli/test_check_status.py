"""`rigfit check` says of a log what `rigfit run` would say, and exits as it would, as far as the log alone tells."""

from __future__ import annotations

import json
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


def two_files(folder: Path, bench: str, device: str, column: str = "") -> list[Path]:
    """Write one run as two files; `column` stands beside the force in the second."""
    rows = loop()
    paths = [folder / "r1.bench.csv", folder / "r1.device.csv"]
    lines = [f"{t:.9g},{x:.9g}" for t, x in rows[:, :2]]
    paths[0].write_text("\n".join([bench + "time [s],displacement [m]", *lines]) + "\n")
    name, values = (f",{column} [A]", [2.0 + 0.1 * (k % 2) for k in range(len(rows))]) if column else ("", [])
    lines = [f"{t:.9g},{f:.9g}" + (f",{values[k]:.6g}" if column else "") for k, (t, f) in enumerate(rows[:, [0, 2]])]
    paths[1].write_text("\n".join([device + f"time [s],force [N]{name}", *lines]) + "\n")
    return paths


def test_check_takes_the_conditions_of_two_files_as_run_does(tmp_path: Path, rigfit: Call) -> None:
    paths = two_files(tmp_path, "# coil_current: 4 A\n", "# coil_current: 2 A\n# preload: 200 N\n")
    checked = rigfit("check", "-e", "mre.shear", *paths).out
    assert "coil_current: 4 A (from the log)" in checked
    assert "preload: 200 N (from the log)" in checked
    told = "coil_current is '4 A' by line 1 of r1.bench.csv but '2 A' by line 1 of r1.device.csv"
    assert told in checked
    assert rigfit("run", "mre.shear", *paths, "--out", tmp_path / "out").status == 0
    [run] = json.loads((tmp_path / "out/findings.json").read_text())["runs"]
    assert run["conditions"]["coil_current"] == 4.0
    assert told in (tmp_path / "out/findings.json").read_text()


def test_check_tells_contradicting_conditions_of_logs_that_cannot_be_used_too(tmp_path: Path, rigfit: Call) -> None:
    paths = two_files(tmp_path, "# coil_current: 4 A\n", "# coil_current: 2 A\n", column="displacement")
    checked = rigfit("check", "-e", "mre.shear", *paths)
    assert checked.status == 2
    assert "coil_current is '4 A' by line 1 of r1.bench.csv but '2 A'" in checked.out


def test_check_asks_back_for_a_misspelt_condition(tmp_path: Path, rigfit: Call) -> None:
    checked = rigfit("check", "-e", "mre.shear", *two_files(tmp_path, "# coil_curent: 2 A\n", "")).out
    assert "'coil_curent' (2 A), which is no condition of this experiment" in checked
    assert "Did you mean 'coil_current'?" in checked


@pytest.mark.parametrize(("line", "level"), [("", "warning"), ("# coil_current: 2 A\n", "note")])
def test_a_varying_column_with_the_name_of_a_condition_is_told(
    tmp_path: Path, rigfit: Call, line: str, level: str
) -> None:
    checked = rigfit("check", "-e", "mre.shear", *two_files(tmp_path, line, "", column="coil_current")).out
    told = next(ln for ln in checked.splitlines() if "the column 'coil_current' of r1.device.csv holds several" in ln)
    assert told.startswith(level)
    assert "first 2, then 2.1 A" in told
