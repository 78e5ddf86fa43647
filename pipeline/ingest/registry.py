"""Which readers there are and which of them a log is for: by its first bytes, then by its ending.

A reader is a module or package of this folder that exports ``READER``, or an entry point of the group
``rigfit.readers`` whose value is such an object. Nothing here reads a log.
"""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple

import pipeline.ingest
from pipeline.errors import EmptyLogError, InputError, listing
from pipeline.ingest.reader import RawLog, Reader

# As much of a file as a reader sees to recognise its format.
HEAD_BYTES = 1 << 16


class _Foreign(NamedTuple):
    """A format that is often met and that no reader here reads; where its mark stands, what to do."""

    name: str
    suffixes: tuple[str, ...]
    marks: tuple[tuple[int, bytes], ...]
    advice: str


_FOREIGN = (
    _Foreign("Excel or another Office file", (".xls",), ((0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"),), "save it as CSV"),
    _Foreign("zip (also Excel .xlsx)", (".zip", ".xlsx", ".ods"), ((0, b"PK\3\4"), (0, b"PK\5\6")),
             "unpack it first, or save the workbook as CSV"),
    _Foreign("gzip", (".gz", ".tgz"), ((0, b"\x1f\x8b"),), "unpack it first with 'gunzip'"),
    _Foreign("bzip2", (".bz2",), ((0, b"BZh"),), "unpack it first with 'bunzip2'"),
    _Foreign("xz", (".xz",), ((0, b"\xfd7zXZ\0"),), "unpack it first with 'unxz'"),
    _Foreign("zstd", (".zst", ".zstd"), ((0, b"\x28\xb5\x2f\xfd"),),
             "unpack it first, a ROS 2 bag for example with 'zstd -d bag_0.db3.zstd -o bag_0.db3'"),
    _Foreign("lz4", (".lz4",), ((0, b"\x04\x22\x4d\x18"),), "unpack it first with 'unlz4'"),
    _Foreign("7-Zip", (".7z",), ((0, b"7z\xbc\xaf\x27\x1c"),), "unpack it first"),
    _Foreign("tar", (".tar",), ((257, b"ustar"),), "unpack it first with 'tar xf'"),
    _Foreign("NumPy", (".npy",), ((0, b"\x93NUMPY"),), "write its array as CSV with a header line"),
    _Foreign("PDF", (".pdf",), ((0, b"%PDF-"),), "give the log itself, not a report on it"),
    _Foreign("picture", (".png", ".jpg", ".gif", ".tif"),
             ((0, b"\x89PNG"), (0, b"\xff\xd8\xff"), (0, b"GIF8"), (0, b"II*\0"), (0, b"MM\0*")),
             "give the log itself, not a picture of it"),
    _Foreign("WAV", (".wav",), ((8, b"WAVE"),), "write its samples as CSV with a header line"),
    _Foreign("HTML", (".html", ".htm"), ((0, b"<!DOCTYPE html"), (0, b"<!doctype html"), (0, b"<html")),
             "this is a web page, often a failed download; fetch the log again"),
)  # fmt: skip


@cache
def readers() -> tuple[Reader, ...]:
    """Return every reader, ordered by name.

    Raises
    ------
    InputError
        If a reader that another package registers cannot be loaded.
    """
    found: dict[str, Reader] = {}
    for info in pkgutil.iter_modules(pipeline.ingest.__path__):
        reader = getattr(import_module(f"pipeline.ingest.{info.name}"), "READER", None)
        if isinstance(reader, Reader):
            found[reader.name] = reader
    for entry in entry_points(group="rigfit.readers"):
        try:
            reader = entry.load()
        except (ImportError, AttributeError) as error:
            package = entry.dist.name if entry.dist else entry.value
            raise InputError(
                f"the log reader '{entry.name}' of the package '{package}' cannot be loaded: {error}. "
                f"Mend or uninstall that package."
            ) from error
        found[reader.name] = reader
    return tuple(found[name] for name in sorted(found))


def reader_for(path: Path) -> Reader:
    """Return the reader of the log at `path`: by content first, by its ending second.

    Raises
    ------
    InputError
        If there is no such file, it is a folder, empty or unreadable, or of a kind that no reader
        knows; then the text says what kind it looks like and which kinds are read.
    """
    head, suffix = _head(path), path.suffix.lower()
    foreign = _foreign(head)
    matches = [reader for reader in readers() if reader.recognises(head, "")]
    matches = matches or [reader for reader in readers() if reader.recognises(head, suffix)]
    if foreign:
        # Text readers may take a PDF for text: a known mark is believed, unless a reader is for that very format.
        matches = [reader for reader in matches if set(reader.suffixes) & set(foreign.suffixes)]
    if matches:
        return min(matches, key=lambda reader: suffix not in reader.suffixes)
    kinds = listing(f"{reader.name} ({', '.join(reader.suffixes)})" for reader in readers())
    if foreign:
        raise InputError(f"{path}: is a {foreign.name} file, which is not read; {foreign.advice}. Read are: {kinds}.")
    raise InputError(
        f"{path}: is no log of a known kind (it begins with the bytes {head[:8].hex(' ')}). Read are: {kinds}; "
        f"export the log as one of these."
    )


def open_log(path: Path) -> RawLog:
    """Open the log at `path` with the reader that is for it.

    Raises
    ------
    InputError
        As `reader_for`, or if the reader finds the log broken.
    """
    return reader_for(path).open(path)


def _head(path: Path) -> bytes:
    if path.is_dir():
        raise InputError(f"{path}: is a folder, a log file was expected; name the files in it.")
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file; check the name and the folder.") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the file and its permissions.") from error
    if not head:
        raise EmptyLogError(f"{path}: is empty (0 bytes); export or copy the log again.")
    return head


def _foreign(head: bytes) -> _Foreign | None:
    return next((kind for kind in _FOREIGN if any(head[at : at + len(mark)] == mark for at, mark in kind.marks)), None)
