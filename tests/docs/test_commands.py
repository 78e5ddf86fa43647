"""Every command in README and tutorial does what is said, and prints what is told."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from told_blocks import ROOT, Block, fenced, indented_commands, inline_commands, make_project, missing, typed

TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
# What the reader types to get where these tests already are.
SET_UP = {
    "make setup": "makes the environment that the tests run in",
    ". .venv/bin/activate": "the tests put that environment on the path",
    "make reports": "sets up and runs the example campaigns: minutes",
    "make test": "sets up and runs these tests",
}
NOT_TYPED = {
    "rigfit new mre.shear sample-c --datasets s3://lab-logs/sample-c": "needs a bucket; tests/cli/test_remote_logs.py has one",
    "RIGFIT_ENGINE=dask://HOST:8786 dvc repro": "needs a cluster; tests/campaign has one",
}
COMPARING = "## Comparing two settings"
git = pytest.mark.skipif(not shutil.which("git") or not shutil.which("bash"), reason="no git or bash here")


def type_inline(page: str, folder: Path) -> None:
    """Type what running text names: a command with what it is given as it stands, a bare name with --help."""
    for command in dict.fromkeys(inline_commands(page)):
        if command not in SET_UP | NOT_TYPED and not command.startswith("make "):
            bare = re.fullmatch(r"rigfit \w+", command)
            typed(folder, f"{command} --help" if bare else command.replace("LOG", "made/*"))


def follow(blocks: list[Block], folder: Path) -> None:
    """Save files, type commands and hold what they print against the text behind them."""
    printed = ""
    for block in blocks:
        if block.title:
            (folder / block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "sh":
            commands = [line for line in block.text.splitlines() if line not in SET_UP]
            printed = typed(folder, "\n".join(commands)) if commands else ""
        elif block.language == "text":
            assert not missing(block.text, printed), printed


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project in which the tutorial was followed as far as the comparison."""
    folder = make_project(tmp_path_factory.mktemp("tutorial") / "project")
    follow(list(fenced(TUTORIAL[: TUTORIAL.index(COMPARING)])), folder)
    return folder


@git
def test_the_tutorial_leads_to_a_report(followed: Path) -> None:
    assert "Rubber strip" in (followed / "reports" / "strip" / "report.html").read_text(encoding="utf-8")


@git
@pytest.mark.thorough
def test_the_tutorial_goes_on_to_a_comparison(followed: Path) -> None:
    follow(list(fenced(TUTORIAL[TUTORIAL.index(COMPARING) :])), followed)
    type_inline(TUTORIAL, followed)


def test_set_up_commands_are_real() -> None:
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    for page in (README, TUTORIAL, (ROOT / "docs" / "index.md").read_text(encoding="utf-8")):
        told = re.findall(r"`make ([\w-]+)`|^ *make ([\w-]+)", page, re.MULTILINE)
        assert {a or b for a, b in told} <= set(targets)


@pytest.fixture(scope="module")
def readme_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with the logs that README takes for granted, and the campaign that it speaks of."""
    base = tmp_path_factory.mktemp("readme")
    folder = make_project(base / "project")
    follow(list(fenced(TUTORIAL[: TUTORIAL.index("## What does a log hold")])), folder)
    typed(folder, "rigfit synthesize mre.shear --out made && rigfit synthesize mre.shear_rich --out rich")
    typed(folder, "cp made/$(ls made | grep csv | head -1) my_log.csv; cp rich/$(ls rich | head -1) my_rich_log.csv")
    return folder


def readme_commands() -> list[str]:
    commands = [command for command in indented_commands(README) if re.match(r"(rigfit|dvc|git|cp|make) ", command)]
    return [command for command in commands if command not in SET_UP]


@git
@pytest.mark.thorough
def test_every_command_of_the_readme_runs(readme_project: Path) -> None:
    recipe = next(block for block in fenced(README) if block.language == "yaml")
    names = {"Zeit": "t", '"Weg 1"': "Pos 1", '"Load cell"': "Load cell", ", sign: -1": "", "unit: s": "unit: s"}
    text = recipe.text
    for told, found in names.items():
        assert told in text
        text = text.replace(told, found)
    (readme_project / "my.yaml").write_text(text, encoding="utf-8")
    for command in readme_commands():
        log = (
            "strip_5Hz_0.6mm.csv" if "my.yaml" in command else "my_rich_log.csv" if "rich" in command else "my_log.csv"
        )
        there = (
            command.replace("my_log.csv", log)
            .replace("/from/the/rig/*.mcap", "made/*")
            .replace("--speed 10", "--speed 1e6")
        )
        typed(readme_project, there.replace("dvc repro", "dvc repro --keep-going"))
    type_inline(README, readme_project)
    assert (readme_project / "reports" / "sample-b" / "report.html").exists()


def test_the_readme_has_the_commands_that_matter() -> None:
    words = " ".join(readme_commands())
    assert all(
        word in words
        for word in ("rigfit check", "rigfit run", "rigfit new", "rigfit compare", "rigfit export", "dvc repro")
    )
