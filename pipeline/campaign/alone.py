"""One rigfit at a time on one campaign: two that write the same folder would take each other's files away."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.errors import InputError


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Work on `folder` alone; the lock stands beside it and goes with the process, however that ends.

    A file system without locks is worked on without one.

    Raises
    ------
    InputError
        If another rigfit is at work there.
    """
    from filelock import FileLock, Timeout

    folder.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder.with_name(f".{folder.name}.lock"))
    try:
        lock.acquire(blocking=False)
    except Timeout as error:
        raise InputError(
            f"{folder}: another rigfit is at work there. Wait until it has ended, and run the same command again."
        ) from error
    except NotImplementedError:
        yield
        return
    try:
        yield
    finally:
        lock.release()
