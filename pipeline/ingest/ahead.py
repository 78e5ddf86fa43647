"""A file that may end or hang the library for its format is tried in a process of its own first.

What the library only complains about is left to the reader, which says it in words.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable

_MOST_SECONDS = 8


def fatal(work: Callable[[], object]) -> str | None:
    """Return what `work()` does to the process that does it, as part of a sentence; None where it ends, however.

    Where processes cannot be split off safely it is not tried.
    """
    if not hasattr(os, "fork") or threading.active_count() > 1:
        return None
    pid = os.fork()
    if pid == 0:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)  # ends the process even within compiled code
        signal.alarm(_MOST_SECONDS)
        try:
            work()
        finally:
            os._exit(0)
    _, status = os.waitpid(pid, 0)
    if not os.WIFSIGNALED(status):
        return None
    came = os.WTERMSIG(status)
    return "does not come to an end" if came == signal.SIGALRM else f"is ended by signal {came}"
