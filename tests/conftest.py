"""What all tests share: the toy rig from outside the package, and where real logs may lie."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

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


@pytest.fixture(scope="session")
def rigfit() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the command as a user does, in a folder of the test; returns the finished process."""

    def call(*words: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
        path = os.pathsep.join([str(TOY_RIG), os.environ.get("PYTHONPATH", "")])
        return subprocess.run(
            [sys.executable, "-m", "pipeline.cli", *map(str, words)],
            cwd=cwd,
            env={**os.environ, "PYTHONPATH": path, **environment},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    return call


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """An empty project: no campaigns yet."""
    (tmp_path / "params.yaml").write_text("# my campaigns\ncampaigns: []\nsynthetic: []\n")
    (tmp_path / "dvc.yaml").write_text((ROOT / "dvc.yaml").read_text())
    (tmp_path / "recipes").mkdir()
    return tmp_path
