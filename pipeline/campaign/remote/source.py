"""Logs on any file system that fsspec knows (S3, SFTP, the web, a share, an archive, ...): listed, and fetched one by one.

What is kept here of them, and what is fetched again, is in `mirror`.
"""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from pipeline.campaign.logs import is_log, is_needed
from pipeline.campaign.remote import faults
from pipeline.campaign.remote.at_once import PATIENCE, at_once, within
from pipeline.campaign.remote.listing import below, is_web, mark_of, top_of
from pipeline.campaign.remote.urls import protocols, shown
from pipeline.errors import InputError

# One server is asked by so many threads at once; a library that is not made for it by one.
_AT_ONCE = 16
_SHARED = {"file", "local", "memory"}
# Seconds for the names of some hundred thousand logs, once the server has answered.
_LONGEST = 600.0


@dataclass(frozen=True)
class RemoteLog:
    """One log at a source.

    `name` is its path below the URL, `key` what its file system calls it; `size` in bytes and `mark`, which changes
    with the content, are None and '' where they are not told.
    """

    name: str
    key: str
    size: int | None
    mark: str


class Source:
    """The logs below one URL.

    Parameters
    ----------
    url
        Any URL of fsspec, also chained (``zip::s3://bucket/logs.zip``), or a path, relative to `base`. Credentials come
        from the environment, as fsspec and the libraries below it take them.

    Raises
    ------
    InputError
        If its protocol is unknown, the library of it is missing, or nobody answers.
    """

    def __init__(self, url: str, base: Path) -> None:
        self.url, self.shown = url, shown(url)
        *links, last = url.split("::")
        if "://" not in last:
            path = (base / Path(last).expanduser()).resolve()
            if (slip := re.match(r"([a-z][a-z0-9]*):/*", last)) and not path.exists():
                raise faults.no_path(url, slip[0], f"{slip[1]}://")
            last = str(path)
        self._fs, self._root = _opened("::".join([*links, last]))

    @property
    def local(self) -> Path | None:
        """The folder or file of this machine that it is, if any."""
        return Path(self._root) if set(protocols(self.url)) <= {"file", "local"} and "*" not in self._root else None

    @property
    def threads(self) -> int:
        """How many logs may be fetched at once."""
        together = self._fs.async_impl or set(protocols(self.url)) <= _SHARED
        return _AT_ONCE if together else 1

    def logs(self) -> list[RemoteLog]:
        """Return the logs that are there now, what is read together with them, and the table of their conditions.

        Raises
        ------
        InputError
            If the place cannot be listed, or holds no log.
        """
        try:
            about = within(lambda: self._fs.info(top_of(self._root)), _patience(self.url))
            found = within(lambda: below(self._fs, self._root, about), _LONGEST)
            found = {name: about for name, about in found.items() if is_needed(PurePosixPath(name))}
            if is_web(self._fs):
                self._ask_for_each(found)
        except Exception as error:
            raise faults.said(error, self.url) from error
        if not any(is_log(PurePosixPath(name)) for name in found):
            raise faults.nothing(self.url)
        return [RemoteLog(name, about["name"], about.get("size"), mark_of(about)) for name, about in found.items()]

    def called(self, log: RemoteLog) -> str:
        """Return the URL of one log, as it is shown."""
        first, *rest = self.shown.split("::")
        if is_web(self._fs) and not rest:
            return shown(log.key)
        if "*" in first:
            first = first[: first.rindex("/", 0, first.index("*")) + 1]
        elif log.key.rstrip("/") == self._root.rstrip("/"):
            return self.shown
        elif "://" not in first and rest:
            first = f"{first}://"
        slash = "" if first.endswith("/") else "/"
        return "::".join([f"{first}{slash}{log.name}", *rest])

    def fetch(self, log: RemoteLog, path: Path) -> None:
        """Write one log to `path`.

        Raises
        ------
        InputError
            If fewer or more bytes came than were announced.
        Exception
            Whatever the library of the file system raises; `faults.said` puts it into words.
        """
        self._fs.get_file(log.key, str(path))
        if path.is_dir():  # a key that is the beginning of others as well is taken for a folder
            path.rmdir()
            with self._fs.open(log.key, "rb") as source, path.open("wb") as copy:
                shutil.copyfileobj(source, copy)
        if log.size is not None and (found := path.stat().st_size) != log.size:
            raise faults.half(self.url, log.name, found, log.size)

    def _ask_for_each(self, found: dict[str, dict[str, Any]]) -> None:
        """Add to what a web page links to what the server tells of it."""

        def ask(name: str) -> None:
            found[name] = {**self._fs.info(found[name]["name"]), "name": found[name]["name"]}

        for _, error in at_once(ask, [name for name, about in found.items() if "mimetype" not in about], self.threads):
            if error is not None:
                raise error


def _opened(url: str) -> tuple[Any, str]:
    """Return the file system of a URL and the path in it."""
    import fsspec

    links = protocols(url)
    known = fsspec.available_protocols()
    for protocol in links:
        if protocol not in known:
            raise faults.unknown_protocol(url, protocol, known)
        try:
            fsspec.get_filesystem_class(protocol)
        except ImportError as error:
            raise faults.missing_package(url, protocol, str(error)) from error
    try:
        options = {protocol: _options(protocol) for protocol in links}
        fs, root = within(lambda: fsspec.url_to_fs(url, **options), _patience(url))
    except Exception as error:
        raise faults.said(error, url) from error
    return fs, str(root)


def _patience(url: str) -> float:
    """Return how many seconds the first answer may take; of an archive it may be at its end, with all of it to be read."""
    return PATIENCE if len(protocols(url)) == 1 else _LONGEST


def _options(protocol: str) -> dict[str, Any]:
    """Return options that keep a library from asking a dead server again and again, below what the user has set."""
    import fsspec

    options: dict[str, Any] = {"skip_instance_cache": True}
    given = fsspec.config.conf.get(protocol, {})
    if protocol in ("s3", "s3a"):
        # A log larger than the memory comes as one stream, not as parts that are held.
        options["max_concurrency"] = given.get("max_concurrency", 1)
        patience = {"connect_timeout": 5, "read_timeout": 12, "retries": {"total_max_attempts": 1}}
        options["config_kwargs"] = {**patience, **given.get("config_kwargs", {})}
    elif protocol in ("http", "https"):
        import aiohttp

        timeout = aiohttp.ClientTimeout(total=None, sock_connect=10, sock_read=20)
        options["client_kwargs"] = {"timeout": timeout, **given.get("client_kwargs", {})}
    return options


def refuse_overlap(source: Source, folder: Path) -> None:
    """Refuse to mirror a folder into itself, or into a part of it.

    Raises
    ------
    InputError
        If `source` is a folder of this machine that holds `folder`, or lies in it.
    """
    if source.local is None:
        return
    there, here = source.local.resolve(), folder.resolve()
    if there == here or there in here.parents or here in there.parents:
        raise InputError(
            f"{source.shown}: this folder and {folder.name}/, into which its logs would be copied, lie one in the other. Logs "
            "in a campaign's own folder need no URL: take it out of 'datasets' in params.yaml."
        )
