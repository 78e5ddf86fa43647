"""Findings -> report.html, the campaign's entry for the index, and the index over all campaigns."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from pydantic import ValidationError

from pipeline.campaign.code_digest import code_digest, code_revision
from pipeline.campaign.project import Campaign, Project
from pipeline.errors import InputError
from pipeline.findings import Findings
from pipeline.recording.storage import whole_or_not
from pipeline.report.index import IndexEntry, index_entry, render_index
from pipeline.report.page import render_report
from pipeline.rigs.experiment import Experiment


def report(findings: Findings, experiment: Experiment, title: str, command: str, folder: Path) -> Path:
    """Write ``report.html`` into `folder`.

    Raises
    ------
    InputError
        If the findings are another experiment's, or their settings none of it.
    """
    _refuse_foreign(findings, experiment)
    page = folder / "report.html"
    with whole_or_not(page) as partial:
        made = render_report(findings, experiment, title, command, _revision(findings))
        partial.write_text(made, encoding="utf-8")
    return page


def _revision(findings: Findings) -> str:
    """Return what Git calls the code of these findings, '' where it is not the code that lies here."""
    return code_revision() if findings.provenance.get("code_sha256") == code_digest() else ""


def _refuse_foreign(findings: Findings, experiment: Experiment) -> None:
    try:
        experiment.settings.model_validate(findings.settings)
        fault = "" if findings.experiment == experiment.id else f"they are of '{findings.experiment}'"
    except ValidationError as error:
        first = error.errors()[0]
        fault = f"settings.{'.'.join(map(str, first['loc']))}: {first['msg']}"
    if fault:
        raise InputError(
            f"the findings of '{findings.campaign}' are not as {experiment.id} writes them: {fault}. Run 'rigfit identify "
            f"{findings.campaign}' again."
        )


def entry(findings: Findings, experiment: Experiment, title: str, campaign: Campaign) -> Path:
    """Write what the index needs of one campaign; DVC cannot let a stage depend on a list of files, but on a folder."""
    content = asdict(index_entry(findings, experiment, title, f"{campaign.name}/report.html"))
    with whole_or_not(campaign.index_entry) as partial:
        partial.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return campaign.index_entry


def index(project: Project) -> tuple[Path, list[str]]:
    """Write ``reports/index.html``; return its path and the campaigns that are rejected.

    Raises
    ------
    InputError
        If what a report left for the index is damaged.
    """
    entries = []
    for name in project.campaigns():
        path = Campaign(name, project.root).index_entry
        if path.is_file():
            entries.append(_entry_of(path))
    page = project.root / "reports" / "index.html"
    with whole_or_not(page) as partial:
        partial.write_text(render_index(entries), encoding="utf-8")
    return page, [entry.name for entry in entries if entry.verdict == "rejected"]


def _entry_of(path: Path) -> IndexEntry:
    try:
        return IndexEntry(**json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, TypeError) as error:
        raise InputError(
            f"{path}: is damaged ({error}); run 'rigfit report {path.stem}', which writes it anew."
        ) from error
