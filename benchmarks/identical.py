"""Are results the same to the last bit, on one core and on two, and when all is done once more?

    python -m benchmarks.identical [CAMPAIGN...]

Each example campaign (all without a name, in the order of params.yaml) is synthesised in a project of its own and then taken
from logs to report three times: twice on all cores, once on one. Told is every file of recordings and results that differs.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from ruamel.yaml import YAML

ROOT = Path(__file__).parents[1]
_MOST_SECONDS = 900
_REMEMBERED = (".lock", ".seen.json")


def differing(campaigns: Sequence[str], folder: Path) -> dict[str, list[str]]:
    """Return by campaign the files that are not the same three times."""
    params = YAML(typ="safe").load(ROOT / "params.yaml")
    wanted = set(campaigns) | {use["of"] for use in params["uses"] if use["campaign"] in campaigns}
    for name in ("dvc.yaml", "params.yaml"):
        shutil.copy(ROOT / name, folder / name)
    shutil.copytree(ROOT / "recipes", folder / "recipes")
    found: dict[str, list[str]] = {}
    for name in (name for name in params["campaigns"] if name in wanted):
        start = time.perf_counter()
        _rigfit(folder, "synthesize", name)
        times = [_made(folder, name, cores) for cores in (None, None, 1)]
        names = sorted({path for made in times for path in made})
        found[name] = [path for path in names if len({made.get(path) for made in times}) > 1]
        told = ", ".join(found[name]) or f"{len(names)} files the same"
        print(f"{name:20s} {time.perf_counter() - start:6.1f} s: {told}", flush=True)
        shutil.rmtree(folder / "datasets" / name)
    return found


def _made(folder: Path, name: str, cores: int | None) -> dict[str, str]:
    """Go from logs to report; return the hashes of what that makes."""
    places = [folder / "recordings" / name, folder / "reports" / name]
    for place in places:
        shutil.rmtree(place, ignore_errors=True)
    for words in (("ingest", name, "--force"), ("identify", name, "--go-on"), ("report", name)):
        _rigfit(folder, *words, cores=cores)
    paths = [path for place in places for path in sorted(place.rglob("*")) if path.is_file()]
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in paths
        if not path.name.endswith(_REMEMBERED)
    }


def _rigfit(folder: Path, *words: str, cores: int | None = None) -> None:
    some = sorted(os.sched_getaffinity(0))[:cores]
    done = subprocess.run(
        [sys.executable, "-m", "pipeline.cli", *words],
        cwd=folder,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: os.sched_setaffinity(0, some),
        capture_output=True,
        text=True,
        timeout=_MOST_SECONDS,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"rigfit {' '.join(words)}: {done.stderr[-2000:]}")


def main() -> None:
    known = YAML(typ="safe").load(ROOT / "params.yaml")["campaigns"]
    unknown = sorted(set(sys.argv[1:]) - set(known))
    if unknown:
        sys.exit(f"no such example: {', '.join(unknown)}; there are {', '.join(known)}")
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as folder:
        found = differing(sys.argv[1:] or known, Path(folder))
    sys.exit(1 if any(found.values()) else 0)


if __name__ == "__main__":
    main()
