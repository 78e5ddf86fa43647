"""`rigfit check`: what logs hold, and what is wrong with them, in words and one table."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import click

from pipeline.campaign import conditions, logs
from pipeline.campaign.logs import RunFiles
from pipeline.campaign.recipe import Recipe, load
from pipeline.campaign.remote.named import Named, named
from pipeline.campaign.repeated import Head, repeated
from pipeline.campaign.runs_table import RunsTable
from pipeline.cli.progress import progress
from pipeline.errors import InputError
from pipeline.ingest.reader import RawLog
from pipeline.ingest.scan import TableScan, scan_run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.registry import experiment as find_experiment

_ORDER = {"error": 0, "warning": 1, "note": 2}


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
        click.echo(f"{remark.level}: {remark.message}")
    read_so_far: list[Recording] = []
    with tempfile.TemporaryDirectory() as folder:
        for number, run in enumerate(runs):
            if number:
                click.echo()
            try:
                status = max(status, _show_run(run, recipe, table, Path(folder), read_so_far))
            except InputError as error:
                click.echo(f"rigfit: {' '.join(given.as_shown(str(error)).split())}", err=True)
                status = 2
        if recipe is not None:
            status = max(status, _show_repeats(read_so_far, recipe.experiment))
    return status


def _show_repeats(recordings: Sequence[Recording], experiment: Experiment) -> int:
    """Print which runs are another one's recording; 2 where their labels contradict, so that neither can be used."""
    status = 0
    for repeat in repeated([Head.of(recording) for recording in recordings], recordings, experiment):
        click.echo(f"\n{'error' if repeat.contradicted else 'warning'}: {repeat.message}")
        status = max(status, 2 if repeat.contradicted else 0)
    return status


def _show_run(
    run: RunFiles, recipe: Recipe | None, table: RunsTable | None, folder: Path, read_so_far: list[Recording]
) -> int:
    names = {stream: run.origins.get(stream) or str(path) for stream, path in run.files}
    specs = recipe.experiment.channels if recipe else ()
    scan = scan_run(run.files, specs, recipe.channels if recipe else None, names)
    for log in scan.logs:
        about = ", ".join(f"{key} {value}" for key, value in log.details.items())
        called = next((names[stream] for stream, path in run.files if path == log.path), log.path)
        click.echo(f"{called}: {log.format}{f' ({about})' if about else ''}")
    for part in scan.tables:
        _show_table(part)
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


def _show_said(logs: Sequence[RawLog]) -> None:
    """Print what each log says of itself, under its name where there are several."""
    for log in logs:
        if log.metadata:
            click.echo(f"said by {log.path.name}:" if len(logs) > 1 else "said by the log:")
            for key, value in log.metadata.items():
                click.echo(f"  {key}: {value}")


def _show_table(table: TableScan) -> None:
    summary = table.summary
    name = f"table {table.table}: " if table.table else ""
    if table.time is None:
        click.echo(f"{name}{summary.n} rows, no usable time")
    else:
        source = f"time from '{table.time.channel}' [{table.time.unit}]" if table.time.channel else "time by counting"
        rate = f", {summary.rate:.6g} Hz" if summary.rate == summary.rate else ""
        click.echo(f"{name}{summary.n} rows{rate}, {summary.start:.6g} to {summary.end:.6g} s, {source}")
    rows: list[tuple[str, ...]] = [("channel", "in the log", "unit", "taken as", "min", "mean", "max", "missing")]
    for channel in summary.channels:
        numbers = [
            f"{value:.5g}" if value == value else "" for value in (channel.minimum, channel.mean, channel.maximum)
        ]
        rows.append(
            (
                f"{channel.name} *" if channel.name in table.mapped else channel.name,
                channel.raw_name if channel.raw_name != channel.name else "",
                channel.raw_unit or "?",
                channel.unit or "text",
                *numbers,
                str(channel.missing) if channel.missing else "",
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        left = [cell.ljust(width) for cell, width in zip(row[:4], widths[:4], strict=True)]
        right = [cell.rjust(width) for cell, width in zip(row[4:], widths[4:], strict=True)]
        click.echo(f"  {'  '.join([*left, *right])}".rstrip())
    if table.mapped:
        click.echo("  * as the experiment calls it")


def _show_conditions(given: conditions.Conditions, recipe: Recipe) -> None:
    if given.values:
        click.echo("conditions:")
        for name, value in given.values.items():
            spec = recipe.experiment.condition(name)
            unit = spec.unit if spec and spec.unit not in ("", "1") else ""
            shown = f"{value:.6g} {unit}".strip() if isinstance(value, float) else str(value)
            click.echo(f"  {name}: {shown} (from {given.sources[name]})")


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
        click.echo("nothing wrong was found")
        return 0
    for finding in sorted(quality, key=lambda f: _ORDER[f.level]):
        span = f" at {finding.span[0]:.6g} to {finding.span[1]:.6g} s" if finding.span else ""
        channel = f" {finding.channel}" if finding.channel else ""
        click.echo(f"{finding.level}{channel}{span}: {finding.message}")
    return 1 if any(finding.level == "error" for finding in quality) else 0
