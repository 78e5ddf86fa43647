"""A campaign of 1000 logs: what one log more costs through `dvc repro`, and what a second core is worth.

    python -m benchmarks.many_logs [--logs 1000] [--megabytes 5]

The logs are text such as a shaker's control writes. The whole of them is read once in a project of its own; then one log
is added, one replaced, one removed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
LOGS, MEGABYTES = 1000, 5.0
LOGS_ON_CORES = 200
_RATE = 2000.0  # Hz
_OWN_ROWS = 200  # rows by which logs of one body differ


class Rig:
    """Writes logs of a given size; they share bodies, so that a gigabyte is written at the speed of the disk."""

    def __init__(self, megabytes: float) -> None:
        self.rows = max(1000, round(megabytes * 1e6 / 28))
        self.bodies = [self._text(seed, _OWN_ROWS, self.rows) for seed in range(5)]

    def write(self, path: Path, number: int) -> None:
        """Write the log of a number; each is another one from its first row on."""
        head = f"# coil_current: {number % 5} A\n# frequency: 2 Hz\ntime [s],displacement [m],force [N]\n"
        path.write_text(head + self._text(100 + number, 0, _OWN_ROWS) + self.bodies[number % len(self.bodies)])

    @staticmethod
    def _text(seed: int, first: int, end: int) -> str:
        rng = np.random.default_rng(seed)
        t = np.arange(first, end) / _RATE
        x = 1e-3 * np.sin(4 * np.pi * t) + 1e-6 * rng.standard_normal(t.size)
        force = 1e5 * x + 40 * np.sign(np.cos(4 * np.pi * t)) + rng.standard_normal(t.size)
        return "".join(
            f"{a:.4f},{b:.9f},{c:.4f}\n" for a, b, c in zip(t.tolist(), x.tolist(), force.tolist(), strict=True)
        )


class Project:
    """A project with one campaign, driven by the commands that a user types."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.name = folder / "project", name
        bin_ = Path(sys.executable).parent
        self.environment = {**os.environ, "PATH": f"{bin_}{os.pathsep}{os.environ['PATH']}"}
        subprocess.run(["git", "clone", "-q", str(ROOT), str(self.folder)], check=True)
        (self.folder / "params.yaml").write_text("campaigns: []\nsynthetic: []\ndatasets: {}\nuses: []\n")
        self.seconds("rigfit", "new", "mre.shear", name)
        self.logs = self.folder / "datasets" / name

    def seconds(self, *words: str, cores: set[int] | None = None) -> float:
        """Run a command to its end and return the wall time."""
        program = shutil.which(words[0], path=self.environment["PATH"])
        assert program is not None
        pinned: Callable[[], None] | None = (lambda: os.sched_setaffinity(0, cores)) if cores else None
        start = time.perf_counter()
        subprocess.run(
            [program, *words[1:]],
            cwd=self.folder,
            env=self.environment,
            check=True,
            capture_output=True,
            preexec_fn=pinned,
        )
        return time.perf_counter() - start

    def ingest(self) -> float:
        """Let DVC bring the recordings up to date; return the wall time."""
        return self.seconds("dvc", "repro", "-q", f"ingest@{self.name}")

    def recordings(self) -> int:
        """Return how many recordings there are."""
        return len(list((self.folder / "recordings" / self.name).glob("*.parquet")))


def one_more(logs: int, megabytes: float) -> list[dict[str, Any]]:
    """What a log added, replaced or removed costs against reading all."""
    rig = Rig(megabytes)
    with tempfile.TemporaryDirectory() as folder:
        project = Project(Path(folder), "many")
        for k in range(logs):
            rig.write(project.logs / f"run{k:05d}.csv", k)
        whole = project.ingest()
        assert project.recordings() == logs
        rig.write(project.logs / "one-more.csv", logs)
        added = project.ingest()
        assert project.recordings() == logs + 1
        rig.write(project.logs / "run00000.csv", logs + 1)
        replaced = project.ingest()
        (project.logs / "run00001.csv").unlink()
        removed = project.ingest()
        assert project.recordings() == logs
        nothing = project.ingest()
    size = logs * megabytes / 1e3
    return [
        {
            "what": f"dvc repro {change} ({logs} logs, {size:.3g} GB)",
            "against": "dvc repro that reads all",
            "ours": seconds,
            "theirs": whole,
            "goal": goal,
        }
        for change, seconds, goal in (
            ("after one log is added", added, f"less than 3 % (is {100 * added / whole:.1f} %)"),
            ("after one log is replaced", replaced, ""),
            ("after one log is removed", removed, ""),
            ("with nothing new", nothing, ""),
        )
    ]


def cores(megabytes: float) -> list[dict[str, Any]]:
    """What all cores do against one."""
    all_cores = sorted(os.sched_getaffinity(0))
    if len(all_cores) < 2:
        return []
    rig = Rig(megabytes)
    with tempfile.TemporaryDirectory() as folder:
        project = Project(Path(folder), "cores")
        for k in range(LOGS_ON_CORES):
            rig.write(project.logs / f"run{k:05d}.csv", k)
        command = ("rigfit", "ingest", "cores", "--force")
        project.seconds(*command)
        two, one = np.min(
            [[project.seconds(*command, cores=set(all_cores[:n])) for n in (2, 1)] for _ in range(2)], axis=0
        )
    return [
        {
            "what": f"rigfit ingest of {LOGS_ON_CORES} logs of {megabytes:g} MB on two cores",
            "against": "the same on one core",
            "ours": two,
            "theirs": one,
            "goal": "at least 1.7",
        }
    ]


def measure(logs: int = LOGS, megabytes: float = MEGABYTES) -> list[dict[str, Any]]:
    return [*one_more(logs, megabytes), *cores(megabytes / 5)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=LOGS)
    parser.add_argument("--megabytes", type=float, default=MEGABYTES)
    options = parser.parse_args()
    for row in measure(options.logs, options.megabytes):
        print(
            f"{row['what']}: {row['ours']:.2f} s, {row['against']}: {row['theirs']:.1f} s, {row['theirs'] / row['ours']:.2f}; {row['goal']}"
        )
