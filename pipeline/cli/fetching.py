"""`rigfit fetch`: the logs of a campaign that lie elsewhere come here."""

from __future__ import annotations

from pathlib import Path

from pipeline.campaign.project import Project
from pipeline.campaign.remote.mirror import mirror
from pipeline.campaign.remote.source import Source
from pipeline.campaign.remote.urls import secrets, shown
from pipeline.cli.progress import progress
from pipeline.cli.saying import say
from pipeline.errors import InputError, counted, listing


def fetch(name: str) -> None:
    """Bring the logs of a campaign here that `params.yaml` gives a URL."""
    project = Project.around(Path.cwd())
    campaign = project.campaign(name)
    url = project.dataset(name)
    if secrets(url):
        say(
            f"warning: params.yaml: the URL of '{name}' holds a user, a password or a signature, and that file is kept under "
            "version control; take them out, they are taken from the environment (docs/logs.md).",
            err=True,
        )
    try:
        done = mirror(Source(url, project.root), campaign.fetched, lambda number: progress("fetch", number))
    except InputError as error:
        raise InputError(f"{name}: {error} Recordings and reports are as they were.") from error
    folder = f"{campaign.fetched.relative_to(project.root).as_posix()}/"
    if done.foreign:
        say(
            f"warning: {folder}: {listing(done.foreign, 8)} did not come from {shown(url)}; it is kept and counts as a log. Logs "
            f"of your own belong into {campaign.logs.relative_to(project.root).as_posix()}/.",
            err=True,
        )
    if done.unmarked:
        say(
            f"note: {shown(url)} tells neither hash nor time of {counted(len(done.unmarked), 'log')}; such logs are fetched each "
            "time.",
            err=True,
        )
    say(
        f"{shown(url)}: {counted(len(done.fetched), 'log')} fetched, {len(done.removed)} removed, {len(done.kept)} as before; "
        f"in {folder}"
    )
