"""What files held when they were last read, so that a thousand logs need not be read again to find the one that is new.

Nothing here is a result: without it everything is read again and comes out the same. So it stands beside the folder of
recordings, not in it.
"""

from __future__ import annotations

import hashlib
import json
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.recording.storage import sha256_of, whole_or_not

# A file that changes twice within the grain of its file system's clock keeps its time: one so young is not believed.
_GRAIN, _COARSE_GRAIN = 0.1, 2.0  # s
_PLAIN_NAME = re.compile(r"[^/\\\0]+\.parquet")
SAVED_EVERY = 5.0  # s
_SHARE = 20  # of the time that may go into that, at most one part


class Seen:
    """Hashes of files, believed while size, inode and times of change are the same; what recordings begin with; and which
    runs were read by an ingest that did not come to its end.

    Parameters
    ----------
    folder
        The recordings that it is about; without, nothing is kept for another time.
    force
        Believe nothing that was seen before.
    """

    def __init__(self, folder: Path | None = None, *, force: bool = False) -> None:
        self._path = _beside(folder) if folder else None
        before = _content(self._path) if self._path and not force else {}
        self._before: Mapping[str, list[Any]] = before.get("hashes", {})
        self._heads_before: Mapping[str, list[Any]] = before.get("heads", {})
        self.unfinished: dict[str, dict[str, Any]] = before.get("unfinished", {})
        self._hashes: dict[str, list[Any]] = {}
        self._heads: dict[str, list[Any]] = {}
        self._due = time.monotonic() + SAVED_EVERY

    def sha256(self, path: Path) -> str:
        """Return the SHA-256 of a file's bytes; it is read only where it is not as it was."""
        known = self._before.get(str(path))
        state = _state(path)
        digest = str(known[-1]) if known and known[:-1] == state else sha256_of(path)
        if state == _state(path):  # else it is still being written
            self.hashed(path, digest)
        return digest

    def hashed(self, path: Path, digest: str) -> None:
        """Note a hash that is known to be that of the file as it is."""
        state = _state(path)
        changed = max(state[2:])
        grain = _GRAIN if changed % 1_000_000_000 else _COARSE_GRAIN
        if time.time_ns() - changed > grain * 1e9:
            self._hashes[str(path)] = [*state, digest]

    def head(self, run: str, entry: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return what was noted of a run's recording, None where the manifest's `entry` of it was another one then."""
        known = self._heads.get(run) or self._heads_before.get(run)
        return known[1] if known and known[0] == entry["key"] else None

    def keep_head(self, run: str, entry: Mapping[str, Any], head: dict[str, Any]) -> None:
        """Note what the recording of a run begins with."""
        self._heads[run] = [entry["key"], head]

    def read(self, run: str, entry: dict[str, Any], head: dict[str, Any]) -> None:
        """Note a run that was read, and keep that now and then: an ingest that is killed goes on where it was."""
        self.keep_head(run, entry, head)
        self.unfinished[run] = entry
        if time.monotonic() > self._due:
            self._write({**self._heads_before, **self._heads}, self.unfinished)

    def save(self) -> None:
        """Keep what was seen when all is done; what was not looked at is forgotten."""
        self._write(self._heads, {})

    def _write(self, heads: Mapping[str, Any], unfinished: Mapping[str, Any]) -> None:
        if self._path is None:
            return
        began = time.monotonic()
        what = {"hashes": self._hashes, "heads": heads, "unfinished": unfinished}
        content = json.dumps(what, separators=(",", ":"))
        with whole_or_not(self._path) as partial:
            partial.write_text(f"{_digest(content)}\n{content}\n", encoding="utf-8")
        ended = time.monotonic()
        self._due = ended + max(SAVED_EVERY, _SHARE * (ended - began))


def forget(folder: Path) -> None:
    """Forget what was seen of a folder of recordings, so that the next ingest looks into every file."""
    _beside(folder).unlink(missing_ok=True)


def are_runs(content: Any) -> bool:
    """Tell whether these are runs as ingest notes them, each recording's file a plain name: others lead out of the folder."""
    return isinstance(content, dict) and all(
        isinstance(entry, dict)
        and isinstance(entry.get("key"), str)
        and isinstance(entry.get("readers"), list)
        and isinstance(entry.get("files"), dict)
        and entry["files"]
        and all(isinstance(reader, str) for reader in entry["readers"])
        and all(_PLAIN_NAME.fullmatch(name) and isinstance(digest, str) for name, digest in entry["files"].items())
        for entry in content.values()
    )


def _beside(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.seen.json")


def _state(path: Path) -> list[int]:
    # The time of change of the entry itself (ctime) can be set by no program that puts the other one back.
    about = path.stat()
    return [about.st_size, about.st_ino, about.st_mtime_ns, about.st_ctime_ns]


def _content(path: Path) -> dict[str, Any]:
    """Return what was kept, nothing where it is not whole as it was written by this version."""
    try:
        digest, content, _ = path.read_text(encoding="utf-8").split("\n")
    except (OSError, ValueError):
        return {}
    if digest != _digest(content):
        return {}
    try:
        kept = json.loads(content)
        states = all(isinstance(state, list) and state for state in kept["hashes"].values())
        heads = all(isinstance(key, str) and isinstance(head, dict) for key, head in kept["heads"].values())
        return dict(kept) if states and heads and are_runs(kept["unfinished"]) else {}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}


def _digest(content: str) -> str:
    return hashlib.sha256(f"{__version__} {content}".encode()).hexdigest()
