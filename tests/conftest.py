"""What all tests share: the toy rig from outside the package, the command line, where real logs may lie."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does, before numpy is imported

TOY_RIG = Path(__file__).parent / "toy_rig"
sys.path.insert(0, str(TOY_RIG))  # its entry point makes it a rig, as an installed package's would

ROOT = Path(__file__).resolve().parents[1]
REALDATA = ROOT.parent / "shared" / "realdata"


@pytest.fixture(scope="session")
def realdata() -> Path:
    """The folder of logs from real machines, beside the repository."""
    if not REALDATA.is_dir():
        pytest.skip(f"logs of real machines are not here ({REALDATA})")
    return REALDATA


@dataclass(frozen=True)
class Answer:
    """What a command left: exit status and the two streams."""

    status: int
    out: str
    err: str


@pytest.fixture
def rigfit(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Answer]:
    """Call the command line in this process: ``rigfit("run", "mre.shear", log, "--out", folder)``."""
    from pipeline.cli.main import main

    def call(*words: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["rigfit", *map(str, words)])
        status = 0
        try:
            main()
        except SystemExit as stop:
            status = int(stop.code or 0)
        said = capsys.readouterr()
        return Answer(status, said.out, said.err)

    return call


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty project (no campaigns yet), which is the current folder."""
    (tmp_path / "params.yaml").write_text("# my campaigns\ncampaigns: []\nsynthetic: []\ndatasets: {}\nuses: []\n")
    (tmp_path / "dvc.yaml").write_text((ROOT / "dvc.yaml").read_text())
    (tmp_path / "recipes").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path
