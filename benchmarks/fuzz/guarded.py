"""One process that tries inputs, with its limits: seconds and memory of each, and no file opened outside its folder.

The process writes down what it is about to try, so that what kills or hangs it is known.
"""

from __future__ import annotations

import os
import shutil
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from benchmarks.fuzz.targets import Target, run_quietly

MOST_MEGABYTES = 1000.0
MOST_SECONDS = 10.0
_WRITES = {
    "os.remove": 0,
    "os.rename": 1,
    "os.mkdir": 0,
    "os.rmdir": 0,
    "os.link": 1,
    "os.symlink": 1,
    "os.truncate": 0,
}
_STARTS = ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "os.spawn", "socket.connect")
_FLAGS = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


class OutsideError(Exception):
    """Something was written outside the folder, or a program started."""


class Guard:
    """Refuses writes outside `folder` while it is `closed`; audit hooks cannot be taken away again."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.closed = str(folder.resolve()), False
        sys.addaudithook(self._heard)

    def _heard(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.closed:
            return
        if event.startswith(_STARTS):
            raise OutsideError(f"{event} {arguments}")
        if event == "open":
            path, _, flags = arguments
            if isinstance(path, str | bytes) and isinstance(flags, int) and flags & _FLAGS:
                self._refuse(event, path)
        elif event in _WRITES:
            self._refuse(event, arguments[_WRITES[event]])

    def _refuse(self, event: str, path: Any) -> None:
        place = str((Path.cwd() / os.fsdecode(path)).resolve())
        if not place.startswith(self.folder) and "__pycache__" not in place and place != os.devnull:
            raise OutsideError(f"{event} {place}")


@contextmanager
def only_within(guard: Guard) -> Iterator[None]:
    guard.closed = True
    try:
        yield
    finally:
        guard.closed = False


def tried(target: Target, data: bytes, folder: Path, guard: Guard) -> tuple[str, str]:
    """Return "read", "refused" or "broke", and of the last what happened and where; leaves `folder` empty."""
    _forget_peak()
    try:
        with only_within(guard):
            outcome = run_quietly(target, data, folder)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return "broke", _told(error)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
    if (peak := peak_megabytes()) > MOST_MEGABYTES:
        return "broke", f"took {peak:.0f} MB"
    return outcome, ""


def _told(error: BaseException) -> str:
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "/pipeline/" in f.filename]
    last = frames[-1] if frames else traceback.extract_tb(error.__traceback__)[-1]
    said = " ".join(str(error).split())[:120]
    return f"{type(error).__name__} at {Path(last.filename).name}:{last.lineno} ({said})"


def _forget_peak() -> None:
    with suppress(OSError), Path("/proc/self/clear_refs").open("w") as file:
        file.write("5")


def peak_megabytes() -> float:
    """Return the peak memory of this process since it was last forgotten."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next((float(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM")), 0.0)
