"""What a MAT file holds, as the format sees it: arrays, texts, structs; no meaning yet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


class BrokenFileError(Exception):
    """Bytes that are not what the format says; the text tells what was found where."""


@dataclass(frozen=True)
class Struct:
    """A struct array in MATLAB's order: one dict an element; a plain struct has one."""

    names: tuple[str, ...]
    elements: tuple[dict[str, Value], ...]


@dataclass(frozen=True)
class Unread:
    """A variable of a kind that holds no signals; `kind` says which, for a message."""

    kind: str


Value = np.ndarray | str | Struct | Unread
