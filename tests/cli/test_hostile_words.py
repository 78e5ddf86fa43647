"""Markup, formulas and control signs in the names and texts of logs: shown as they stand or left out, never obeyed."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Call = Callable[..., Any]
HARM = [
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "]]><svg onload=alert(1)>",
    "</title></svg></style><b>",
    "{{7*7}}{% for %}",
    "$\\frac{1}{0}$",
    "\\",
    "=cmd|' /C calc'!A0",
    "' onmouseover='alert(1)",
    "\u202etxt.exe",
    "javascript:alert(1)",
]
TIME = np.arange(300) / 100.0


class Live(HTMLParser):
    """Collects what a page would do: scripts, handlers, outside addresses."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.scripts = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.scripts += tag == "script"
        handlers = [name for name, _ in attrs if name.startswith("on")]
        outside = [
            value for name, value in attrs if name in ("src", "href") and value and not value.startswith(("#", "data:"))
        ]
        if handlers or tag in ("img", "iframe", "object", "embed") or any(v.startswith("javascript") for v in outside):
            self.found.append(f"{tag} {handlers} {outside}")


def live(page: str) -> Live:
    parser = Live()
    parser.feed(page)
    parser.close()
    return parser


def write_log(path: Path, harm: str) -> None:
    """Write a log of the toy rig whose other channel, entries and words bear `harm`."""
    quoted = harm.replace('"', '""')
    x = 0.01 * np.sin(TIME)
    rows = "".join(f'{t:.2f},{u:.6f},{200 * u + 1e-3 * (-1) ** k:.6f},1,"{quoted}"\n' for k, (t, u) in enumerate(zip(TIME, x, strict=True)))  # fmt: skip
    head = f"# wire_diameter: 1 mm\n# operator: {harm}\n# {harm}: {harm}\n"
    path.write_text(f'{head}time [s],extension [m],force [N],"{quoted} [{quoted[:5]}]","word {quoted}"\n{rows}')


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("usual")
    write_log(folder / "pull.csv", "nothing")
    return folder / "pull.csv"


@pytest.mark.parametrize("harm", HARM)
def test_words_of_a_log_act_in_no_report(tmp_path: Path, rigfit: Call, harm: str) -> None:
    name = harm.replace("/", "-").replace("\\", "-").replace(":", "-").strip()[:60]
    log = tmp_path / f"{name}.csv"
    write_log(log, harm)
    (tmp_path / "r.yaml").write_text(f"experiment: spring.pull\ntitle: {json.dumps(harm)}\n", encoding="utf-8")
    answer = rigfit("run", "spring.pull", log, "--out", tmp_path / "out", "--recipe", tmp_path / "r.yaml")
    assert answer.status == 0, answer.err
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    (tmp_path / "plain.csv").write_bytes(b"")
    write_log(tmp_path / "plain.csv", "nothing")
    rigfit("run", "spring.pull", tmp_path / "plain.csv", "--out", tmp_path / "plain")
    plain = live((tmp_path / "plain" / "report.html").read_text(encoding="utf-8"))
    found = live(page)
    assert found.scripts == plain.scripts
    assert found.found == plain.found
    assert "\u202e" not in page
    assert rigfit("export", tmp_path / "out", "--to", "csv").status == 0
    [exported] = (tmp_path / "out" / "export").glob("*.csv")
    for cell in exported.read_text(encoding="utf-8").replace("\n", ",").split(","):
        assert not cell.strip('"').lstrip().startswith(("=", "+", "@"))


SIGNS = "\x1b[31m\x1b]0;owned\x07\x9b2J\u202e\b\r"


def test_no_control_sign_of_a_log_reaches_the_terminal(tmp_path: Path, rigfit: Call) -> None:
    good = tmp_path / "a\x1b[31mb.csv"
    write_log(good, f"x{SIGNS}y")
    bad = tmp_path / "bad\x1b[2J.csv"
    bad.write_text(f"# {SIGNS}\nti{SIGNS}me,a\n{SIGNS},1\n2,{SIGNS}\n")
    recipe = tmp_path / "r.yaml"
    recipe.write_text('experiment: spring.pull\nchannels: {extension: {channel: "\\e[31mx"}}\n')
    for words in (
        ("check", good, bad, "-e", "spring.pull"),
        ("run", "spring.pull", good, "--out", tmp_path / "out"),
        ("run", "spring.pull", bad, "--out", tmp_path / "out"),
        ("run", "spring.pull", good, "--out", tmp_path / "out", "-r", recipe),
        ("run", "spring.pull", tmp_path / "not\x1b[31mthere.csv", "--out", tmp_path / "out"),
    ):
        answer = rigfit(*words)
        for sign in SIGNS:
            if sign not in "[31m]0;owned2J":
                assert sign not in answer.out + answer.err, (words[0], sign)


@pytest.mark.parametrize("name", ["../../escaped", "/tmp/escaped", "..", "a\\b", ""])
def test_findings_whose_campaign_leads_elsewhere_are_not_exported_there(
    tmp_path: Path, rigfit: Call, usual: Path, name: str
) -> None:
    rigfit("run", "spring.pull", usual, "--out", tmp_path / "out")
    path = tmp_path / "out" / "findings.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "campaign": name}))
    before = sorted(tmp_path.rglob("*"))
    answer = rigfit("export", tmp_path / "out", "--to", "csv")
    assert answer.status == 2
    assert "cannot be a file's name" in answer.err
    assert sorted(tmp_path.rglob("*")) == before


def test_manifests_that_name_files_elsewhere_take_nothing_away(project: Path, rigfit: Call) -> None:
    for words in (("new", "spring.pull", "wire"), ("synthesize", "wire"), ("ingest", "wire")):
        assert rigfit(*words).status == 0
    kept = project / "kept.parquet"
    kept.write_bytes(b"precious")
    manifest = project / "recordings" / "wire" / "manifest.json"
    content = json.loads(manifest.read_text())
    for entry in content["runs"].values():
        entry["files"]["../../kept.parquet"] = "0"
    manifest.write_text(json.dumps(content))
    assert rigfit("ingest", "wire").status == 0
    assert kept.read_bytes() == b"precious"
    shutil.rmtree(project / "recordings")
