"""Independent work on runs: on the local cores through joblib, one after the other where it is little, or on a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from typing import Any, TypeVar

from pipeline.campaign.cluster import VARIABLE, on_cluster
from pipeline.errors import InputError

Result = TypeVar("Result")

# Starting worker processes costs about a second each; for less work than this it does not pay.
WORTH_WORKERS = 2.0


def in_parallel(
    function: Callable[..., Result],
    tasks: Sequence[tuple[Any, ...]],
    seconds: float,
    died: Callable[..., Result] | None = None,
) -> Iterable[Result]:
    """Yield ``function(*task)`` for each task, in order; what it and its arguments must be is said at `Each`.

    Parameters
    ----------
    seconds
        About what all tasks cost one core, which decides whether worker processes are worth their start.
    died
        ``died(*task)`` is the result of a task of which worker processes die: a library that crashes of a damaged file,
        too little memory. The others are done all the same.

    Raises
    ------
    InputError
        Where a worker dies and there is no `died`.
    """
    engine = os.environ.get(VARIABLE, "").strip()
    if engine and tasks:
        yield from on_cluster(engine, function, tasks, died)
        return
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if cores == 1 or len(tasks) < 2 or seconds < WORTH_WORKERS:
        for task in tasks:
            yield function(*task)
        return
    from joblib import Parallel, delayed

    while tasks:
        workers = min(cores, len(tasks))
        done = 0
        try:
            for result in Parallel(workers, return_as="generator")(delayed(function)(*task) for task in tasks):
                done += 1
                yield result
        except BrokenExecutor:
            # Which one it was is not told: those that may have been under way are done alone.
            suspects = tasks[done : done + 2 * workers]
            yield from _one_by_one(function, suspects, died)
            done += len(suspects)
        tasks = tasks[done:]


def _one_by_one(
    function: Callable[..., Result], tasks: Sequence[tuple[Any, ...]], died: Callable[..., Result] | None
) -> Iterator[Result]:
    """Do tasks one after the other in a process that each may take along."""
    from joblib.externals.loky import ProcessPoolExecutor

    process = ProcessPoolExecutor(1)
    try:
        for task in tasks:
            try:
                yield process.submit(function, *task).result()
            except BrokenExecutor as error:
                if died is None:
                    raise InputError(
                        "a worker process was killed in the middle of its work, most often for lack of memory. Close other "
                        "programs, or use fewer cores ('taskset -c 0 rigfit ...' uses one), and run the same command again."
                    ) from error
                process = ProcessPoolExecutor(1)
                yield died(*task)
    finally:
        process.shutdown()
