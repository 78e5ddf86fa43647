"""What lies below a URL: every file with its size, and a mark that changes when its content does.

Nothing is fetched here; for the web only the pages that link to the files are.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote, urlsplit

# What file systems call the hash of a file's content, and the times that change with it.
_HASHES = (
    *("ETag", "etag", "md5Hash", "Content-MD5", "content_md5", "md5", "sha256", "sha1", "sha", "hex", "oid", "blob_id"),
    *("checksum", "Digest", "crc32c", "CRC"),
)
_TIMES = (
    *("mtime", "LastModified", "last_modified", "Last-Modified", "modified", "modify", "updated", "last_write_time"),
    *("modificationTime", "date_time", "created"),
)
# Folders within folders of a web site; a page that links to itself under ever longer names ends here.
_DEEPEST = 12


def is_web(fs: Any) -> bool:
    """Tell whether a file system is a web server's, which has pages instead of folders."""
    return "http" in (fs.protocol if isinstance(fs.protocol, tuple | list) else (fs.protocol,))


def top_of(root: str) -> str:
    """Return the part of a path that holds no ``*``: what must be there before anything can be listed."""
    return root[: root.index("*")].rpartition("/")[0] if "*" in root else root


def below(fs: Any, root: str, about: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """List the files below `root`, or that it names, or that its ``*`` stand for.

    Parameters
    ----------
    about
        What `fs` tells of ``top_of(root)``.

    Returns
    -------
    dict
        Path below `root` ('/' between folders, otherwise as the file system has it) -> what it tells, with ``name``.
    """
    top = top_of(root).rstrip("/")
    if "*" in root:
        found = fs.glob(root, detail=True)
    elif is_web(fs):
        if about.get("mimetype") != "text/html" and not root.endswith("/"):
            return {_last(root): {**about, "name": root}}
        found = _linked(fs, f"{top}/")
    elif about["type"] == "directory":
        found = fs.find(root, detail=True)
    else:
        return {_last(root): {**about, "name": root}}
    files: dict[str, dict[str, Any]] = {}
    for key, told in sorted(found.items()):
        path, entry = key.removeprefix(top).removeprefix("/"), told
        if told.get("islink") or not told:
            try:
                entry = fs.info(key)
            except FileNotFoundError:  # a link to what is not there
                continue
        if entry.get("type") == "file" and path and not path.endswith("/"):
            files[unquote(path) if is_web(fs) else path] = {**entry, "name": key}
    return files


def mark_of(about: Mapping[str, Any]) -> str:
    """Return what changes when a file's content does; '' where its file system tells nothing of the kind."""
    known = [name for name in _HASHES if about.get(name)][:1] or [name for name in _TIMES if about.get(name)]
    return json.dumps({name: str(about[name]) for name in known}) if known else ""


def _last(root: str) -> str:
    path = unquote(urlsplit(root).path) if root.startswith(("http://", "https://")) else root
    return path.rstrip("/").rpartition("/")[2] or "log"


def _linked(fs: Any, folder: str) -> dict[str, dict[str, Any]]:
    """Follow the links of a web page that stay below it."""
    found: dict[str, dict[str, Any]] = {}
    waiting, seen = [(folder, 0)], {folder}
    while waiting:
        page, depth = waiting.pop()
        for entry in fs.ls(page, detail=True):
            name = entry["name"]
            if "?" in name or "#" in name or not name.startswith(folder) or name in seen:
                continue
            seen.add(name)
            if entry["type"] != "directory":
                found[name] = entry
            elif depth < _DEEPEST:
                waiting.append((name, depth + 1))
    return found
