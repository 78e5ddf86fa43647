"""Logs from elsewhere -> a folder here that holds the same, incrementally: what did not change is not fetched again.

A log appears whole or not at all. What was fetched is noted beside the folder as it goes, so that an interrupted fetch goes on.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from time import monotonic

from pipeline.campaign.remote import faults
from pipeline.campaign.remote.at_once import at_once, size_of
from pipeline.campaign.remote.local_names import local_names
from pipeline.campaign.remote.named import Progress
from pipeline.campaign.remote.source import RemoteLog, Source, refuse_overlap
from pipeline.errors import InputError, counted, listing
from pipeline.recording.storage import sha256_of, whole_or_not

# After so many logs that cannot be fetched the others are not tried.
_ENOUGH_FAILED = 8
# Seconds between two notes of what was fetched.
_NOTE_EVERY = 1.0


@dataclass(frozen=True)
class Mirrored:
    """What a fetch has done: paths below the folder.

    `foreign` did not come from the source; of `unmarked` it tells neither hash nor time, so that they are fetched each time.
    """

    fetched: Sequence[str]
    removed: Sequence[str]
    kept: Sequence[str]
    foreign: Sequence[str]
    unmarked: Sequence[str]


@dataclass(frozen=True)
class _Copy:
    """A log as it was fetched: what its source told of it then, its hash, and its stamps here (size, mtime, ctime)."""

    mark: str
    size: int | None
    sha256: str
    stamps: tuple[int, int, int]


def mirror(source: Source, folder: Path, progress: Progress) -> Mirrored:
    """Make `folder` hold the logs of `source`; what was fetched is noted in the hidden ``.<folder>.json`` beside it.

    Logs that are gone at the source are removed here, unless they did not come from there; a copy that was altered
    here is fetched again.

    Parameters
    ----------
    progress
        Called with the number of logs to fetch.

    Raises
    ------
    InputError
        If the source cannot be listed or has no logs (nothing is changed then), or a log cannot be fetched; the others are
        fetched nevertheless, up to where it is clear that nothing comes any more.
    """
    refuse_overlap(source, folder)
    logs = source.logs()
    names = local_names([log.name for log in logs])
    here = {names[log.name]: log for log in logs}
    notes = _Notes(folder.with_name(f".{folder.name}.json"), source.shown)
    wanted = [name for name, log in here.items() if not notes.is_current(folder, name, log)]
    failed: dict[str, InputError] = {}
    with _staging(folder) as staging, progress(len(wanted)) as step:
        places = {name: staging / str(number) for number, name in enumerate(wanted)}

        def fetch(name: str) -> None:
            source.fetch(here[name], places[name])

        try:
            for name, error in at_once(fetch, wanted, source.threads, lambda: size_of(staging)):
                if error is not None:
                    failed[name] = faults.said(error, source.url, here[name].name)
                    if len(failed) >= _ENOUGH_FAILED:
                        break
                    continue
                notes.add(name, here[name], _placed(places[name], folder, name, notes.hash_of(name)), folder / name)
                step(name)
        finally:
            notes.write()
    if failed:
        raise InputError(_told(failed, len(wanted)))
    removed = [name for name in notes.names() if name not in here]
    for name in removed:
        if _is_own(folder, name):
            (folder / name).unlink()
        notes.forget(name)
    notes.write()
    _without_empty_folders(folder)
    present = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    foreign = [name for name in present if name not in here]
    kept = [name for name in here if name not in places]
    return Mirrored(wanted, removed, kept, foreign, [name for name, log in here.items() if not log.mark])


class _Notes:
    """What is known of the logs that were fetched; kept in a file that is rewritten as a whole."""

    def __init__(self, path: Path, origin: str) -> None:
        self._path, self._origin, self._changed, self._written = path, origin, False, monotonic()
        self._copies: dict[str, _Copy] = {}
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            for name, entry in content["logs"].items():
                copy = _Copy(entry["mark"], entry["size"], entry["sha256"], tuple(entry["stamps"]))
                # Of another place the same mark may mean another content.
                self._copies[name] = copy if content["origin"] == origin else _Copy("", None, copy.sha256, copy.stamps)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            self._copies = {}

    def names(self) -> list[str]:
        return list(self._copies)

    def hash_of(self, name: str) -> str:
        return self._copies[name].sha256 if name in self._copies else ""

    def is_current(self, folder: Path, name: str, log: RemoteLog) -> bool:
        """Tell whether the copy here is the log that is there now."""
        copy = self._copies.get(name)
        if copy is None or not log.mark or (copy.mark, copy.size) != (log.mark, log.size):
            return False
        if not _is_own(folder, name):
            return False
        path = folder / name
        if _stamps(path) != copy.stamps:
            if sha256_of(path) != copy.sha256:
                return False
            self.add(name, log, copy.sha256, path)
        return True

    def add(self, name: str, log: RemoteLog, sha256: str, path: Path) -> None:
        self._copies[name] = _Copy(log.mark, log.size, sha256, _stamps(path))
        self._changed = True
        if monotonic() - self._written > _NOTE_EVERY:
            self.write()

    def forget(self, name: str) -> None:
        del self._copies[name]
        self._changed = True

    def write(self) -> None:
        if not self._changed:
            return
        logs = {name: asdict(self._copies[name]) for name in sorted(self._copies)}
        with whole_or_not(self._path) as partial:
            partial.write_text(json.dumps({"origin": self._origin, "logs": logs}, indent=1) + "\n", encoding="utf-8")
        self._changed, self._written = False, monotonic()


def _stamps(path: Path) -> tuple[int, int, int]:
    about = path.stat()
    return about.st_size, about.st_mtime_ns, about.st_ctime_ns


@contextmanager
def _staging(folder: Path) -> Iterator[Path]:
    """Give a hidden folder for what is not whole yet; what a killed fetch left in it goes."""
    path = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir(parents=True)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def _placed(fetched: Path, folder: Path, name: str, known: str) -> str:
    """Move a log that was fetched to its place, unless it is there already as it came; return its hash."""
    target, digest = folder / name, sha256_of(fetched)
    for above in _between(folder, name):
        if above.is_symlink() or above.is_file():
            above.unlink()  # a log was called so before
    if target.is_dir() and not target.is_symlink():
        shutil.rmtree(target)  # and here a folder of logs
    if not (digest == known and _is_own(folder, name) and sha256_of(target) == digest):
        target.parent.mkdir(parents=True, exist_ok=True)
        fetched.replace(target)
    return digest


def _between(folder: Path, name: str) -> Iterator[Path]:
    """Yield the folders below `folder` that lead to `name`, the outermost first."""
    parts = name.split("/")
    for count in range(1, len(parts)):
        yield folder.joinpath(*parts[:count])


def _is_own(folder: Path, name: str) -> bool:
    """Tell whether `name` is a file below `folder` itself, not what a link leads to."""
    path = folder / name
    return path.is_file() and not any(part.is_symlink() for part in (*_between(folder, name), path))


def _without_empty_folders(folder: Path) -> None:
    for path in sorted((path for path in folder.rglob("*") if path.is_dir() and not path.is_symlink()), reverse=True):
        if not any(path.iterdir()):
            path.rmdir()


def _told(failed: Mapping[str, InputError], wanted: int) -> str:
    """Return one message for the logs that could not be fetched."""
    first = next(iter(failed))
    message = str(failed[first])
    if len(failed) >= _ENOUGH_FAILED:
        return f"{message} {len(failed)} of {counted(wanted, 'log')} failed so far; the rest was not tried."
    others = [name for name in failed if name != first]
    return f"{message} Not fetched either: {listing(others, 8)}." if others else message
