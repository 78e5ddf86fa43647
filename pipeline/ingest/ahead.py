"""A file that may end or hang the library for its format is tried in a process of its own first.

What the library only complains about is left to the reader, which says it in words.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path

from pipeline.errors import InputError

_MOST_SECONDS = 8
# 1 GB, and 1 GB of addresses that an allocator may reserve and not use.
_MOST_BYTES = 2 << 30
_NO_MEMORY = 3


def fatal(work: Callable[[], object]) -> str | None:
    """Return what `work()` does to the process that does it, as part of a sentence; None where it ends, however.

    It must end within 8 s and need no more than 1 GB. Where processes cannot be split off safely it is not tried.
    """
    if not hasattr(os, "fork") or threading.active_count() > 1:
        return None
    pid = os.fork()
    if pid == 0:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)  # ends the process even within compiled code
        signal.alarm(_MOST_SECONDS)
        faulthandler.disable()
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # a library's last words would stand among ours
        _limit_memory()
        ended = 0
        try:
            work()
        except MemoryError:
            ended = _NO_MEMORY
        finally:
            os._exit(ended)
    _, status = os.waitpid(pid, 0)
    if not os.WIFSIGNALED(status):
        return "asks for more than 1 GB" if os.waitstatus_to_exitcode(status) == _NO_MEMORY else None
    came = os.WTERMSIG(status)
    return "does not come to an end" if came == signal.SIGALRM else f"is ended by signal {came}"


def _limit_memory() -> None:
    """Let this process take so much beside what it has, where the system tells that."""
    import resource

    told = Path("/proc/self/statm")
    if not told.exists():
        return
    wanted = int(told.read_text().split()[0]) * resource.getpagesize() + _MOST_BYTES
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (wanted if most == resource.RLIM_INFINITY else min(wanted, most), most))


def refuse_fatal(path: Path, kind: str, work: Callable[[], object]) -> None:
    """Refuse a damaged file, of this `kind` of format, that its library stumbles over without a word.

    Raises
    ------
    InputError
        If the work ends the process that does it, hangs, or wants more memory than any log does.
    """
    if what := fatal(work):
        raise InputError(
            f"{path}: this {kind} file is broken: a program that reads it {what}. Copy it or write it again."
        )
