"""Logs that are named on the command line: paths as they are, URLs fetched to a temporary folder.

A log keeps the URL that it came from: messages, findings and reports show it, never the temporary path.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePath

from pipeline.campaign import logs, runs_table
from pipeline.campaign.logs import RUNS_TABLE
from pipeline.campaign.remote.urls import is_url
from pipeline.campaign.runs_table import RunsTable
from pipeline.errors import InputError, listing
from pipeline.rigs.experiment import Experiment

# Shows how far a known number of steps is; yields what is to be called with each that is done.
Progress = Callable[[int], AbstractContextManager[Callable[[str], None]]]


@dataclass(frozen=True)
class Named:
    """Logs of the command line; `origins` says of those that were fetched whence, `tables` are runs.csv that came along."""

    paths: Sequence[Path]
    origins: Mapping[Path, str]
    tables: Sequence[Path] = ()

    def shown(self, path: Path) -> str:
        """Return what a log is called in messages."""
        return self.origins.get(path, str(path))

    def as_shown(self, message: str) -> str:
        """Return a message with URLs in the place of temporary paths."""
        for path in sorted(self.origins, key=lambda path: len(str(path)), reverse=True):
            message = message.replace(str(path), self.origins[path])
        return message

    def table(self, named: Path | None, experiment: Experiment) -> RunsTable | None:
        """Return the conditions per run: of the file that is `named` for them, else of a runs.csv that came with a URL.

        Raises
        ------
        InputError
            If it cannot be read, or came with more than one URL.
        """
        if named is not None:
            return runs_table.read(named, experiment, str(named))
        if len(self.tables) > 1:
            urls = listing(self.origins[path] for path in self.tables)
            raise InputError(
                f"{urls}: several tables of conditions came with the logs; name the one that holds with --runs."
            )
        return next((runs_table.read(path, experiment, self.origins[path]) for path in self.tables), None)


@contextmanager
def named(words: Sequence[str], progress: Progress) -> Iterator[Named]:
    """Give the logs that `words` name, for as long as the block lasts.

    Parameters
    ----------
    progress
        Called with the number of logs to fetch of each URL.

    Raises
    ------
    InputError
        If a path is no file, or a URL cannot be read; and what the block raises, with URLs for temporary paths.
    """
    if not any(is_url(word) for word in words):
        yield Named(logs.as_given([Path(word) for word in words]), {})
        return
    with tempfile.TemporaryDirectory(prefix="rigfit-", ignore_cleanup_errors=True) as folder:
        paths: list[Path] = []
        origins: dict[Path, str] = {}
        for number, word in enumerate(dict.fromkeys(words)):
            if is_url(word):
                fetched = _fetched(word, Path(folder).resolve() / str(number), progress)
                origins.update(fetched)
                paths += fetched
            else:
                paths += logs.as_given([Path(word)])
        tables = [path for path in paths if path in origins and path.name == RUNS_TABLE]
        beside = [path for path in paths if path in origins and not logs.is_log(PurePath(path.name))]
        given = Named([path for path in paths if path not in beside], origins, tables)
        try:
            yield given
        except InputError as error:
            raise InputError(given.as_shown(str(error))) from error


def _fetched(url: str, folder: Path, progress: Progress) -> dict[Path, str]:
    """Fetch the logs of one URL below `folder`; return whence each came."""
    from pipeline.campaign.remote import faults
    from pipeline.campaign.remote.at_once import at_once, size_of
    from pipeline.campaign.remote.local_names import local_names
    from pipeline.campaign.remote.source import RemoteLog, Source

    source = Source(url, Path.cwd())
    found = source.logs()
    names = local_names([log.name for log in found])
    # Runs of one name are told apart by their folders, so that these are called as at the source.
    above = source.called(found[0]).removesuffix(found[0].name).rstrip("/").rpartition("/")[2].partition("::")[0]
    top = folder / next(iter(local_names([above or "logs"]).values()))
    places = {log.name: top / names[log.name] for log in found}
    for place in places.values():
        place.parent.mkdir(parents=True, exist_ok=True)

    def fetch(log: RemoteLog) -> None:
        source.fetch(log, places[log.name])

    with progress(len(found)) as step:
        for log, error in at_once(fetch, found, source.threads, lambda: size_of(folder)):
            if error is not None:
                raise faults.said(error, source.url, log.name)
            step(log.name)
    return {places[log.name]: source.called(log) for log in found}
