"""The one exception that means "the input, the recipe or the call is wrong".

Everything a user can cause ends here: the command line prints the text as one plain paragraph and
exits with status 2. Any other exception is a defect of rigfit.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(Exception):
    """Something the user can mend.

    The text says what was found, where (file, channel, line or time), what was expected and what to
    do; it is shown as it stands.
    """


class EmptyLogError(InputError):
    """A log without any rows: as one of a run's several tables it can be done without."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ``" Did you mean 'x'?"`` for the known word most like `word`, or an empty text."""
    known = list(known)
    by_lower = {name.lower(): name for name in known}
    match = get_close_matches(word.lower(), by_lower, n=1, cutoff=0.6)
    return f" Did you mean '{by_lower[match[0]]}'?" if match else ""


def listing(names: Iterable[str], limit: int = 20) -> str:
    """Join names for a message; beyond `limit` only their number is told."""
    names = list(names)
    if not names:
        return "none"
    shown = ", ".join(names[:limit])
    return shown if len(names) <= limit else f"{shown} and {len(names) - limit} more"


def counted(n: int, thing: str) -> str:
    """Return ``"1 row"``, ``"2 rows"`` for a message."""
    return f"{n} {thing}" if n == 1 else f"{n} {thing}s"
