"""Libraries of formats that not every laboratory meets: imported when a log asks for them."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

from pipeline.errors import InputError


def library(module: str, extra: str, path: Path, kind: str) -> ModuleType:
    """Return a library that reads logs of a kind.

    Parameters
    ----------
    module, extra
        What is imported, and the optional extra of rigfit that installs it.
    path, kind
        The log that needs it, and what that is, for the message.

    Raises
    ------
    InputError
        If it is not installed; the text holds the line that installs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise InputError(
            f"{path}: is {kind}; reading it takes the optional extra '{extra}' of rigfit ({error}). Install it with: "
            f"pip install 'rigfit[{extra}]'"
        ) from error
