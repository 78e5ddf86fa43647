"""What `rigfit run mre.shear` answers to input, recipes and calls that are wrong.

Status 2 comes with one plain paragraph that names the file, never with a traceback, and leaves
earlier results in place. What can be handled is handled and said.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Call = Callable[..., Any]
HEADER = "time [s],displacement [m],force [N]"


def loop(n: int = 4000, seed: int = 0) -> np.ndarray:
    """A clean elliptic loop, shape (n, 3): time s, displacement m, force N; 5 Hz at 1 kHz."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) / 1000.0
    x = 4e-4 * np.sin(2 * np.pi * 5.0 * time)
    force = 3e5 * x + 2000 * 4e-4 * 2 * np.pi * 5 * np.cos(2 * np.pi * 5 * time) + rng.normal(0, 1.0, n)
    return np.column_stack([time, x, force])


def text_of(rows: np.ndarray, header: str = HEADER) -> str:
    return header + "\n" + "\n".join(",".join(f"{value:.9g}" for value in row) for row in rows) + "\n"


def text_with(change: Callable[[list[list[str]]], None], header: str = HEADER) -> str:
    rows = [[f"{value:.9g}" for value in row] for row in loop()]
    change(rows)
    return header + "\n" + "\n".join(",".join(row) for row in rows) + "\n"


def constant_time(rows: list[list[str]]) -> None:
    for row in rows:
        row[0] = "1.0"


def backwards(rows: list[list[str]]) -> None:
    rows.reverse()


def words(rows: list[list[str]]) -> None:
    for row in rows:
        row[2] = "high"


def nothing_but_nan(rows: list[list[str]]) -> None:
    for row in rows:
        row[1] = "NaN"


def infinite(rows: list[list[str]]) -> None:
    for row in rows:
        row[2] = "inf"


def ragged(rows: list[list[str]]) -> None:
    for row in rows[::2]:
        row.append("1")


REFUSED: dict[str, tuple[str, bytes | str, list[str]]] = {
    "an empty file": ("log.csv", b"", ["empty"]),
    "binary garbage": ("log.csv", bytes(range(256)) * 40, []),
    "NUL bytes": ("log.csv", b"\0" * 5000, []),
    "a header without rows": ("log.csv", HEADER + "\n", []),
    "three rows": ("log.csv", text_of(loop(3)), []),
    "ragged rows": ("log.csv", text_with(ragged), ["line"]),
    "two columns of the same name": ("log.csv", text_of(loop(), "time [s],force [N],force [N]"), ["force"]),
    "a column of text": ("log.csv", text_with(words), ["force"]),
    "a column of only NaN": ("log.csv", text_with(nothing_but_nan), ["displacement"]),
    "infinities": ("log.csv", text_with(infinite), ["force"]),
    "a missing channel": ("log.csv", text_of(loop(), "time [s],Weg [mm],force [N]"), ["displacement", "Weg", "{channel:"]),
    "an unknown unit": ("log.csv", text_of(loop(), "time [s],displacement [m],force [kNn]"), ["kNn", "force"]),
    "a unit of the wrong dimension": (
        "log.csv",
        text_of(loop(), "time [s],displacement [N],force [N]"),
        ["displacement", "'N'", "mm"],
    ),
    "constant time": ("log.csv", text_with(constant_time), ["time"]),
    "time running backwards": ("log.csv", text_with(backwards), ["time"]),
    "a file that is no MCAP": ("log.mcap", b"\x89MCAPnot really" * 20, []),
    "a text named mcap": ("log.mcap", b"hello\n", []),
    "a broken MAT file": ("log.mat", b"MATLAB 5.0 MAT-file" + b" " * 105 + b"\x00\x01IM" + b"\x0f\0\0\0\xff\xff\xff\x7f", []),
    "an unknown kind of file": ("log.xyz", b"\x13\x37" * 500, []),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_input_that_cannot_be_used_is_refused_in_one_paragraph(tmp_path: Path, rigfit: Call, fault: str) -> None:
    name, content, hints = REFUSED[fault]
    log = tmp_path / name
    log.write_bytes(content.encode() if isinstance(content, str) else content)
    out = tmp_path / "out"
    out.mkdir()
    (out / "findings.json").write_text("earlier")
    answer = rigfit("run", "mre.shear", log, "--out", out)
    assert answer.status == 2, answer.err
    assert answer.err.count("\n") == 1
    assert name in answer.err
    assert "Traceback" not in answer.err
    assert "Error" not in answer.err.replace("Error:", "")
    for hint in hints:
        assert hint in answer.err
    assert (out / "findings.json").read_text() == "earlier"
    assert sorted(path.name for path in out.iterdir()) == ["findings.json"]


def test_a_folder_or_nothing_where_a_log_should_be_is_refused(tmp_path: Path, rigfit: Call) -> None:
    for path in (tmp_path, tmp_path / "missing.csv"):
        answer = rigfit("run", "mre.shear", path, "--out", tmp_path / "out")
        assert answer.status == 2
        assert str(path) in answer.err
    assert not (tmp_path / "out").exists()


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "good.csv"
    path.write_text(text_of(loop()))
    return path


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["run", "mre.sheer", "LOG", "--out", "OUT"], "mre.shear"),
        (["run", "mre.shear", "LOG"], "--out"),
        (["run", "mre.shear", "--out", "OUT"], "LOGS"),
        (["run", "mre.shear", "LOG", "--out", "LOG"], "is a file, not a folder"),
        (["run", "mre.shear", "LOG", "--out", "OUT", "--recipe", "none.yaml"], "none.yaml"),
        (["run", "mre.shear", "LOG", "--out", "OUT", "--with", "none.json"], "none.json"),
        (["rum", "mre.shear"], "rum"),
    ],
)
def test_a_wrong_call_is_answered_with_what_is_wrong(
    tmp_path: Path, rigfit: Call, log: Path, words: list[str], hint: str
) -> None:
    places = {"LOG": log, "OUT": tmp_path / "out"}
    answer = rigfit(*(places.get(word, word) for word in words))
    assert answer.status == 2
    assert hint in answer.err
    assert "Traceback" not in answer.err


def test_a_typo_in_a_recipe_is_answered_with_its_line(tmp_path: Path, rigfit: Call, log: Path) -> None:
    recipe = tmp_path / "r.yaml"
    recipe.write_text("experiment: mre.shear\nchannels:\n  displacment: {channel: x, unit: mm}\n")
    answer = rigfit("run", "mre.shear", log, "--out", tmp_path / "out", "--recipe", recipe)
    assert answer.status == 2
    assert "line 3" in answer.err
    assert "'displacement'" in answer.err


def findings_of(out: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / "findings.json").read_text())
    return found


def test_one_clean_run_gives_loop_metrics_and_invents_nothing(tmp_path: Path, rigfit: Call, log: Path) -> None:
    answer = rigfit("run", "mre.shear", log, "--out", tmp_path / "out")
    assert answer.status in (0, 1), answer.err
    found = findings_of(tmp_path / "out")
    [damping] = [p for p in found["parameters"] if p["name"] == "damping"]
    [storage] = [p for p in found["parameters"] if p["name"] == "stiffness_storage"]
    assert storage["value"] == pytest.approx(3e5, abs=4 * storage["std_error"])
    assert damping["value"] == pytest.approx(2000, abs=4 * damping["std_error"])
    assert storage["std_error"] < 100
    assert damping["std_error"] < 3
    assert not [p for p in found["parameters"] if p["name"] == "shear_modulus_storage" and p["value"] is not None]


def gap(rows: list[list[str]]) -> None:
    del rows[1500:1800]


def single_nan(rows: list[list[str]]) -> None:
    rows[1200][2] = "NaN"


def repeated(rows: list[list[str]]) -> None:
    for number in (500, 900, 2000):
        rows.insert(number, list(rows[number]))


HANDLED = {
    "a gap": (gap, "gap"),
    "a single NaN": (single_nan, "no value in 1 sample"),
    "repeated stamps": (repeated, "3 rows with the time of the row before"),
}


@pytest.mark.parametrize("fault", HANDLED)
def test_what_can_be_handled_is_handled_and_said(tmp_path: Path, rigfit: Call, fault: str) -> None:
    change, hint = HANDLED[fault]
    log = tmp_path / "log.csv"
    log.write_text(text_with(change))
    answer = rigfit("run", "mre.shear", log, "--out", tmp_path / "out")
    assert answer.status in (0, 1), answer.err
    found = findings_of(tmp_path / "out")
    assert any(hint.lower() in q["message"].lower() for q in found["quality"]), found["quality"]
    [storage] = [p for p in found["parameters"] if p["name"] == "stiffness_storage"]
    assert storage["value"] == pytest.approx(3e5, rel=1e-3)


def test_mm_labelled_m_is_warned_of_with_the_factor(tmp_path: Path, rigfit: Call) -> None:
    rows = loop()
    rows[:, 1] *= 1000
    log = tmp_path / "log.csv"
    log.write_text(text_of(rows))
    answer = rigfit("run", "mre.shear", log, "--out", tmp_path / "out")
    assert answer.status in (0, 1)
    found = findings_of(tmp_path / "out")
    assert found["verdict"] != "ok"
    assert any("mm" in q["message"] and "1000" in q["message"] for q in found["quality"])


def test_two_logs_that_are_the_same_file_are_said(tmp_path: Path, rigfit: Call, log: Path) -> None:
    copy = tmp_path / "copy.csv"
    copy.write_bytes(log.read_bytes())
    answer = rigfit("run", "mre.shear", log, copy, "--out", tmp_path / "out")
    assert answer.status in (0, 1)
    found = findings_of(tmp_path / "out")
    assert any("same" in q["message"] for q in found["quality"])
    assert sum(run["used"] for run in found["runs"]) == 1


def test_a_raw_log_is_never_altered(tmp_path: Path, rigfit: Call, log: Path) -> None:
    before = (log.read_bytes(), log.stat().st_mtime_ns)
    rigfit("run", "mre.shear", log, "--out", tmp_path / "out")
    assert (log.read_bytes(), log.stat().st_mtime_ns) == before
