"""A progress bar on a terminal; nothing elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pipeline.report.words import clean

if TYPE_CHECKING:
    from rich.progress import Progress


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[str], None]]:
    """Yield a function to call with the name of each of the `total` parts that is done."""
    if not sys.stderr.isatty():
        yield lambda _name: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TimeElapsedColumn

    with _shown() as bar:
        bar.columns = (*bar.columns, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        task = bar.add_task(what, total=total)
        yield lambda name: bar.update(task, advance=1, description=clean(f"{what} {name}"))


@contextmanager
def share_done(what: str) -> Iterator[Callable[[float, str], None]]:
    """Yield a function to call with the share of the work that is done, from 0 to 1, and with what is being done.

    Until it is called there is a turning sign only: work whose length nobody tells.
    """
    if not sys.stderr.isatty():
        yield lambda _share, _part: None
        return
    from rich.progress import BarColumn, TaskProgressColumn, TimeElapsedColumn, TimeRemainingColumn

    with _shown() as bar:
        bar.columns = signs = (*bar.columns, TimeElapsedColumn())
        task = bar.add_task(what, total=None)

        def tell(share: float, part: str) -> None:
            bar.columns = (*signs[:-1], BarColumn(), TaskProgressColumn(), signs[-1], TimeRemainingColumn())
            bar.update(task, total=1.0, completed=min(share, 1.0), description=clean(f"{what} {part}"))

        yield tell


def _shown() -> Progress:
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn

    parts = (SpinnerColumn(), TextColumn("{task.description}", markup=False))
    return Progress(*parts, console=Console(stderr=True), transient=True)
