"""Waiting for others: many transfers at once, and no longer than is sensible for a machine that does not answer.

Threads are daemons: one that hangs in a library does not keep the program from ending.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
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
    function: Callable[[Task, Callable[[], None]], None], tasks: Sequence[Task], threads: int, seconds: float = PATIENCE
) -> Iterator[tuple[Task, Exception | None]]:
    """Call ``function(task, sign)`` for each task in several threads; yield each task when it is done, or what it raised.

    Parameters
    ----------
    function
        It calls ``sign()`` whenever something has come.
    seconds
        After so long without a sign or an end of any task, all that is left is given up with a TimeoutError for each.
        Tasks that are not begun when nobody asks for more are not begun any more.
    """
    waiting, open_ = deque(enumerate(tasks)), dict.fromkeys(range(len(tasks)))
    done: SimpleQueue[tuple[int, Exception | None]] = SimpleQueue()
    last = [monotonic()]

    def sign() -> None:
        last[0] = monotonic()

    def work() -> None:
        while True:
            try:
                number, task = waiting.popleft()
            except IndexError:
                return
            try:
                function(task, sign)
                done.put((number, None))
            except Exception as error:
                done.put((number, error))

    for _ in range(min(threads, len(tasks))):
        threading.Thread(target=work, daemon=True).start()
    try:
        while open_:
            try:
                number, error = done.get(timeout=0.5)
            except Empty:
                if monotonic() - last[0] < seconds:
                    continue
                for number in open_:
                    yield tasks[number], TimeoutError(f"nothing came for {seconds:g} s")
                return
            sign()
            del open_[number]
            yield tasks[number], error
    finally:
        waiting.clear()
