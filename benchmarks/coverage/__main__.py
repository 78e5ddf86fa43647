"""Runs coverage studies and prints their tables; see the package."""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from joblib import Parallel, delayed

import benchmarks.coverage as package
from benchmarks.coverage import studies
from benchmarks.coverage.document import FOLDER, write
from benchmarks.coverage.study import Outcome, Study, outcome
from benchmarks.coverage.table import lines, summary, text


def all_studies() -> dict[str, Study]:
    """Return the studies by experiment."""
    found = [import_module(f"{studies.__name__}.{module.name}").STUDY for module in iter_modules(studies.__path__)]
    return {study.experiment.id: study for study in found}


def campaigns(study: Study, case: str, seeds: Sequence[int], jobs: int) -> list[Outcome]:
    """Return what the campaigns of these seeds give, in their order."""
    return list(Parallel(jobs, batch_size=1)(delayed(_one)(study.experiment.id, case, seed) for seed in seeds))


def _one(experiment: str, case: str, seed: int) -> Outcome:
    module = experiment.replace(".", "_")
    return outcome(import_module(f"{studies.__name__}.{module}").STUDY, case, seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=package.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help="as mre.shear; by default all")
    parser.add_argument("--case", action="append", help="one or more; by default all")
    parser.add_argument("--campaigns", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--write", action="store_true", help="keep the numbers in docs/uncertainty/")
    arguments = parser.parse_args()
    known = all_studies()
    for name in arguments.experiments or known:
        if name not in known:
            parser.error(f"no study of '{name}'; there are {', '.join(known)}")
        _run(known[name], arguments)
    if arguments.write:
        write()


def _run(study: Study, arguments: argparse.Namespace) -> None:
    kept = FOLDER / f"{study.experiment.id}.json"
    found = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    for case in arguments.case or study.cases:
        begun = time.perf_counter()
        seeds = range(arguments.first, arguments.first + arguments.campaigns)
        outcomes = campaigns(study, case, seeds, arguments.jobs)
        each = (time.perf_counter() - begun) / len(outcomes)
        told = summary(outcomes)
        print(f"\n{study.experiment.id}, {case}: {study.cases[case].about}")
        print(f"{len(outcomes)} campaigns from seed {arguments.first}, {each:.2g} s each; verdicts {told['verdicts']}")
        for refused in told["refused"]:
            print(f"refused: {refused}")
        print(text(lines(outcomes)), flush=True)
        found[case] = {"about": study.cases[case].about, **told}
    if arguments.write:
        _keep(kept, {case: found[case] for case in study.cases if case in found})


def _keep(path: Path, found: dict[str, object]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
