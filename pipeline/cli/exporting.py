"""`rigfit export`: findings of a campaign in a form that other programs read."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from pipeline.campaign import ingested
from pipeline.campaign.project import Project
from pipeline.cli.findings_of import findings_of
from pipeline.cli.saying import say
from pipeline.errors import InputError, counted, listing
from pipeline.findings import Findings, Run
from pipeline.findings import export_mcap as mcap
from pipeline.findings.export import as_csv, bearing_tables
from pipeline.findings.export_json import as_json
from pipeline.findings.export_matlab import as_mat
from pipeline.recording import Recording
from pipeline.recording.storage import whole_or_not
from pipeline.rigs.experiment import Experiment
from pipeline.rigs.registry import experiment as find_experiment


def export(campaign: str, form: str, out: Path | None) -> None:
    """Write the findings of a campaign, or of a findings.json, as `form` into the folder `out`."""
    findings, results = findings_of(campaign)
    if not re.fullmatch(r"[^./\\:\0][^/\\:\0]*", findings.campaign):
        raise InputError(
            f"{results / 'findings.json'}: its campaign is called '{findings.campaign}', which cannot be a file's name."
        )
    folder = out or results / "export"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, not a folder; name another folder with --out.")
    file = folder / findings.campaign
    if form == "csv":
        _write(file.with_name(f"{file.name}.csv"), as_csv(findings).encode())
    elif form == "json":
        text = as_json(findings, find_experiment(findings.experiment).unit_of)
        _write(file.with_name(f"{file.name}.json"), text.encode(errors="replace"))
    elif form == "matlab":
        _write(file.with_name(f"{file.name}.mat"), as_mat(findings, find_experiment(findings.experiment).unit_of))
    elif form == "mcap":
        _signals(findings, find_experiment(findings.experiment), results, folder)
    else:
        _bearings(findings, folder)


def _bearings(findings: Findings, folder: Path) -> None:
    for table in bearing_tables(findings):
        _write(folder / f"{table.name}.toml", table.toml().encode())
        _write(folder / f"{table.name}.xlsx", table.sheet())
        if table.skipped:
            say(
                f"{table.name}: {counted(len(table.skipped), 'row')} left out, where a coefficient is not told "
                f"({', '.join(f'{row:.4g}' for row in table.skipped)} rad/s).",
                err=True,
            )


def _signals(findings: Findings, experiment: Experiment, results: Path, folder: Path) -> None:
    """Write one MCAP a run: its recording where it is at hand, and what the findings tell over time."""
    recordings = _recordings(findings, results)
    without = []
    for run, recording in _runs(findings, recordings):
        topics = mcap.topics_of(run.run, recording, findings, experiment.signals)
        if not any(topic.name.startswith("/findings") for topic in topics):
            without.append(run.run)
        if not topics:
            continue
        path = folder / f"{findings.campaign}-{run.run}.mcap"
        with whole_or_not(path) as partial:
            mcap.write(partial, run, findings, topics, experiment.unit_of)
        say(str(path))
    if len(without) == len(findings.runs):
        if recordings is None:
            raise InputError(
                f"campaign '{findings.campaign}': there are no recordings beside its findings, and {experiment.id} keeps no signal "
                "over time among them; nothing to export. 'rigfit ingest' with its name brings the recordings back."
            )
        say(
            f"the findings of '{findings.campaign}' hold no modelled signal over time: the files hold what was measured, conditions "
            "and parameters.",
            err=True,
        )
    elif without:
        say(f"without modelled signals, since the findings hold none of them: {listing(without, 8)}.", err=True)


def _runs(
    findings: Findings, recordings: dict[str, ingested.Recordings] | None
) -> Iterator[tuple[Run, Recording | None]]:
    for run in findings.runs:
        found = recordings.get(run.run) if recordings else None
        recording = found[0] if found else None
        if recording is not None and {f.sha256 for f in recording.provenance.files} != set(run.sha256):
            raise InputError(
                f"campaign '{findings.campaign}', run '{run.run}': the recording is of other logs than the findings; run 'dvc repro' "
                f"or 'rigfit identify {findings.campaign}' first."
            )
        yield run, recording


def _recordings(findings: Findings, results: Path) -> dict[str, ingested.Recordings] | None:
    """Return the recordings of a campaign by run: those of the project, or those that 'rigfit run' left beside the findings."""
    places = [results / "recordings"]
    try:
        project = Project.around(results.resolve())
        places.append(project.root / "recordings" / results.resolve().name)
    except InputError:
        pass
    place = next((place for place in places if (place / ingested.MANIFEST).is_file()), None)
    if place is None:
        say(
            f"no recordings of '{findings.campaign}' are here ({places[-1]}): the files hold what the findings tell over time, not what "
            "was measured.",
            err=True,
        )
        return None
    found = ingested.load(place)
    whole = found.recordings()
    return {run: whole[number : number + 1] for number, run in enumerate(found.files)}


def _write(path: Path, content: bytes) -> None:
    with whole_or_not(path) as partial:
        partial.write_bytes(content)
    say(str(path))
