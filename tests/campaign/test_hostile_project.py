"""What people and programs leave in a project and means harm: YAML that explodes, names that lead elsewhere, JSON without end."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipeline.campaign import ingested, runs_table, seen
from pipeline.campaign.conditions import of_run
from pipeline.campaign.recipe import Recipe, load
from pipeline.errors import InputError
from pipeline.findings import storage
from pipeline.rigs.registry import experiment

DEEP = "[" * 100_000
SHEAR = "experiment: mre.shear\n"
RECIPES = {
    "a billion laughs": SHEAR + "a: &a [x, x, x, x, x, x, x, x, x]\n"
    + "".join(f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)),
    "an object of Python": SHEAR + "settings: !!python/object/apply:os.system [touch harm]\n",
    "a set": SHEAR + "exclude: !!set x\n",
    "brackets without end": SHEAR + "settings: " + DEEP,
    "a list within itself": SHEAR + "settings: &a {b: *a}\n",
    "a merge of everything": SHEAR + "settings: &a {<<: [*a, *a]}\n",
    "a number of 5000 digits": SHEAR + "settings: {seed: " + "9" * 5000 + "}\n",
    "a number beyond all": SHEAR + "conditions: {coil_current: 1e400}\n",
    "no number": SHEAR + "conditions: {coil_current: .nan}\n",
    "keys that are lists": SHEAR + "? [conditions]\n: 1\n",
    "a key twice": SHEAR + SHEAR,
    "two documents": SHEAR + "---\n" + SHEAR,
    "control signs": SHEAR + "title: \x07\n",
    "an experiment with a path": "experiment: ../../x\n",
}  # fmt: skip


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_that_means_harm_is_refused_in_words(tmp_path: Path, name: str) -> None:
    path = tmp_path / "r.yaml"
    path.write_text(RECIPES[name])
    with pytest.raises(InputError, match=r"r\.yaml") as refusal:
        load(path)
    assert len(str(refusal.value)) < 1500
    assert [entry.name for entry in tmp_path.iterdir()] == ["r.yaml"]


@pytest.mark.parametrize(
    "value", ["1e400 A", "inf", "-inf A", "nan", "1e999999999 A", "9" * 5000, "<script>", "=1+1", "\x1b[31m"]
)
def test_a_condition_that_is_no_finite_number_is_refused_with_its_line(tmp_path: Path, value: str) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(f"run,coil_current [A]\nr1,{value}\n")
    with pytest.raises(InputError, match=r"runs\.csv line 2"):
        runs_table.read(path, experiment("mre.shear"), "runs.csv")


@pytest.mark.parametrize(
    "run", ["../../x", "/etc/x", "C:\\x", "CON", "x" * 300, "\u202etxt.exe", "-rf", ".", "=cmd", "a b", "<b>", "$(x)"]
)
def test_runs_csv_may_call_runs_as_it_likes_and_nothing_is_opened_by_that_name(tmp_path: Path, run: str) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(f"run,coil_current [A]\n{run},2\nr1,3\n", encoding="utf-8")
    shear = experiment("mre.shear")
    table = runs_table.read(path, shear, "runs.csv")
    assert of_run("r1", Recipe.default(shear), table, {}, ["r1.csv"]).values["coil_current"] == 3.0
    [remark] = table.remarks({"r1": ["r1.csv"]})
    assert repr(run)[1:4] in remark.message or run[:3] in remark.message
    assert [entry.name for entry in tmp_path.iterdir()] == ["runs.csv"]


@pytest.mark.parametrize(
    "content", [DEEP, "{" * 5000, "null", '{"schema": 1}', '{"schema": ' + "9" * 5000 + "}", '"\\ud800"', "\0"]
)
def test_findings_that_are_none_are_refused_in_words(tmp_path: Path, content: str) -> None:
    (tmp_path / "findings.json").write_text(content)
    with pytest.raises(InputError, match=r"findings\.json: not findings as rigfit writes them"):
        storage.read(tmp_path)


ENTRY = {"key": "k", "readers": [], "files": {"r1.parquet": "0"}}


@pytest.mark.parametrize(
    "change",
    [
        lambda content: content["runs"].update(r2={**ENTRY, "files": {"../../kept": "0"}}),
        lambda content: content["runs"].update(r2={**ENTRY, "files": {"/etc/kept": "0"}}),
        lambda content: content["runs"].update(r2={**ENTRY, "files": ["r2.parquet"]}),
        lambda content: content["runs"].update(r2={**ENTRY, "files": {}}),
        lambda content: content["runs"].update(r2="r2"),
        lambda content: content.update(runs=[]),
        lambda content: content.update(quality=[{"level": "worst", "message": "m", "run": None, "channel": None, "span": None}]),
        lambda content: content.update(quality=["m"]),
        lambda content: content.update(left_out=[[]]),
        lambda content: content.pop("quality"),
    ],
)  # fmt: skip
def test_a_manifest_that_is_not_as_it_was_written_counts_as_none(
    tmp_path: Path, change: Callable[[dict[str, Any]], object]
) -> None:
    content: dict[str, Any] = {"runs": {"r1": ENTRY}, "left_out": [], "quality": [], "uses": {}}
    path = tmp_path / ingested.MANIFEST
    path.write_text(json.dumps(content))
    assert ingested.manifest(tmp_path) == content
    change(content)
    path.write_text(json.dumps(content))
    assert ingested.manifest(tmp_path) == {}
    path.write_text(DEEP)
    assert ingested.manifest(tmp_path) == {}


@pytest.mark.parametrize(
    "content",
    ["5", "[]", "{}", DEEP, '{"hashes": {"a": 5}, "heads": {}, "unfinished": {}}',
     '{"hashes": {}, "heads": {"r": 1}, "unfinished": {}}',
     '{"hashes": {}, "heads": {}, "unfinished": {"r": {"key": "", "readers": [], "files": {"../../kept.parquet": "0"}}}}'],
)  # fmt: skip
def test_what_is_remembered_is_believed_only_as_it_was_written(tmp_path: Path, content: str) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    (tmp_path / ".recordings.seen.json").write_text(f"{seen._digest(content)}\n{content}\n")
    remembered = seen.Seen(folder)
    assert remembered.unfinished == {}
    (tmp_path / "log").write_text("x")
    assert len(remembered.sha256(tmp_path / "log")) == 64
