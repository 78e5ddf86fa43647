"""What a log from elsewhere is called here: as there, as far as a file below one folder can be called so.

Object stores have keys, not paths: ``../x``, ``a//b``, or ``a.csv`` beside ``a.csv/b.csv`` are names like others there.
What would lead out of the folder, or cannot be a file, is written as in URLs: ``%2E%2E``, ``%2F``, ``%5C``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence


def local_names(names: Sequence[str]) -> dict[str, str]:
    r"""Return the path of each name below the folder, each another one; the same names always give the same paths.

    >>> local_names(["r1.csv", "../r1.csv", "a//b.csv", "c.csv", "c.csv/d.csv"])["../r1.csv"]
    '%2E%2E/r1.csv'
    """
    plain = {name: _plain(name) for name in sorted(names)}
    files = set(plain.values())
    found: dict[str, str] = {}
    used: set[str] = set()
    for name, path in plain.items():
        path = _beside_files(path, files)
        while path in used:
            folder, mark, last = path.rpartition("/")
            path = f"{folder}{mark}%{last}"
        used.add(path)
        found[name] = path
    return found


def _plain(name: str) -> str:
    """Return a name whose parts are all there and are names."""
    name = re.sub(r"/(?=/|$)|^/", "%2F", name)
    parts = [part.replace(".", "%2E") if part in (".", "..") else part for part in name.split("/")]
    return re.sub(r"[\\\x00-\x1f\x7f]", lambda match: f"%{ord(match[0]):02X}", "/".join(parts))


def _beside_files(path: str, files: set[str]) -> str:
    """Return a path none of whose folders is a file too."""
    parts = path.split("/")
    whole = parts[0]
    for part in parts[1:]:
        whole = f"{whole}%2F{part}" if whole in files else f"{whole}/{part}"
    return whole
