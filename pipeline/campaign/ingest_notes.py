"""What ingest says of a campaign's logs as a whole, and of those that cannot be read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from pipeline.campaign.logs import RunFiles, said_shared
from pipeline.campaign.recipe import Recipe
from pipeline.campaign.runs_table import RunsTable
from pipeline.errors import counted, listing, nearest
from pipeline.recording import QualityFinding


def of_campaign(recipe: Recipe, runs: Sequence[RunFiles], table: RunsTable | None) -> list[QualityFinding]:
    """Return what is odd about the runs' names, the table of conditions, and what the recipe excludes."""
    names = {entry.run: [path.name for _, path in entry.files] for entry in runs}
    notes = [*said_shared(runs), *(table.remarks(names) if table else [])]
    for run, reason in recipe.exclude.items():
        if run in names:
            notes.append(QualityFinding("note", f"left out by the recipe: {reason}", run))
        else:
            notes.append(
                QualityFinding(
                    "warning",
                    f"{recipe.path}: excludes '{run}', which is no run here.{nearest(run, names)} "
                    f"The runs are {listing(names)}.",
                )
            )
    return notes


def nothing_read(wanted: Sequence[RunFiles], failed: Mapping[str, str], recipe: Recipe) -> str:
    """Say why no log could be read: `failed` is run -> reason."""
    if not wanted:
        return f"{recipe.path}: every run is excluded; take at least one out of 'exclude'."
    (first, message), *others = failed.items()
    if not others:
        return message
    alike = [run for run, other in others if other.replace(run, first) == message]
    unlike = [(run, other) for run, other in others if run not in alike]
    told = f" The same holds for {listing(alike, 8)}." if alike else ""
    told += "".join(f" {other}" for _, other in unlike[:2])
    if len(unlike) > 2:
        told += f" {counted(len(unlike) - 2, 'more log')} cannot be read either: {listing((run for run, _ in unlike[2:]), 8)}."
    return f"None of {len(failed)} logs can be read. {message}{told}"


def read_to_death(shown: Iterable[str]) -> str:
    """Say of the logs of a run that the process that read them was killed."""
    return (
        f"{listing(shown)}: the process that read it was killed: the file is damaged in a way that crashes the library for its "
        "format, or there was too little memory. Write or copy the log again, or take it out with 'exclude' in the recipe."
    )
