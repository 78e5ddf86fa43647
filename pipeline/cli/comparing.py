"""`rigfit compare`: two findings, campaigns or revisions held against each other, as a page and in a few lines."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.campaign.project import Project
from pipeline.campaign.revision import PRESENT, Revision
from pipeline.cli.findings_of import findings_of
from pipeline.cli.saying import say
from pipeline.errors import InputError, counted, listing
from pipeline.findings import Findings
from pipeline.findings.comparison import Comparison
from pipeline.findings.comparison import compare as held_against
from pipeline.recording.storage import whole_or_not
from pipeline.report.compare import render_comparison
from pipeline.report.compare_numbers import Compared, moved_most
from pipeline.report.parameters import place_of
from pipeline.report.words import clean
from pipeline.rigs.registry import experiment as find_experiment

_PAGE = "comparison.html"


@dataclass(frozen=True)
class _Side:
    """What a word of the command line names: one findings, or all campaigns of a revision."""

    label: str
    findings: Findings | None = None
    revision: Revision | None = None


def compare(before: str, after: str, out: Path | None) -> None:
    """Write the page that holds `after` against `before`, and say what moved."""
    sides = (_side(before), _side(after))
    pairs, alone = _paired(*sides)
    compared = []
    for old, new in pairs:
        comparison = held_against(old, new)
        compared.append(Compared(comparison, find_experiment(new.experiment)))
    page = out or _default_page()
    if page.is_dir():
        page = page / _PAGE
    command = shlex.join(["rigfit", *sys.argv[1:]])
    with whole_or_not(page) as partial:
        labels = (sides[0].label, sides[1].label)
        partial.write_text(render_comparison(compared, labels, alone, command), encoding="utf-8")
    for one in compared:
        say(_line(one.comparison, one))
    for told in alone:
        say(told)
    say(f"comparison: {page}")


def _default_page() -> Path:
    return Project.around(Path.cwd()).root / "reports" / _PAGE if _in_project() else Path(_PAGE)


def _in_project() -> bool:
    try:
        Project.around(Path.cwd())
    except InputError:
        return False
    return True


def _side(word: str) -> _Side:
    """Find out what a word means: a findings.json or its folder, a campaign, a revision, one campaign of a revision."""
    path = Path(word)
    if path.name == "findings.json" or (path / "findings.json").is_file() or path.suffix == ".json":
        return _Side(word, findings_of(word)[0])
    if not _in_project():
        found = "holds no findings.json" if path.exists() else "there is no such file or folder"
        raise InputError(
            f"{word}: {found}; name a findings.json or the folder of one. Campaigns and revisions can be named within a project only."
        )
    project = Project.around(Path.cwd())
    if (project.root / "recipes" / f"{word}.yaml").is_file():
        return _Side(word, findings_of(word)[0])
    name, colon, campaign = word.rpartition(":")
    if not colon:
        return _Side(word, revision=Revision(project, word))
    revision = Revision(project, name or PRESENT)
    return _Side(word, _told(revision, campaign))


def _told(revision: Revision, campaign: str) -> Findings:
    findings = revision.findings(campaign)
    if findings is None:
        raise InputError(
            f"campaign '{campaign}' has no findings at '{revision.name}': neither Git nor DVC has a reports/{campaign}/findings.json "
            "of then. 'dvc repro' writes dvc.lock; it has to be committed with the rest to be found again."
        )
    return findings


def _paired(before: _Side, after: _Side) -> tuple[list[tuple[Findings, Findings]], list[str]]:
    """Return the findings to compare, and what is said of campaigns that only one side has."""
    if before.findings is not None and after.findings is not None:
        return [(before.findings, after.findings)], []
    if before.revision is None or after.revision is None:
        one = before.findings or after.findings
        revision = before.revision or after.revision
        if one is None or revision is None:
            raise LookupError("a side that is neither findings nor a revision")
        other = _told(revision, one.campaign)
        return [(other, one) if before.revision else (one, other)], []
    return _of_revisions(before.revision, after.revision)


def _of_revisions(before: Revision, after: Revision) -> tuple[list[tuple[Findings, Findings]], list[str]]:
    names = list(dict.fromkeys((*before.campaigns, *after.campaigns)))
    pairs, alone, neither = [], [], []
    for name in names:
        try:
            old, new = (rev.findings(name) if name in rev.campaigns else None for rev in (before, after))
        except InputError as error:  # of one campaign; the others can be compared all the same
            alone.append(f"{name}: {error}")
            continue
        if old is not None and new is not None and old.experiment == new.experiment:
            pairs.append((old, new))
        elif old is not None and new is not None:
            alone.append(
                f"{name}: a campaign of {old.experiment} at {before.name}, of {new.experiment} at {after.name}."
            )
        elif old is None and new is None:
            neither.append(name)
        else:
            alone.append(f"{name}: findings only at {before.name if new is None else after.name}.")
    if neither:
        alone.append(f"{counted(len(neither), 'campaign')} without findings at either: {listing(neither, 3)}.")
    if not pairs:
        raise InputError(
            f"'{before.name}' and '{after.name}' have no campaign in common that has findings at both: {_sentences(alone)} "
            "Results of a revision are found where its dvc.lock was committed."
        )
    return pairs, alone


def _sentences(texts: Sequence[str]) -> str:
    return " ".join(texts[:8]) if texts else "no campaign is listed."


def _line(comparison: Comparison, one: Compared) -> str:
    """Say in one line what became of a campaign."""
    old, new = comparison.before, comparison.after
    name = clean(new.campaign) if old.campaign == new.campaign else f"{clean(old.campaign)} -> {clean(new.campaign)}"
    verdict = new.verdict if old.verdict == new.verdict else f"{old.verdict} -> {new.verdict}"
    changed = comparison.of("changed")
    said = [f"{counted(len(changed), 'parameter')} changed" if changed else "no parameter changed"]
    if most := moved_most(comparison):
        place = place_of(most.parameter, one.experiment)
        said.append(
            f"most {clean(most.parameter.name)}{f' at {place}' if place else ''}, by {most.ratio:+.2g} standard errors"
        )
    for kind in ("new", "gone", "determined now", "not determined now"):
        if count := len(comparison.of(kind)):
            said.append(f"{count} {kind}")
    return f"{name}: {verdict}; {', '.join(said)}"
