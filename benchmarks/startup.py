"""How long the command takes to answer, beyond starting Python with numpy."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np


def seconds(*command: str, repeat: int = 7) -> float:
    """Return the median wall time of a command, after one run that warms the disk."""
    times = []
    for _ in range(repeat + 1):
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        times.append(time.perf_counter() - start)
    return statistics.median(times[1:])


def measure() -> list[dict[str, Any]]:
    bare = seconds(sys.executable, "-c", "import numpy")
    rigfit = str(Path(sys.executable).with_name("rigfit"))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "small.csv"
        time_s = np.arange(5000) / 1000.0
        x, force = 1e-3 * np.sin(20 * time_s), 300 * np.sin(20 * time_s + 0.3)
        lines = [f"{t:.4f},{a:.9f},{b:.4f}" for t, a, b in zip(time_s, x, force, strict=True)]
        log.write_text("time [s],displacement [m],force [N]\n" + "\n".join(lines) + "\n")
        for what, allowed, command in (
            ("rigfit --help", 0.3, [rigfit, "--help"]),
            ("rigfit check of a small log", 1.0, [rigfit, "check", str(log)]),
        ):
            ours = seconds(*command)
            rows.append(
                {
                    "what": what,
                    "against": 'python -c "import numpy"',
                    "ours": ours,
                    "theirs": bare,
                    "goal": f"+ {allowed} s at most (is {ours - bare:+.2f} s)",
                }
            )
    return rows
