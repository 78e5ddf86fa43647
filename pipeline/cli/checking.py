"""`rigfit check`: what logs hold, and what is wrong with them, in words and one table."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from pipeline.campaign import conditions, logs
from pipeline.campaign.logs import RunFiles
from pipeline.campaign.recipe import Recipe, load
from pipeline.campaign.remote.named import Named, named
from pipeline.campaign.repeated import Head, repeated
from pipeline.campaign.runs_table import RunsTable
from pipeline.cli.progress import progress
from pipeline.cli.saying import say
from pipeline.errors import InputError
from pipeline.ingest.quality import ChannelSummary
from pipeline.ingest.reader import RawLog
from pipeline.ingest.scan import TableScan, scan_run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.registry import experiment as find_experiment

_ORDER = {"error": 0, "warning": 1, "note": 2}
_HEADINGS = ("channel", "in the log", "unit", "taken as", "min", "mean", "max", "missing")
# So many of the columns hold words.
_WORDS = 4
# So many numbered channels are told one by one.
_FEW = 4
_NUMBERED = re.compile(r"[._]?\d+$")
_MOST_SAID = 24
# Seconds beyond this (September 2001) count from 1970.
_DATED = 1e9


def show(
    words: Sequence[str], experiment_id: str | None, recipe_path: Path | None, runs_path: Path | None = None
) -> int:
    """Print what the logs hold; return 0, 1 where something in a log is an error, 2 where one cannot be used.

    With an experiment these are the statuses of `rigfit run`, as far as each log tells by itself.
    """
    recipe = None
    if recipe_path is not None:
        recipe = load(recipe_path, experiment_id)
    elif experiment_id is not None:
        recipe = Recipe.default(find_experiment(experiment_id))
    if runs_path is not None and recipe is None:
        raise InputError(
            f"{runs_path}: which conditions it gives depends on the experiment; name it with --experiment."
        )
    with named(words, lambda number: progress("fetch", number)) as given:
        table = given.table(runs_path, recipe.experiment) if recipe else None
        return _show_all(given, recipe, table)


def _show_all(given: Named, recipe: Recipe | None, table: RunsTable | None) -> int:
    status = 0
    runs = logs.runs_of(given.paths, given.origins)
    remarks = table.remarks({run.run: [path.name for _, path in run.files] for run in runs}) if table else []
    for remark in (*logs.said_shared(runs), *remarks):
        say(f"{remark.level}: {remark.message}")
    read_so_far: list[Recording] = []
    with tempfile.TemporaryDirectory() as folder:
        for number, run in enumerate(runs):
            if number:
                say()
            try:
                status = max(status, _show_run(run, recipe, table, Path(folder), read_so_far))
            except InputError as error:
                say(f"rigfit: {' '.join(given.as_shown(str(error)).split())}", err=True)
                status = 2
        if recipe is not None:
            status = max(status, _show_repeats(read_so_far, recipe.experiment))
    return status


def _show_repeats(recordings: Sequence[Recording], experiment: Experiment) -> int:
    """Print which runs are another one's recording; 2 where their labels contradict, so that neither can be used."""
    status = 0
    for repeat in repeated([Head.of(recording) for recording in recordings], recordings, experiment):
        say(f"\n{'error' if repeat.contradicted else 'warning'}: {repeat.message}")
        status = max(status, 2 if repeat.contradicted else 0)
    return status


def _show_run(
    run: RunFiles, recipe: Recipe | None, table: RunsTable | None, folder: Path, read_so_far: list[Recording]
) -> int:
    names = {stream: run.origins.get(stream) or str(path) for stream, path in run.files}
    specs = recipe.experiment.channels if recipe else ()
    scan = scan_run(run.files, specs, recipe.channels if recipe else None, names)
    for log in scan.logs:
        parts = {f"topic {table.name}" for table in log.tables}
        about = ", ".join(f"{key} {value}" for key, value in log.details.items() if key not in parts)
        called = next((names[stream] for stream, path in run.files if path == log.path), log.path)
        say(f"{called}: {log.format}{f' ({about})' if about else ''}")
    if len(scan.tables) > 1:
        say(f"{len(scan.tables)} tables with {sum(len(t.summary.channels) for t in scan.tables)} channels")
    for part in scan.tables:
        _show_table(part, _detail(part, scan.logs))
    _show_said(scan.logs)
    quality, refused = list(scan.quality), False
    if recipe is not None:
        try:
            given = conditions.of_logs(run.run, recipe, table, scan.logs, [path.name for _, path in run.files])
            _show_conditions(given, recipe)
            quality += given.notes
            read_so_far.append(_ingested(run, recipe, given, names, folder))
            quality += recipe.experiment.check(read_so_far[-1])
        except InputError as error:
            refused = True
            said = str(error)
            for stream, path in run.files:
                said = said.replace(str(path), names[stream])
            if not any(said in finding.message for finding in quality):
                quality.append(QualityFinding("error", said))
    return max(_show_quality(quality), 2 if refused else 0)


def _detail(table: TableScan, logs: Sequence[RawLog]) -> str:
    """Return what a log tells of one of its topics."""
    of_file = [log for log in logs if len(logs) == 1 or log.path.name == Path(table.file).name]
    return next((log.details[key] for log in of_file if (key := f"topic {table.table}") in log.details), "")


def _show_said(logs: Sequence[RawLog]) -> None:
    """Print what each log says of itself, under its name where there are several; what its channels say last."""
    for log in logs:
        if log.metadata:
            say(f"said by {log.path.name}:" if len(logs) > 1 else "said by the log:")
            said = sorted(log.metadata.items(), key=lambda entry: "." in entry[0])
            for key, value in said if len(said) <= _MOST_SAID else said[: _MOST_SAID - 1]:
                say(f"  {key}: {value}")
            if len(said) > _MOST_SAID:
                say(f"  and {len(said) - _MOST_SAID + 1} more, such as {said[-1][0]}")


def _show_table(table: TableScan, detail: str) -> None:
    summary = table.summary
    name = f"table {table.table}: " if table.table else ""
    if table.time is None:
        say(f"{name}{summary.n} rows, no usable time")
    else:
        source = f"time from '{table.time.channel}' [{table.time.unit}]" if table.time.channel else "time by counting"
        rate = f", {summary.rate:.6g} Hz" if summary.rate == summary.rate else ""
        begins = f", begins {_date(table.begins)}" if table.begins is not None else ""
        say(f"{name}{summary.n} rows{rate}, {summary.start:.6g} to {summary.end:.6g} s, {source}{begins}")
    if detail:
        say(f"  {detail}")
    rows = [_HEADINGS, *_alike(_row(channel, channel.name in table.mapped) for channel in summary.channels)]
    shown = [at for at in range(len(_HEADINGS)) if at < 1 or any(row[at] for row in rows[1:])]
    widths = {at: max(len(row[at]) for row in rows) for at in shown}
    for row in rows:
        cells = [row[at].ljust(widths[at]) if at < _WORDS else row[at].rjust(widths[at]) for at in shown]
        say(f"  {'  '.join(cells)}".rstrip())
    if table.mapped:
        say("  * as the experiment calls it")


def _row(channel: ChannelSummary, is_mapped: bool) -> tuple[str, ...]:
    dated = channel.unit == "s" and channel.minimum > _DATED
    numbers = [channel.minimum, channel.mean, channel.maximum]
    return (
        f"{channel.name} *" if is_mapped else channel.name,
        channel.raw_name if channel.raw_name != channel.name else "",
        channel.raw_unit or ("?" if channel.unit else ""),
        channel.unit or "text",
        *((_date(value) if dated else f"{value:.5g}") if value == value else "" for value in numbers),
        str(channel.missing) if channel.missing else "",
    )


def _alike(rows: Iterable[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Put rows of numbered channels that differ in nothing else, such as the zeros of a covariance, into one."""
    waiting: list[tuple[str, ...]] = []
    for row in rows:
        if waiting and (_unnumbered(row) != _unnumbered(waiting[-1]) or not _NUMBERED.search(row[0])):
            yield from _together(waiting)
            waiting = []
        waiting.append(row)
    yield from _together(waiting)


def _together(rows: Sequence[tuple[str, ...]]) -> Sequence[tuple[str, ...]]:
    if len(rows) < _FEW:
        return rows
    last = _NUMBERED.search(rows[-1][0])
    assert last is not None  # only numbered channels are put together
    return [(f"{rows[0][0]} to {last[0]}", *rows[0][1:])]


def _unnumbered(row: tuple[str, ...]) -> tuple[str, ...]:
    return (_NUMBERED.sub("", row[0]), *row[1:])


def _date(seconds: float) -> str:
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}"


def _show_conditions(given: conditions.Conditions, recipe: Recipe) -> None:
    if given.values:
        say("conditions:")
        for name, value in given.values.items():
            spec = recipe.experiment.condition(name)
            unit = spec.unit if spec and spec.unit not in ("", "1") else ""
            shown = f"{value:.6g} {unit}".strip() if isinstance(value, float) else str(value)
            say(f"  {name}: {shown} (from {given.sources[name]})")


def _ingested(
    run: RunFiles, recipe: Recipe, given: conditions.Conditions, names: Mapping[str, str], folder: Path
) -> Recording:
    """Read a run as `rigfit run` would.

    Raises
    ------
    InputError
        Where that would refuse this log.
    """
    from pipeline.ingest.ingest import ingest_run
    from pipeline.recording.storage import read

    experiment = recipe.experiment
    paths = ingest_run(
        run.run,
        run.files,
        experiment.channels,
        recipe.channels,
        given.values,
        given.sources,
        folder,
        shown=names,
    )
    return read(paths, lazily=True)


def _show_quality(quality: Sequence[QualityFinding]) -> int:
    if not quality:
        say("nothing wrong was found")
        return 0
    for finding in sorted(quality, key=lambda f: _ORDER[f.level]):
        span = f" at {finding.span[0]:.6g} to {finding.span[1]:.6g} s" if finding.span else ""
        channel = f" {finding.channel}" if finding.channel else ""
        say(f"{finding.level}{channel}{span}: {finding.message}")
    return 1 if any(finding.level == "error" for finding in quality) else 0
