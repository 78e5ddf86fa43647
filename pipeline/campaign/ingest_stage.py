"""Logs + recipe -> recordings, incrementally: a log that was read already is not read again.

What a folder of recordings holds in the end is in `ingested`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.campaign import conditions as run_conditions
from pipeline.campaign import ingest_notes
from pipeline.campaign.ingested import MANIFEST, Ingested, LeftOut, Recordings, damaged, load, manifest
from pipeline.campaign.logs import RunFiles
from pipeline.campaign.parallel import in_parallel
from pipeline.campaign.recipe import Recipe
from pipeline.campaign.repeated import Head, repeated
from pipeline.campaign.runs_table import RunsTable
from pipeline.campaign.seen import Seen
from pipeline.errors import InputError
from pipeline.ingest.ingest import VERSION, ingest_run, open_run
from pipeline.ingest.registry import readers
from pipeline.recording import Level, QualityFinding, Recording
from pipeline.recording.storage import read, sha256_of, whole_or_not
from pipeline.rigs.experiment import Experiment

Progress = Callable[[str], None]

# A rig's check may hold all numbers of a recording; of more than so many (a quarter of a gigabyte) that is left to identification.
_MOST_CHECKED = 1 << 25
# What one core reads of a log of text, about, and what a log costs before that.
BYTES_A_SECOND, SECONDS_A_LOG = 32 << 20, 0.015


def ingest(
    recipe: Recipe,
    runs: Sequence[RunFiles],
    folder: Path,
    *,
    base: Path,
    table: RunsTable | None = None,
    uses: Mapping[str, str] | None = None,
    seen: Seen | None = None,
    force: bool = False,
    progress: Progress = lambda _run: None,
) -> Ingested:
    """Bring `folder` up to date with the logs of `runs`; a recording that is not as it was written is made anew.

    Parameters
    ----------
    base
        Paths of logs are kept and shown relative to it.
    uses
        Campaign -> hash of its findings that these runs will be identified with; it is noted in the manifest, so
        that DVC identifies again where it changes.
    seen
        What is remembered of the files; without, each is looked into.
    force
        Read every log again.
    progress
        Called with each run's name when it is done.

    Raises
    ------
    InputError
        If no log at all can be read; nothing is changed then. Logs that cannot be read beside others
        that can are left out, which the result says as an error of that run.
    """
    seen = seen or Seen()
    before = {} if force else {**manifest(folder).get("runs", {}), **seen.unfinished}
    quality = ingest_notes.of_campaign(recipe, runs, table)
    wanted = [entry for entry in runs if entry.run not in recipe.exclude]
    failed: dict[str, str] = {}
    tasks: dict[str, _Task] = {}
    kept: dict[str, dict[str, Any]] = {}
    heads: dict[str, Head] = {}
    versions = {reader.named for reader in readers()}
    for entry in wanted:
        try:
            task = _task(recipe, entry, table, base, seen)
        except InputError as error:
            failed[entry.run] = _with_paths_as_shown(str(error), _shown(entry, base), entry.files)
            continue
        known = before.get(entry.run, {"key": "", "readers": [], "files": {}})
        spoilt = damaged(folder, known["files"], seen.sha256)
        if known["key"] == task.key and versions.issuperset(known["readers"]) and not spoilt:
            kept[entry.run] = known
            progress(entry.run)
        else:
            tasks[entry.run] = task
            for name in spoilt:  # what stands there now may claim to be another run's
                (folder / name).unlink(missing_ok=True)
    files = [path for task in tasks.values() for _, path in task.files]
    seconds = sum(SECONDS_A_LOG + path.stat().st_size / BYTES_A_SECOND for path in files)
    work = [(task, folder.resolve()) for task in tasks.values()]
    for run, outcome in in_parallel(_read_one, work, seconds, _died):
        if isinstance(outcome, str):
            failed[run] = outcome
        else:
            heads[run] = outcome.head
            kept[run] = {"key": tasks[run].key, "readers": outcome.readers, "files": outcome.files}
            seen.read(run, kept[run], outcome.head.as_json())
        progress(run)
    failed = {entry.run: failed[entry.run] for entry in wanted if entry.run in failed}
    if not kept:
        raise InputError(ingest_notes.nothing_read(wanted, failed, recipe))
    order = {entry.run: kept[entry.run] for entry in wanted if entry.run in kept}
    findings = [QualityFinding("error", f"left out: {message}", run) for run, message in failed.items()]
    findings += _repeats(recipe, folder, order, heads, seen)
    reasons = {finding.run: finding.message for finding in findings if finding.run}
    if reasons.keys() >= {entry.run for entry in wanted}:
        raise InputError(f"No log can be used. {findings[-1].message.removeprefix('left out: ')}")
    reasons.update((run, f"left out by the recipe: {reason}") for run, reason in recipe.exclude.items())
    content = {
        "runs": order,
        "left_out": [asdict(_left_out(entry, reasons[entry.run], base)) for entry in runs if entry.run in reasons],
        "quality": [asdict(finding) for finding in (*quality, *findings)],
        "uses": dict(uses or {}),
    }
    with whole_or_not(folder / MANIFEST) as path:
        path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    seen.save()
    _sweep(folder, {name for entry in order.values() for name in entry["files"]})
    return load(folder)


@dataclass(frozen=True)
class _Task:
    """One run to read, with all that its recording depends on but its readers' versions; `key` is the hash of that."""

    run: str
    files: tuple[tuple[str, Path], ...]
    shown: Mapping[str, str]
    recipe: Recipe
    table: RunsTable | None
    key: str


def _task(recipe: Recipe, entry: RunFiles, table: RunsTable | None, base: Path, seen: Seen) -> _Task:
    """Return the work on one run; its logs are not opened for that, so that those already read cost next to nothing."""
    shown = _shown(entry, base)
    own = table.only(entry.run, [path.name for _, path in entry.files]) if table else None
    depends = {
        "version": [__version__, VERSION],
        "files": [[stream, shown[stream], seen.sha256(path)] for stream, path in entry.files],
        "beside": [seen.sha256(path) for _, log in entry.files for path in _beside(log)],
        "experiment": [recipe.experiment.id, repr(recipe.experiment.channels), repr(recipe.experiment.conditions)],
        "channels": {name: asdict(channel) for name, channel in recipe.channels.items()},
        "conditions": [dict(recipe.conditions), recipe.file_name, list(own.rows.values()) if own else []],
    }
    key = hashlib.sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()
    files = tuple((stream, path.resolve()) for stream, path in entry.files)
    return _Task(entry.run, files, shown, recipe, own, key)


def _beside(log: Path) -> Iterator[Path]:
    """Yield what a log is read with, as readers for its ending say; opening it to ask its own would take too long."""
    for reader in readers():
        if log.suffix.lower() in reader.suffixes:
            yield from reader.beside(log)


@dataclass(frozen=True)
class _Read:
    """A run that was read: its files with their hashes, who read the logs, what the recording begins with."""

    files: dict[str, str]
    readers: list[str]
    head: Head


def _read_one(task: _Task, folder: Path) -> tuple[str, _Read | str]:
    """Read one run, or say why it cannot be read."""
    try:
        logs, notes = open_run(task.files, task.shown)
        names = [log.path.name for _, log in logs]
        conditions = run_conditions.of_logs(task.run, task.recipe, task.table, [log for _, log in logs], names)
        paths = ingest_run(
            task.run,
            logs,
            task.recipe.experiment.channels,
            task.recipe.channels,
            conditions.values,
            conditions.sources,
            folder,
            check=_noticed_by(task.recipe.experiment),
            notes=[*conditions.notes, *notes],
            shown=task.shown,
        )
    except InputError as error:
        return task.run, _with_paths_as_shown(str(error), task.shown, task.files)
    recording = read(paths, lazily=True)
    by = sorted({source.reader for source in recording.provenance.files})
    return task.run, _Read({path.name: sha256_of(path) for path in paths}, by, Head.of(recording))


def _died(task: _Task, _folder: Path) -> tuple[str, str]:
    return task.run, ingest_notes.read_to_death(task.shown.values())


def _repeats(
    recipe: Recipe, folder: Path, runs: Mapping[str, Mapping[str, Any]], fresh: Mapping[str, Head], seen: Seen
) -> list[QualityFinding]:
    """Return a finding for each run that is another one's recording, and for those that this contradicts."""
    recordings = Recordings([[folder / name for name in entry["files"]] for entry in runs.values()])
    heads = []
    for place, (run, entry) in enumerate(runs.items()):
        for name, digest in entry["files"].items():
            seen.hashed(folder / name, digest)
        known = seen.head(run, entry)
        heads.append(fresh.get(run) or (Head.from_json(known) if known else None) or Head.of(recordings[place]))
        seen.keep_head(run, entry, heads[-1].as_json())
    found: dict[str, QualityFinding] = {}
    for repeat in repeated(heads, recordings, recipe.experiment):
        level: Level = "error" if repeat.contradicted else "warning"
        found[repeat.run] = QualityFinding(level, f"left out: {repeat.message}", repeat.run)
        if repeat.contradicted:
            found.setdefault(repeat.of, QualityFinding("error", f"left out: {repeat.contradicted}", repeat.of))
    return list(found.values())


def _left_out(entry: RunFiles, reason: str, base: Path) -> LeftOut:
    shown, files = _shown(entry, base), {}
    for stream, path in entry.files:
        try:
            files[shown[stream]] = sha256_of(path)
        except OSError:
            files[shown[stream]] = ""
    return LeftOut(entry.run, reason, files)


def _shown(entry: RunFiles, base: Path) -> dict[str, str]:
    return {stream: entry.origins.get(stream) or _relative(path, base) for stream, path in entry.files}


def _with_paths_as_shown(message: str, shown: Mapping[str, str], files: Sequence[tuple[str, Path]]) -> str:
    """Return a reader's message with paths as this campaign shows them, so that it is the same in every clone."""
    for stream, path in files:
        message = message.replace(str(path), shown[stream])
    return message


def _noticed_by(experiment: Experiment) -> Callable[[Recording], Sequence[QualityFinding]]:
    """Return the experiment's check without what leaves a run out: identification says that itself."""

    def notice(recording: Recording) -> Sequence[QualityFinding]:
        numbers = sum(stream.size * len(stream.channels) for stream in recording.streams.values())
        if numbers > _MOST_CHECKED and not experiment.reads_blocks:
            text = f"a long recording of {numbers / 1e6:.3g} million numbers: what only the rig can tell is told by identification."
            return (QualityFinding("note", text),)
        try:
            return [finding for finding in experiment.check(recording) if finding.level != "error"]
        except InputError:
            return ()

    return notice


def _sweep(folder: Path, keep: set[str]) -> None:
    """Remove recordings of logs that are gone, and what an interrupted run left behind."""
    for path in folder.iterdir():
        if path.is_file() and path.name not in keep and (path.suffix == ".parquet" or path.name.endswith(".partial")):
            path.unlink()


def _relative(path: Path, base: Path) -> str:
    try:
        return path.resolve().relative_to(base.resolve()).as_posix()
    except ValueError:
        return path.name
