"""Kill `dvc repro` with all that it started (SIGKILL) at random moments; the next `dvc repro` must end as if nothing had been.

    python -m benchmarks.crash [--kills 50] [--seed 1]

In a project of its own: one campaign whose logs lie there, one synthetic, and one that uses the findings of the second.
Each kill begins in a fresh copy of it. Told are the kills after which the next run failed, recordings, findings or reports
differ in a bit from those of an undisturbed run, a log was touched, or a file is left that an undisturbed run does not leave.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent
# The campaign `logs` is given logs; the others are made by DVC.
RECIPES = {
    "logs": "experiment: mre.step\n",
    "base": "experiment: tpjb.baseline\nsynthetic: {seed: 10, formats: [csv, mcap]}\n",
    "onto": "experiment: tpjb.dynamic\nuses: [base]\nsynthetic: {seed: 2, truth: {bearings: [4pad-L1]}, formats: [mcap]}\n",
}
PARAMS = "campaigns: [logs, base, onto]\nsynthetic: [base, onto]\ndatasets: {}\nuses: [{campaign: onto, of: base}]\n"
MADE = ("recordings", "reports", "datasets")
# What is remembered of files (inodes, times) is another one in each copy, and no result.
_REMEMBERED = ".seen.json"
_MOST_SECONDS = 600
# DVC empties these files of its own before it writes them anew, and does not go on where it finds them so; 'make reports'
# removes them.
LEFT_EMPTY = (".dvc/tmp/rwlock", "dvc.lock")


@dataclass(frozen=True)
class Undisturbed:
    """What a run that nothing disturbs leaves: bytes by file (as hashes), and how many seconds it takes."""

    made: Mapping[str, str]
    seconds: float


@dataclass(frozen=True)
class Outcome:
    """One kill: when, which files had to be removed by hand, what the next run said if it failed, what is not as it should be."""

    seconds: float
    stage: str
    by_hand: tuple[str, ...]
    failed: str
    wrong: tuple[str, ...]


def new_project(folder: Path) -> Path:
    """Make the project with the logs of its first campaign, and nothing that DVC makes."""
    project = folder / "project"
    (project / "recipes").mkdir(parents=True)
    for name in ("dvc.yaml", ".dvcignore", ".gitignore"):
        shutil.copy(ROOT / name, project / name)
    (project / "params.yaml").write_text(PARAMS)
    for name, text in RECIPES.items():
        (project / "recipes" / f"{name}.yaml").write_text(text)
        (project / "datasets" / name).mkdir(parents=True)
        (project / "datasets" / name / ".gitkeep").touch()
    for part in ("ingest", "recording", "rigs", "estimation", "signals", "findings", "report"):
        (project / "pipeline" / part).mkdir(parents=True)
        (project / "pipeline" / part / "code.py").touch()
    _run(project, "git", "init", "-q")
    _run(project, "dvc", "init", "-q")
    _run(project, "rigfit", "synthesize", "mre.step", "--out", str(project / "datasets" / "logs" / "made"))
    return project


def undisturbed(project: Path) -> Undisturbed:
    """Run a copy of the project from beginning to end."""
    with tempfile.TemporaryDirectory(dir=project.parent, ignore_cleanup_errors=True) as folder:  # DVC may still write
        copy = _copied(project, Path(folder))
        start = time.perf_counter()
        _run(copy, "dvc", "repro")
        return Undisturbed(made_in(copy), time.perf_counter() - start)


def kill_once(project: Path, after: float, expected: Undisturbed) -> Outcome:
    """Kill `dvc repro` of a copy `after` seconds, run it again and compare."""
    with tempfile.TemporaryDirectory(dir=project.parent, ignore_cleanup_errors=True) as folder:  # DVC may still write
        copy = _copied(project, Path(folder))
        before = logs_of(copy)
        said = Path(folder) / "said"
        with said.open("wb") as out:
            process = subprocess.Popen(
                ["dvc", "repro"], cwd=copy, env=_environment(), stdout=out, stderr=out, start_new_session=True
            )
            try:
                process.wait(after)
            except subprocess.TimeoutExpired:
                _kill(process)
        stages = [line.split("'")[1] for line in said.read_text().splitlines() if line.startswith("Running stage")]
        failed = _repro(copy)
        by_hand = tuple(name for name in LEFT_EMPTY if failed and _is_empty(copy / name))
        if by_hand:
            for name in by_hand:
                (copy / name).unlink()
            failed = _repro(copy)
        wrong = [f"{path} differs" for path in _different(expected.made, made_in(copy))] if not failed else []
        wrong += [f"{path} was touched" for path in _different(before, logs_of(copy))]
        return Outcome(after, stages[-1] if stages else "before the first stage", by_hand, failed, tuple(wrong))


def _repro(project: Path) -> str:
    """Run `dvc repro`; return what it said if it failed."""
    done = subprocess.run(
        ["dvc", "repro"], cwd=project, env=_environment(), capture_output=True, text=True, timeout=_MOST_SECONDS, check=False
    )  # fmt: skip
    return (done.stdout + done.stderr)[-1500:] if done.returncode else ""


def _is_empty(path: Path) -> bool:
    return path.is_file() and not path.stat().st_size


def made_in(project: Path) -> dict[str, str]:
    """Return the hash of every file below recordings, reports and datasets, those beside them too; what is remembered only by name."""
    return {
        path.relative_to(project).as_posix(): "" if path.name.endswith(_REMEMBERED) else _digest(path)
        for folder in MADE
        for path in sorted((project / folder).rglob("*"))
        if path.is_file()
    }


def logs_of(project: Path) -> dict[str, str]:
    """Return hash and time of change of each log that was dropped into the project."""
    paths = sorted((project / "datasets" / "logs" / "made").iterdir())
    return {path.name: f"{_digest(path)} {path.stat().st_mtime_ns}" for path in paths}


def _different(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    return sorted(name for name in {*one, *other} if one.get(name) != other.get(name))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _copied(project: Path, folder: Path) -> Path:
    return Path(shutil.copytree(project, folder / "project"))


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and all that it started, at once."""
    began = [psutil.Process(process.pid).children(recursive=True)] if psutil.pid_exists(process.pid) else []
    os.killpg(process.pid, signal.SIGKILL)
    for child in (child for children in began for child in children):
        if child.is_running():
            child.kill()
    process.wait()


def _environment() -> dict[str, str]:
    path = f"{BIN}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "GIT_CONFIG_GLOBAL": os.devnull, "OPENBLAS_NUM_THREADS": "1"}


def _run(project: Path, *words: str) -> None:
    done = subprocess.run(
        words, cwd=project, env=_environment(), capture_output=True, text=True, timeout=_MOST_SECONDS, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{words}: {done.stdout}\n{done.stderr}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as folder:
        project = new_project(Path(folder))
        expected = undisturbed(project)
        if unlike := _different(expected.made, undisturbed(project).made):
            print(f"two undisturbed runs differ: {json.dumps(unlike)}")
        print(f"undisturbed: {expected.seconds:.1f} s, {len(expected.made)} files", flush=True)
        for number in range(arguments.kills):
            outcome = kill_once(project, rng.uniform(0.0, expected.seconds), expected)
            outcomes.append(outcome)
            told = outcome.failed or "; ".join(outcome.wrong) or "as undisturbed"
            told += (
                f" (once {', '.join(outcome.by_hand)}, which DVC left empty, was removed)" if outcome.by_hand else ""
            )
            print(f"{number + 1:3d}: killed after {outcome.seconds:5.1f} s in {outcome.stage}: {told}", flush=True)
    print(f"{sum(bool(o.by_hand) for o in outcomes)} times a file that DVC left empty had to be removed.")
    failed, wrong = sum(bool(o.failed) for o in outcomes), sum(bool(o.wrong) for o in outcomes)
    where = Counter(outcome.stage.split("@")[0] for outcome in outcomes)
    print(f"{len(outcomes)} kills ({', '.join(f'{count} in {stage}' for stage, count in where.items())}): ", end="")
    print(f"the next run failed after {failed}, something is not as undisturbed after {wrong}.")
    sys.exit(1 if failed or wrong else 0)


if __name__ == "__main__":
    main()
