"""What is said of a file that is called as logs of a kind are, but is none."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import InputError

_SHOWN = 16


def misnamed(path: Path, kind: str) -> InputError:
    """Return the error for a file at `path` that is no `kind`, for example ``TDMS file``."""
    with path.open("rb") as file:
        head = file.read(_SHOWN)
    return InputError(
        f"{path}: is called {path.suffix or path.name}, but is no {kind} (it begins with {head!r}). If it holds another kind of log, "
        "give it that kind's suffix; else record or copy it again."
    )
