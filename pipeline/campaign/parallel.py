"""Independent work on runs: on the local cores through joblib, one after the other where it is little, or on a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

from pipeline.campaign.cluster import VARIABLE, on_cluster

Result = TypeVar("Result")

# Starting worker processes costs about a second each; for less work than this it does not pay.
WORTH_WORKERS = 2.0


def in_parallel(function: Callable[..., Result], tasks: Sequence[tuple[Any, ...]], seconds: float) -> Iterable[Result]:
    """Yield ``function(*task)`` for each task, in order; what it and its arguments must be is said at `Each`.

    Parameters
    ----------
    seconds
        About what all tasks cost one core, which decides whether worker processes are worth their start.
    """
    engine = os.environ.get(VARIABLE, "").strip()
    if engine and tasks:
        yield from on_cluster(engine, function, tasks)
        return
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if cores == 1 or len(tasks) < 2 or seconds < WORTH_WORKERS:
        for task in tasks:
            yield function(*task)
        return
    from joblib import Parallel, delayed

    yield from Parallel(n_jobs=min(cores, len(tasks)), return_as="generator")(
        delayed(function)(*task) for task in tasks
    )
