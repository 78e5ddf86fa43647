"""Files that belong together appear together: they are written beside the old ones, then all take their places.

Whatever stops the writing (a full disk, Ctrl-C, a kill), the old files stay as they are.
"""

from __future__ import annotations

import os
import shutil
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

_NEW, _OLD, _DONE = ".new.partial", ".old.partial", ".done.partial"
STOPPING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def together(folder: Path) -> Iterator[Path]:
    """Give an empty folder inside `folder`; at the end, what it holds replaces what bears the same names there.

    Where the block or the replacing fails, `folder` is as it was before; other files in it are never touched.
    A replacing that was cut by a kill is undone by the next call.
    """
    made = not folder.exists()
    fresh = folder / _NEW
    _undo_a_cut_swap(folder)
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    try:
        yield fresh
        with undisturbed():
            _swap(folder, fresh)
    finally:
        with undisturbed():
            shutil.rmtree(fresh, ignore_errors=True)
            if made and not any(folder.iterdir()):
                folder.rmdir()


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold back signals that would stop the program until the block has ended."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[tuple[int, FrameType | None]] = []
    before = {number: signal.signal(number, lambda n, frame: came.append((n, frame))) for number in STOPPING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        for number, frame in came:
            handler = before[signal.Signals(number)]
            if callable(handler):
                handler(number, frame)
            elif handler == signal.SIG_DFL:
                os.kill(os.getpid(), number)


def _swap(folder: Path, fresh: Path) -> None:
    """Move what `fresh` holds into `folder`, what stood there into `_OLD`; back again where one move fails."""
    old = folder / _OLD
    old.mkdir()
    moved: list[Path] = []
    try:
        for path in sorted(fresh.iterdir()):
            place = folder / path.name
            if place.exists() or place.is_symlink():
                place.rename(old / path.name)
            moved.append(place)
            path.rename(place)
    except OSError:
        for place in moved:
            _remove(place)
        _undo_a_cut_swap(folder)
        raise
    old.rename(folder / _DONE)
    shutil.rmtree(folder / _DONE, ignore_errors=True)


def _undo_a_cut_swap(folder: Path) -> None:
    shutil.rmtree(folder / _DONE, ignore_errors=True)
    old = folder / _OLD
    if not old.is_dir():
        return
    for path in old.iterdir():
        _remove(folder / path.name)
        path.rename(folder / path.name)
    old.rmdir()


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
