"""The next block while the last one is worked on: one thread ahead, one block in wait, so that memory stays bounded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")


def ahead(items: Iterable[Item]) -> Iterator[Item]:
    """Yield `items` in order; each is made in another thread while the one before it is used."""
    making = iter(items)
    end = object()
    with ThreadPoolExecutor(1) as worker:
        coming = worker.submit(next, making, end)
        while (item := coming.result()) is not end:
            coming = worker.submit(next, making, end)
            yield item  # type: ignore[misc]
