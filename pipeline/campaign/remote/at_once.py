"""Waiting for others: many transfers at once, and no longer than is sensible for a machine that does not answer.

Threads are daemons: one that hangs in a library does not keep the program from ending.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from time import monotonic
from typing import TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

# Seconds without any sign from the other side.
PATIENCE = 30.0


def within(function: Callable[[], Result], seconds: float = PATIENCE) -> Result:
    """Return what `function` returns, or raise what it raises.

    Raises
    ------
    TimeoutError
        If it takes longer than `seconds`; it is left alone then.
    """
    found: SimpleQueue[tuple[list[Result], Exception | None]] = SimpleQueue()

    def work() -> None:
        try:
            found.put(([function()], None))
        except Exception as error:
            found.put(([], error))

    threading.Thread(target=work, daemon=True).start()
    try:
        results, error = found.get(timeout=seconds)
    except Empty:
        raise TimeoutError(f"no answer within {seconds:g} s") from None
    if error is not None:
        raise error
    return results[0]


def at_once(
    function: Callable[[Task], None],
    tasks: Sequence[Task],
    threads: int,
    arrived: Callable[[], int] = lambda: 0,
    seconds: float = PATIENCE,
) -> Iterator[tuple[Task, Exception | None]]:
    """Call ``function(task)`` for each task in several threads; yield each task when it is done, or what it raised.

    Parameters
    ----------
    arrived
        Returns how much is there of what is under way; what changes it is a sign that the other side is alive.
    seconds
        After so long without a sign or an end of any task, all that is left is given up with a TimeoutError for each.
        Tasks that are not begun when nobody asks for more are not begun any more.
    """
    waiting, pending = deque(enumerate(tasks)), dict.fromkeys(range(len(tasks)))
    done: SimpleQueue[tuple[int, Exception | None]] = SimpleQueue()

    def work() -> None:
        while True:
            try:
                number, task = waiting.popleft()
            except IndexError:
                return
            try:
                function(task)
                done.put((number, None))
            except Exception as error:
                done.put((number, error))

    for _ in range(min(threads, len(tasks))):
        threading.Thread(target=work, daemon=True).start()
    last, before = monotonic(), arrived()
    try:
        while pending:
            try:
                number, error = done.get(timeout=0.2)
            except Empty:
                if (now := arrived()) != before:
                    last, before = monotonic(), now
                if monotonic() - last < seconds:
                    continue
                for number in pending:
                    yield tasks[number], TimeoutError(f"nothing came for {seconds:g} s")
                return
            del pending[number]
            yield tasks[number], error
            last = monotonic()
    finally:
        waiting.clear()


def size_of(folder: Path) -> int:
    """Return how many bytes the files below a folder hold."""
    total = 0
    for above, _, names in os.walk(folder):
        for name in names:
            with suppress(OSError):  # it has just been moved
                total += Path(above, name).stat().st_size
    return total
