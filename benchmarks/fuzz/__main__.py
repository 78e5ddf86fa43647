"""Spoil good inputs and look whether rigfit stays sound: only InputError, within 10 s and 1 GB, nothing written elsewhere.

    python -m benchmarks.fuzz TARGET... [--seconds 60] [--seed 1] [--keep FOLDER]

TARGET is csv, mcap, mat, bag, db3, hdf5, columnar, recipe, runs, params, findings, manifest, seen, recording, or all. The
inputs are guided by the lines that they reach: by atheris where it is installed, else by a loop of our own. What broke
stays in the folder of --keep with a line that says what happened; the exit status is then 1.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import psutil

from benchmarks.fuzz import guided
from benchmarks.fuzz.guarded import MOST_MEGABYTES, MOST_SECONDS
from benchmarks.fuzz.targets import TARGETS

_GLANCE = 0.1
# Loading what is loaded at first use, and compiling it, is no fault of an input.
_SECONDS_TO_START = 120.0


def fuzz(name: str, seconds: float, seed: int, keep: Path) -> tuple[Counter[str], list[str]]:
    """Fuzz one target in processes that are watched; return what was counted, and what broke."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as folder:
        state = Path(folder)
        total: Counter[str] = Counter()
        until = time.monotonic() + seconds
        restarts = 0
        while restarts == 0 or until - time.monotonic() > 1:
            total += _watched(name, state, until, seed + restarts)
            restarts += 1
        broke = []
        for path in sorted(state.glob("*.txt")):
            broke.append(f"{path.stem}: {path.read_text(errors='replace').strip()}")
            keep.mkdir(parents=True, exist_ok=True)
            for kept in (path, path.with_suffix(".bin")):
                (keep / kept.name).write_bytes(kept.read_bytes())
    return total, broke


def _watched(name: str, state: Path, until: float, seed: int) -> Counter[str]:
    """Run one process until time is over or it has to be killed; what killed it is kept."""
    current, counts = state / "current", state / "counts.json"
    for path in (current, counts):
        path.unlink(missing_ok=True)
    words = [
        sys.executable,
        "-m",
        "benchmarks.fuzz",
        name,
        "--into",
        str(state),
        "--seconds",
        f"{until - time.monotonic():.1f}",
    ]
    process = subprocess.Popen([*words, "--seed", str(seed)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    began, why = time.monotonic(), ""
    watched = psutil.Process(process.pid)
    while process.poll() is None and not why:
        time.sleep(_GLANCE)
        try:
            megabytes = watched.memory_info().rss / 1e6
        except psutil.Error:
            break
        if counts.exists() and time.time() - current.stat().st_mtime > MOST_SECONDS:
            why = f"took more than {MOST_SECONDS:g} s"
        elif megabytes > 2 * MOST_MEGABYTES:
            why = f"took more than {2 * MOST_MEGABYTES:g} MB"
        elif not counts.exists() and time.monotonic() - began > _SECONDS_TO_START:
            raise RuntimeError(f"{name}: the good inputs themselves are not read in time")
    process.kill() if why else None
    said = (process.communicate()[1] or b"").decode("utf-8", "replace")
    if not why and process.returncode:
        why = f"ended with status {process.returncode}: {' '.join(said.split())[-300:]}"
    if why and current.exists():
        guided.keep(state, name, current.read_bytes(), why)
    elif why:
        raise RuntimeError(f"{name}: {why}")
    return Counter(json.loads(counts.read_text())) if counts.exists() else Counter()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="+", choices=[*TARGETS, "all"], metavar="TARGET")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path("fuzz-broken"), help="folder for what broke something")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.into:
        guided.run(arguments.targets[0], arguments.into, arguments.seconds, arguments.seed)
        return
    print(f"guided by {guided.engine()}; inputs of each target for {arguments.seconds:g} s")
    failed = False
    for name in TARGETS if "all" in arguments.targets else arguments.targets:
        counts, broke = fuzz(name, arguments.seconds, arguments.seed, arguments.keep)
        tried = sum(counts[outcome] for outcome in ("read", "refused", "broke"))
        print(
            f"{name:9s} {tried:7d} tried: {counts['read']} read, {counts['refused']} refused, {len(broke)} kinds broke",
            flush=True,
        )
        for line in broke:
            print(f"    {line}", flush=True)
        failed = failed or bool(broke)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
