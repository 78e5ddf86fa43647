"""Conditions come from four places, the first one winning; a missing one is answered with all four."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.campaign import conditions, runs_table
from pipeline.campaign.recipe import Recipe, load
from pipeline.errors import InputError
from pipeline.rigs.registry import experiment

SPRING = experiment("spring.pull")


def recipe(tmp_path: Path, text: str = "") -> Recipe:
    path = tmp_path / "r.yaml"
    path.write_text("experiment: spring.pull\n" + text)
    return load(path)


def table(tmp_path: Path, text: str | bytes) -> runs_table.RunsTable:
    path = tmp_path / "runs.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return runs_table.read(path, SPRING, "runs.csv")


def test_the_first_of_the_four_places_wins_and_the_others_are_named(tmp_path: Path) -> None:
    made = recipe(tmp_path, 'conditions: {wire_diameter: 4 mm}\nfile_name: "pull_{wire_diameter:mm}"\n')
    rows = table(tmp_path, "run,wire_diameter [mm]\npull_3,1\n")
    log = {"Wire diameter [mm]": "2"}
    found = conditions.of_run("pull_3", made, rows, log, ["pull_3.csv"])
    assert found.values["wire_diameter"] == pytest.approx(1e-3)
    assert found.sources["wire_diameter"] == "runs.csv"
    for note, place in zip(found.notes, ["the log", "the file name", "the recipe"], strict=True):
        assert f"by {place}" in note.message
    found = conditions.of_run("pull_3", made, None, log, ["pull_3.csv"])
    assert found.values["wire_diameter"] == pytest.approx(2e-3)
    found = conditions.of_run("pull_3", made, None, {}, ["pull_3.csv"])
    assert found.values["wire_diameter"] == pytest.approx(3e-3)
    found = conditions.of_run("other", made, None, {}, ["other.csv"])
    assert found.values["wire_diameter"] == pytest.approx(4e-3)
    assert "does not fit the recipe's pattern" in found.notes[0].message


def test_agreeing_places_raise_no_note(tmp_path: Path) -> None:
    made = recipe(tmp_path, "conditions: {wire_diameter: 1 mm}\n")
    assert conditions.of_run("a", made, None, {"wire_diameter": "0.001 m"}, ["a.csv"]).notes == ()


@pytest.mark.parametrize(
    ("pattern", "name", "left_over"),
    [
        ("pull_{wire_diameter}mm", "pull_2mm5.csv", "'5'"),
        ("pull_{wire_diameter:mm}", "pull_2x.csv", "'x'"),
        ("pull_{wire_diameter}mm", "pull_2mm.5.csv", "'.5'"),
        ("{wire_diameter}mm", "v12mm.csv", "'v'"),
    ],
)
def test_a_name_that_goes_on_where_the_pattern_ends_gives_nothing_and_says_so(
    tmp_path: Path, pattern: str, name: str, left_over: str
) -> None:
    made = recipe(tmp_path, f'file_name: "{pattern}"\nconditions: {{wire_diameter: 7 mm}}\n')
    found = conditions.of_run("pull", made, None, {}, [name])
    assert found.sources["wire_diameter"] == "the recipe"
    [note] = found.notes
    assert note.level == "warning"
    assert f"{left_over} is left over" in note.message


def test_numbers_outside_the_pattern_are_noted(tmp_path: Path) -> None:
    made = recipe(tmp_path, 'file_name: "pull_{wire_diameter}mm"\n')
    found = conditions.of_run("pull", made, None, {}, ["pull_2mm_5.csv"])
    assert found.values["wire_diameter"] == pytest.approx(2e-3)
    [note] = found.notes
    assert note.level == "note"
    assert "'_5' in the file name" in note.message
    assert conditions.of_run("pull", made, None, {}, ["pull_2mm.device.csv"]).notes == ()


@pytest.mark.parametrize(
    ("pattern", "name", "expected"),
    [
        ("pull_{wire_diameter}mm", "pull_1.5mm.csv", 1.5e-3),
        ("pull_{wire_diameter}mm", "pull_1p5mm.csv", 1.5e-3),
        ("pull_{wire_diameter}mm", "pull_1,5mm.csv", 1.5e-3),
        ("{wire_diameter:um}_pull", "250_pull_7.mcap", 250e-6),
        ("d{wire_diameter}_", "d0.002_x.csv", 2e-3),
    ],
)
def test_a_pattern_takes_conditions_with_units_from_the_file_name(
    tmp_path: Path, pattern: str, name: str, expected: float
) -> None:
    made = recipe(tmp_path, f'file_name: "{pattern}"\n')
    assert conditions.of_run("x", made, None, {}, [name]).values["wire_diameter"] == pytest.approx(expected)


def test_a_missing_condition_is_answered_with_all_four_ways_to_give_it(tmp_path: Path) -> None:
    with pytest.raises(InputError) as told:
        conditions.of_run("a", recipe(tmp_path), None, {}, ["a.csv"])
    message = str(told.value)
    assert "'wire_diameter'" in message
    assert "run 'a'" in message
    for way in ("runs.csv", "# wire_diameter: 1 m", "file_name:", "conditions: {wire_diameter: 1 m}"):
        assert way in message


def test_a_condition_in_the_log_that_is_no_number_is_said_and_not_used(tmp_path: Path) -> None:
    made = recipe(tmp_path, "conditions: {wire_diameter: 1 mm}\n")
    found = conditions.of_run("a", made, None, {"wire_diameter": "unknown"}, ["a.csv"])
    assert found.values["wire_diameter"] == pytest.approx(1e-3)
    assert "'unknown'" in found.notes[0].message


@pytest.mark.parametrize(
    "text",
    [
        "run,wire_diameter [mm]\na,1.5\nb,2\n",
        "run;wire_diameter (mm)\r\na;1,5\r\nb;2\r\n",
        "run\twire_diameter\na\t1.5 mm\nb\t0.002\n",
        "\ufeffRun,Wire Diameter [mm],remark\n\n# later runs\na,1.5,first\nb,2,\n",
        "run,wire_diameter [mm]\na,1.5\nb,2\n".encode("utf-16"),
    ],
)
def test_runs_tables_of_many_dialects_say_the_same(tmp_path: Path, text: str | bytes) -> None:
    rows = table(tmp_path, text)
    assert rows.conditions("a")["wire_diameter"] == pytest.approx(1.5e-3)
    assert rows.conditions("b")["wire_diameter"] == pytest.approx(2e-3)
    assert rows.unknown({"a": ["a.csv"]}) == ["'b'"]


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("", "is empty"),
        ("name,wire_diameter\na,1\n", "no column 'run'"),
        ("run,wire_diameter [kg]\na,1\n", "does not measure"),
        ("run,wire_diameter\na,thick\n", "line 2, column 'wire_diameter'"),
        ("run,wire_diameter\na,1\na,2\n", "line 3: the run 'a' stands twice"),
        ("run,wire_diameter\n,1\n", "line 2: the column 'run' is empty"),
        ("run,wire_diameter,wire_diameter\na,1,2\n", "two columns are called 'wire_diameter'"),
        (b"run\0\1\2", "NUL"),
        (
            "run,wire_diameter [mm]\na,1,5\n",
            "line 2: has 3 cells but the header names 2 columns; nothing says what '5' is",
        ),
        ("run,wire_diameter [mm]\na,nan\n", "line 2, column 'wire_diameter'"),
        ("run,wire_diameter [mm]\na,1e999\n", "cannot be"),
    ],
)
def test_a_broken_runs_table_is_answered_with_line_and_column(tmp_path: Path, text: str | bytes, hint: str) -> None:
    with pytest.raises(InputError, match=r"runs\.csv") as told:
        table(tmp_path, text)
    assert hint in str(told.value)


def test_a_misspelt_column_of_the_runs_table_is_said(tmp_path: Path) -> None:
    rows = table(tmp_path, "run,wire_diametre\na,1\n")
    assert "Did you mean 'wire_diameter'?" in rows.notes[0].message


@pytest.mark.parametrize("pattern", ["pull_{wire_diameter", "pull_wire_diameter}", "{wire_diameter}_{x"])
def test_a_brace_without_its_partner_in_the_pattern_is_refused(tmp_path: Path, pattern: str) -> None:
    with pytest.raises(InputError, match=r"line 2: file_name: .* a brace without its partner"):
        recipe(tmp_path, f'file_name: "{pattern}"\n')


def test_empty_cells_beyond_the_header_do_not_matter(tmp_path: Path) -> None:
    rows = table(tmp_path, "run,wire_diameter [mm]\na,1,,\n")
    assert rows.conditions("a")["wire_diameter"] == pytest.approx(1e-3)


def test_a_run_may_be_called_by_the_name_of_its_file(tmp_path: Path) -> None:
    rows = table(tmp_path, "run,wire_diameter [mm]\npull_1.csv,1\npull_2,2\npul_3,3\n")
    assert rows.conditions("pull_1", ["pull_1.csv"])["wire_diameter"] == pytest.approx(1e-3)
    assert rows.conditions("pull_2", ["pull_2.csv"])["wire_diameter"] == pytest.approx(2e-3)
    runs = {name: [f"{name}.csv"] for name in ("pull_1", "pull_2", "pull_3")}
    assert rows.unknown(runs) == ["'pul_3' (Did you mean 'pull_3'?)"]


def test_a_run_that_two_lines_mean_is_refused(tmp_path: Path) -> None:
    rows = table(tmp_path, "run,wire_diameter [mm]\na,1\na.csv,2\n")
    with pytest.raises(InputError, match=r"'a', 'a\.csv' are the same run"):
        rows.conditions("a", ["a.csv"])


def test_a_number_in_the_log_that_cannot_be_is_said_and_not_used(tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_text("experiment: mre.shear\n")
    found = conditions.of_run("a", load(path), None, {"pad_height": "-6 mm", "n_pads": "2"}, ["a.csv"])
    assert "pad_height" not in found.values
    assert found.values["n_pads"] == 2
    assert "-6 mm" in found.notes[0].message
    assert found.notes[0].message.endswith("It is not used.")
