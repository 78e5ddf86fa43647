"""Independent work on the machines of a Dask cluster that somebody else started.

Its workers need the same rigfit and the same paths (a shared file system). A worker that dies costs time and nothing else:
what it had done or begun is done again by another one, and a recording appears whole or not at all.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, TypeVar

from pipeline import __version__
from pipeline.campaign.remote.at_once import within
from pipeline.errors import InputError, listing

Result = TypeVar("Result")

VARIABLE = "RIGFIT_ENGINE"
_SCHEME = "dask://"
_EXPECTED = f"expected is {_SCHEME}HOST:PORT of a Dask scheduler, or no {VARIABLE} at all for the cores of this machine"
_SECONDS_TO_ANSWER = 20
_SECONDS_WITHOUT_WORKERS, _GLANCE = 60.0, 2.0
_CUT_OFF = {"CancelledError", "FutureCancelledError", "CommClosedError"}
_AGAIN = "Start what is missing and run the same command again; what was done is not done again."


def on_cluster(
    engine: str,
    function: Callable[..., Result],
    tasks: Sequence[tuple[Any, ...]],
    died: Callable[..., Result] | None = None,
) -> Iterator[Result]:
    """Yield ``function(*task)`` for each task, in order, computed by the workers of a cluster.

    Parameters
    ----------
    engine
        ``dask://HOST:PORT``, the scheduler's address.
    died
        ``died(*task)`` is the result of a task of which one worker after the other dies.

    Raises
    ------
    InputError
        If nobody answers there, no worker is there or left, or a worker has no rigfit or another version of it, or dies of
        a task and there is no `died`.
    """
    with _client(engine) as client:
        _check_workers(engine, client)
        futures = [client.submit(function, *task, pure=False) for task in tasks]
        for at, future in enumerate(futures):
            try:
                yield _result(engine, client, future)
            except Exception as error:
                if type(error).__name__ in _CUT_OFF:
                    raise InputError(f"{VARIABLE}={engine}: the scheduler is gone. {_AGAIN}") from error
                if type(error).__name__ != "KilledWorker":
                    raise
                if died is not None:
                    yield died(*tasks[at])
                    continue
                raise InputError(
                    f"{VARIABLE}={engine}: the workers died one after the other of task {at + 1} of {len(tasks)}. Look into "
                    "their logs: most often they had too little memory."
                ) from error
            future.release()


def _result(engine: str, client: Any, future: Any) -> Any:
    """Wait for a result as long as there are workers."""
    lonely = 0.0
    while lonely < _SECONDS_WITHOUT_WORKERS:
        try:
            return future.result(timeout=_GLANCE)
        except TimeoutError:
            if future.done():  # the work itself ran out of time
                raise
            lonely = 0.0 if client.scheduler_info()["workers"] else lonely + _GLANCE
    raise InputError(
        f"{VARIABLE}={engine}: no worker is left, for {_SECONDS_WITHOUT_WORKERS:g} s now. Look into their logs: most often they "
        f"had too little memory. {_AGAIN}"
    )


@contextmanager
def _client(engine: str) -> Iterator[Any]:
    """Connect to the scheduler."""
    host, _, port = engine.removeprefix(_SCHEME).rstrip("/").rpartition(":")
    if not engine.startswith(_SCHEME) or not host or not port.isdigit():
        raise InputError(f"{VARIABLE}={engine}: {_EXPECTED}.")
    try:
        distributed = import_module("distributed")
    except ImportError as error:
        raise InputError(
            f"{VARIABLE}={engine}: working on a cluster takes the optional extra 'dask' of rigfit ({error}). Install it with: "
            "pip install 'rigfit[dask]'"
        ) from error
    # A lost worker is mended here and no news to the user.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = within(
            lambda: distributed.Client(f"tcp://{host}:{port}", timeout=_SECONDS_TO_ANSWER, set_as_default=False),
            _SECONDS_TO_ANSWER + 5,  # something else than a scheduler may take the call and say nothing
        )
    except OSError as error:
        raise InputError(
            f"{VARIABLE}={engine}: no Dask scheduler answers there within {_SECONDS_TO_ANSWER} s. Start one with 'dask "
            f"scheduler', and workers with 'dask worker {host}:{port}'; {_EXPECTED}."
        ) from error
    with client:
        yield client


def version_here() -> str:
    """Return the version of rigfit where this is called."""
    return __version__


def _check_workers(engine: str, client: Any) -> None:
    """Refuse a cluster without workers, or whose workers would read logs otherwise than this rigfit does."""
    try:
        versions = client.run(version_here)
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"{VARIABLE}={engine}: a worker there cannot import rigfit ({error}). Start the workers from an environment in "
            "which it is installed."
        ) from error
    if not versions:
        raise InputError(f"{VARIABLE}={engine}: this scheduler has no workers. Start some with: dask worker HOST:PORT")
    others = {worker: version for worker, version in versions.items() if version != __version__}
    if others:
        told = listing(f"{worker} has {version}" for worker, version in others.items())
        raise InputError(f"{VARIABLE}={engine}: here is rigfit {__version__}, but {told}. Install the same everywhere.")
