"""The code blocks of a page: files that the reader saves, commands that he types, and what they print."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_FENCE = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"(?:^ {4}.*\n)+", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block; `title` is the file that it is saved as, '' for none."""

    language: str
    title: str
    text: str


def fenced(page: str) -> Iterator[Block]:
    """Yield the fenced blocks of a page in order."""
    for language, title, text in _FENCE.findall(page):
        yield Block(language, title, text)


def indented_commands(page: str) -> Iterator[str]:
    """Yield the commands in indented blocks, one a line, without what a `#` says of them."""
    for block in _INDENTED.findall(_FENCE.sub("", page)):
        for line in block.splitlines():
            command = re.sub(r"\s+#.*", "", line.strip())
            if command and not command.startswith("#"):
                yield command


def inline_commands(page: str) -> Iterator[str]:
    """Yield the commands that running text and tables name, with what they are given."""
    text = _INDENTED.sub("", _FENCE.sub("", page))
    for command in re.findall(r"(?<!`)`([^`\n]+)`(?!`)", text):
        if re.match(r"(?:[A-Z_]+=\S+ )?(?:rigfit|dvc|make|pip|python) ", command):
            yield command


def typed(folder: Path, commands: str) -> str:
    """Type commands into a shell in `folder`; return what they print. A failure fails the test."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "GIT_CONFIG_GLOBAL": os.devnull,
        **{f"GIT_{who}_{what}": "a@b" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")},
        "COLUMNS": "200",
    }
    done = subprocess.run(
        ["bash", "-e", "-c", commands],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, f"{commands}\n{done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


def missing(told: str, printed: str) -> list[str]:
    """Return the lines that a page tells and that were not printed in this order; '…' stands for anything."""
    lines = iter(printed.splitlines())
    absent = []
    for line in told.splitlines():
        pattern = ".*".join(re.escape(part) for part in re.split("…", line.strip()))
        if line.strip() and not any(re.fullmatch(pattern, found.strip()) for found in lines):
            absent.append(line)
            lines = iter(printed.splitlines())
    return absent


def make_project(folder: Path) -> Path:
    """Make a project without campaigns, under git and DVC, as a clone is."""
    folder.mkdir()
    for name in ("dvc.yaml", ".dvcignore", ".gitignore"):
        (folder / name).write_text((ROOT / name).read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "params.yaml").write_text("campaigns: []\nsynthetic: []\ndatasets: {}\nuses: []\n")
    for part in ("ingest", "recording", "rigs", "estimation", "signals", "findings", "report"):
        (folder / "pipeline" / part).mkdir(parents=True)
        (folder / "pipeline" / part / "code.py").write_text("")
    typed(folder, "git init -q && dvc init -q && git add . && git commit -qm start")
    return folder
