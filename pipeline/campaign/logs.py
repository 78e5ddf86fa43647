"""Which files are the logs of a campaign, and which of them make up one run.

``<run>.csv`` is a run; ``<run>.<table>.csv`` with a table named in lower case (``r1.device.csv``,
``r1.usb6009.csv``) are the streams of one run, each with its own clock. Endings that only count
(``a.run1.csv``, ``a.run2.csv``) are runs.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath

from pipeline.errors import InputError, listing
from pipeline.recording import QualityFinding

RUNS_TABLE = "runs.csv"
# What lies beside logs without being one: notes, pictures, what version control keeps.
_BESIDE = {
    ".md",
    ".pdf",
    ".jpg",
    ".jpeg",
    ".png",
    ".doc",
    ".docx",
    ".dvc",
    ".yaml",
    ".yml",
    ".html",
    ".rst",
    ".tdms_index",
}
# What is read together with a log that it lies beside.
_WITH_A_LOG = {".msg", ".db3-wal", ".db3-shm", ".db3-journal"}
_TABLE = re.compile(r"^(.+)\.([a-z]{2}[a-z0-9_]+)$")


@dataclass(frozen=True)
class RunFiles:
    """The files of one run: (stream, path), the stream '' where there is only one file.

    `shared` is the name that other runs would have too, from which theirs and this one's differ; else ''. `origins` says
    of streams whose file was fetched from elsewhere for this command what to call it: its URL.
    """

    run: str
    files: tuple[tuple[str, Path], ...]
    shared: str = ""
    origins: Mapping[str, str] = field(default_factory=dict)


def of_folder(folder: Path) -> list[Path]:
    """Return the logs below a campaign's folder, in order of their names.

    Raises
    ------
    InputError
        If there is no such folder, or no log in it.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder; make it and put the campaign's logs into it.")
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file() and is_log(path.relative_to(folder))]
    if not paths:
        raise InputError(
            f"{folder}: holds no logs; drop at least one log (CSV, MCAP, ROS bag, MAT, TDMS, MDF, HDF5, Parquet) into it "
            "(runs.csv, notes and pictures do not count). Logs that lie elsewhere: name their URL under 'datasets' in "
            f"params.yaml and run 'rigfit fetch {folder.name}'."
        )
    return paths


def is_log(path: PurePath) -> bool:
    """Tell a log from what lies beside logs: hidden files, the runs table, notes, pictures; `path` is below the folder."""
    hidden = any(part.startswith(".") and part not in (".", "..") for part in path.parts)
    return not hidden and path.name != RUNS_TABLE and path.suffix.lower() not in _BESIDE | _WITH_A_LOG


def is_needed(path: PurePath) -> bool:
    """Tell what a copy of a campaign's folder must hold: logs, what is read together with them, and the runs table."""
    hidden = any(part.startswith(".") and part not in (".", "..") for part in path.parts)
    return is_log(path) or path.as_posix() == RUNS_TABLE or (not hidden and path.suffix.lower() in _WITH_A_LOG)


def as_given(paths: Sequence[Path]) -> list[Path]:
    """Check paths named on the command line: each must be a file.

    Raises
    ------
    InputError
        For a path that is missing or a folder.
    """
    for path in paths:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name the log files in it, for example {path}/*.csv.")
        if path.is_symlink() and not path.exists():
            raise InputError(f"{path}: is a link that leads nowhere; mend the link or name the log itself.")
        if not path.exists():
            raise InputError(f"{path}: there is no such file; check the name and the folder.")
        if not path.is_file():
            raise InputError(f"{path}: is not a regular file; copy the log to a file first.")
    return list(dict.fromkeys(paths))


def runs_of(paths: Sequence[Path], origins: Mapping[Path, str] | None = None) -> list[RunFiles]:
    """Group logs into runs; runs that would have one name are called by their file's name, or by its folder.

    `origins` holds the URL of each log that was fetched for this command.
    """
    tables = {path: (match[1], match[2]) for path in paths if (match := _TABLE.match(path.stem))}
    words: dict[tuple[Path, str], set[str]] = {}
    for path, (run, table) in tables.items():
        words.setdefault((path.parent, run), set()).add(table.rstrip("0123456789"))
    by_run: dict[tuple[Path, str], list[tuple[str, Path]]] = {}
    for path in paths:
        # One word with different numbers counts runs; different words are boards, numbered or not.
        run, table = tables.get(path, (path.stem, ""))
        if table[-1:].isdigit() and len(words[path.parent, run]) == 1:
            run, table = path.stem, ""
        key = (path.parent, run if table else path.name)
        by_run.setdefault(key, []).append((table, path))
    named = [(_safe(run if files[0][0] else files[0][1].stem), files) for (_, run), files in by_run.items()]
    often = Counter(name for name, _ in named)
    endings = Counter(files[0][1].name for name, files in named if often[name] > 1)
    result: dict[str, RunFiles] = {}
    for short, files in named:
        name, shared = short, ""
        if often[short] > 1:
            file, shared = files[0][1], short
            alone = endings[file.name] == 1
            name = _safe(file.name) if alone else _safe(f"{file.parent.resolve().name}-{short}")
        while name in result:
            name += "+"
        urls = {stream: origins[path] for stream, path in files if origins and path in origins}
        result[name] = RunFiles(name, tuple(sorted(files)), shared, urls)
    return sorted(result.values(), key=lambda entry: _natural(entry.run))


def _safe(name: str) -> str:
    """Make a name that cannot leave its folder or hide in it."""
    return re.sub(r"[^\w.+@=,() -]", "_", name).strip(" .") or "run"


def _natural(name: str) -> tuple[object, ...]:
    return tuple((0, int(part)) if part.isdigit() else (1, part.lower()) for part in re.split(r"(\d+)", name))


def said_shared(runs: Sequence[RunFiles]) -> list[QualityFinding]:
    """Say what runs are called whose files' names would give several of them one name."""
    by_name: dict[str, list[RunFiles]] = {}
    for entry in runs:
        if entry.shared:
            by_name.setdefault(entry.shared, []).append(entry)
    notes = []
    for name, entries in by_name.items():
        called = listing(f"'{entry.run}' ({'/'.join(entry.files[0][1].parts[-2:])})" for entry in entries)
        message = (
            f"{len(entries)} logs would be the run '{name}'; they are called {called}. In runs.csv and under 'exclude' "
            "they have these names."
        )
        notes.append(QualityFinding("note", message))
    return notes
