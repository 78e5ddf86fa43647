"""How long a second `dvc repro` takes when nothing has changed, in a project of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def measure() -> list[dict[str, Any]]:
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    with tempfile.TemporaryDirectory() as folder:
        project = Path(folder) / "project"
        subprocess.run(["git", "clone", "-q", str(ROOT), str(project)], check=True)
        dvc = shutil.which("dvc", path=environment["PATH"])
        assert dvc is not None
        times = []
        for _ in range(2):
            start = time.perf_counter()
            subprocess.run([dvc, "repro", "-q"], cwd=project, env=environment, check=True)
            times.append(time.perf_counter() - start)
    first, second = times
    return [
        {
            "what": "second dvc repro, nothing changed",
            "against": "the first one",
            "ours": second,
            "theirs": first,
            "goal": f"under 5 s (is {second:.1f} s)",
        }
    ]
