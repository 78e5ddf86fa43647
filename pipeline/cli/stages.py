"""The stages behind the commands: paths and progress around the floors below. Each returns an exit status."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.campaign import identify_stage, ingest_stage, ingested, logs, report_stage, runs_table, synthesize_stage
from pipeline.campaign.alone import alone_in
from pipeline.campaign.project import Campaign, Project
from pipeline.campaign.recipe import Recipe, load
from pipeline.campaign.remote.named import named
from pipeline.campaign.remote.urls import shown
from pipeline.campaign.seen import Seen
from pipeline.cli import replaying
from pipeline.cli.progress import progress, share_done
from pipeline.cli.saying import say
from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.findings import storage as findings_storage
from pipeline.findings.together import together
from pipeline.recording.storage import sha256_of
from pipeline.report.gathered import told
from pipeline.rigs.registry import experiment as find_experiment


def run(
    experiment_id: str,
    words: Sequence[str],
    out: Path,
    recipe_path: Path | None,
    runs_path: Path | None,
    uses: Sequence[Path],
    replay: float | None = None,
) -> int:
    """Do all stages for logs named on the command line; results go into `out`.

    With `replay` the recordings are first played, so many times as fast as they were logged.
    """
    experiment = find_experiment(experiment_id)
    if replay is not None:
        replaying.must_follow(experiment)
    recipe = load(recipe_path, experiment_id) if recipe_path else Recipe.default(experiment)
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file, not a folder; name another folder with --out.")
    handed = {}
    for number, path in enumerate(uses):
        own = path.parent.resolve().name if path.is_file() and path.stem == "findings" else path.stem
        handed[own if own not in handed else f"{own}-{number + 1}"] = identify_stage.used(path, path.as_posix())
    command = shlex.join(["rigfit", *map(shown, sys.argv[1:])])
    with named(words, lambda number: progress("fetch", number)) as given, together(out) as fresh:
        runs = logs.runs_of(given.paths, given.origins)
        table = given.table(runs_path, experiment)
        name = runs[0].run if len(runs) == 1 else out.resolve().name
        with progress("ingest", len(runs)) as step:
            ingested = ingest_stage.ingest(
                recipe, runs, fresh / "recordings", base=Path.cwd(), table=table, progress=step
            )
        if replay is not None:
            replaying.play(experiment, recipe.settings, ingested.recordings(), replay)
        with share_done("identify") as tell:
            findings = identify_stage.identify(name, recipe, ingested, handed, fresh, tell)
        page = report_stage.report(findings, experiment, recipe.title, command, fresh)
    page = out / page.name
    return _told(findings, page)


def synthesize(name: str, out: Path | None, seed: int | None) -> None:
    """Write synthetic logs of a campaign, or of an experiment into `out`."""
    if out is not None and "." in name:
        recipe = Recipe.default(find_experiment(name))
        folder = out
    else:
        campaign, recipe = _campaign(name)
        folder = out or campaign.synthetic
    written = synthesize_stage.synthesize(recipe, folder, recipe.synthetic.seed if seed is None else seed)
    say(f"{len(written)} logs in {folder}")


def ingest(name: str, force: bool) -> None:
    """Bring the recordings of a campaign up to date with its logs."""
    campaign, recipe = _campaign(name)
    runs = logs.runs_of(logs.of_folder(campaign.logs))
    table = None
    if conditions := campaign.runs_table():
        table = runs_table.read(conditions, recipe.experiment, conditions.relative_to(campaign.root).as_posix())
    used = {other: path for other in recipe.uses if (path := _findings_of(other, campaign)).is_file()}
    with alone_in(campaign.recordings), progress("ingest", len(runs)) as step:
        ingested = ingest_stage.ingest(
            recipe,
            runs,
            campaign.recordings,
            base=campaign.root,
            table=table,
            uses={other: sha256_of(path) for other, path in used.items()},
            seen=Seen(campaign.recordings, force=force),
            force=force,
            progress=step,
        )
    for other in Project(campaign.root).not_handed_over(name, recipe.uses):
        say(
            f"warning: {name}: its recipe uses '{other}', which DVC does not know; add '- {{campaign: {name}, of: {other}}}' "
            "under 'uses' in params.yaml.",
            err=True,
        )
    for finding in ingested.quality:
        if finding.level != "note":
            say(f"{finding.level}: {finding.run or name}: {finding.message}", err=True)
    say(f"{len(ingested.files)} recordings in {campaign.recordings.relative_to(campaign.root)}/")


def identify(name: str) -> int:
    """Identify a campaign from its recordings."""
    campaign, recipe = _campaign(name)
    used = {other: _handed_over(other, campaign) for other in recipe.uses}
    with alone_in(campaign.results), share_done("identify") as tell:
        findings = identify_stage.identify(
            name,
            recipe,
            ingested.load(campaign.recordings),
            used,
            campaign.results,
            tell,
        )
    return _told(findings, None)


def report(name: str) -> None:
    """Render the report of a campaign."""
    campaign, recipe = _campaign(name)
    findings = findings_storage.read(campaign.results)
    page = report_stage.report(findings, recipe.experiment, recipe.title, f"dvc repro report@{name}", campaign.results)
    report_stage.entry(findings, recipe.experiment, recipe.title, campaign)
    say(page.relative_to(campaign.root).as_posix())


def index() -> int:
    """Render the index over all campaigns; 1 where one is rejected."""
    project = Project.around(Path.cwd())
    page, rejected = report_stage.index(project)
    say(page)
    if rejected:
        say(f"rejected: {', '.join(rejected)}; the reports say why.", err=True)
    return 1 if rejected else 0


def _campaign(name: str) -> tuple[Campaign, Recipe]:
    campaign = Project.around(Path.cwd()).campaign(name)
    recipe = load(campaign.recipe)
    return campaign, recipe.shown_as(campaign.recipe.relative_to(campaign.root).as_posix())


def _findings_of(other: str, campaign: Campaign) -> Path:
    return Campaign(other, campaign.root).results / "findings.json"


def _handed_over(other: str, campaign: Campaign) -> identify_stage.Used:
    path = _findings_of(other, campaign)
    if not path.exists():
        raise InputError(
            f"the recipe uses the campaign '{other}', which has no findings yet ({path}); identify it first."
        )
    return identify_stage.used(path, path.relative_to(campaign.root).as_posix())


def _told(findings: Findings, page: Path | None) -> int:
    say(f"{findings.campaign}: {findings.verdict}")
    for reason in told(findings.reasons, (run.run for run in findings.runs)):
        say(f"  {reason}")
    if page is not None:
        say(f"report: {page}")
    return 1 if findings.verdict == "rejected" else 0
