"""A folder of recordings as ingest left it: which files belong to which run, what was noticed, which runs were left out.

`manifest.json` says it; it is written last. How recordings are made is in `ingest_stage`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

from pipeline.campaign.seen import are_runs, forget
from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.recording.storage import read, sha256_of

MANIFEST = "manifest.json"


class Recordings(Sequence[Recording]):
    """Recordings on disk, each read when it is asked for and its samples when they are used.

    Nothing is kept here: who goes through them once holds one run in memory.
    """

    def __init__(self, paths: Sequence[Sequence[Path]]) -> None:
        self._paths = paths

    @overload
    def __getitem__(self, index: int) -> Recording: ...
    @overload
    def __getitem__(self, index: slice) -> Recordings: ...
    def __getitem__(self, index: int | slice) -> Recording | Recordings:
        if isinstance(index, slice):
            return Recordings(self._paths[index])
        return read(self._paths[index], lazily=True)

    def __len__(self) -> int:
        return len(self._paths)


@dataclass(frozen=True)
class LeftOut:
    """A run of the campaign that does not go on: its logs with their hashes ('' where it cannot be read), and why."""

    run: str
    reason: str
    files: Mapping[str, str]


@dataclass(frozen=True)
class Ingested:
    """What a folder of recordings holds: by run, its files with their hashes; and the runs that were left out."""

    folder: Path
    files: Mapping[str, Mapping[str, str]]
    quality: Sequence[QualityFinding]
    left_out: Sequence[LeftOut] = ()

    def recordings(self) -> Recordings:
        """Return the recordings, in the order of the runs.

        Raises
        ------
        InputError
            If one is gone or not as it was written.
        """
        for run, files in self.files.items():
            if names := damaged(self.folder, files):
                forget(self.folder)
                raise InputError(
                    f"{self.folder / names[0]}: the recording of run '{run}' is damaged or gone, or was changed by another "
                    f"program; run 'rigfit ingest {self.folder.name}', which reads that log again."
                )
        return Recordings([[self.folder / name for name in names] for names in self.files.values()])


def load(folder: Path) -> Ingested:
    """Return what `ingest` left in `folder`.

    Raises
    ------
    InputError
        If it was not (or not wholly) ingested.
    """
    content = manifest(folder)
    if not content:
        raise InputError(f"{folder}: holds no recordings; run 'rigfit ingest {folder.name}' first.")
    quality = [_finding(entry) for entry in content["quality"]]
    left_out = [_left_out(entry) for entry in content["left_out"]]
    gone = {entry.run for entry in left_out}
    files = {run: entry["files"] for run, entry in content["runs"].items() if run not in gone}
    return Ingested(folder, files, quality, left_out)


def damaged(folder: Path, files: Mapping[str, str], hash_of: Callable[[Path], str] = sha256_of) -> list[str]:
    """Return which of the recordings are gone or not as they were written."""
    return [name for name, digest in files.items() if not (folder / name).is_file() or hash_of(folder / name) != digest]


def manifest(folder: Path) -> dict[str, Any]:
    """Return what the manifest says, nothing where there is none that this version understands."""
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        for told, part in ((_finding, "quality"), (_left_out, "left_out")):
            for entry in content[part]:
                told(entry)
        return content if are_runs(content["runs"]) else {}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}


def _finding(entry: Mapping[str, Any]) -> QualityFinding:
    """Return a finding as it was written; ValueError, TypeError or KeyError where it was not written so."""
    span = entry["span"]
    finding = QualityFinding(**{**entry, "span": (float(span[0]), float(span[1])) if span else None})
    texts = [text for text in (finding.run, finding.channel) if text is not None]
    if finding.level not in ("note", "warning", "error") or not all(
        isinstance(t, str) for t in (finding.message, *texts)
    ):
        raise ValueError(entry)
    return finding


def _left_out(entry: Mapping[str, Any]) -> LeftOut:
    left_out = LeftOut(**entry)
    texts = (left_out.run, left_out.reason, *left_out.files, *left_out.files.values())
    if not all(isinstance(text, str) for text in texts):
        raise ValueError(entry)
    return left_out
