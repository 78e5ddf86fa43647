"""`rigfit list`."""

from __future__ import annotations

from pathlib import Path

from pipeline.campaign.project import Project
from pipeline.campaign.recipe import load
from pipeline.cli.saying import say
from pipeline.errors import InputError
from pipeline.rigs.registry import all_experiments


def show(folder: Path) -> None:
    """Print experiments and, inside a project, its campaigns."""
    say("Experiments:")
    for id_, experiment in all_experiments().items():
        say(f"  {id_:<18} {experiment.title}")
    try:
        project = Project.around(folder)
    except InputError:
        return
    say("Campaigns:")
    for name in project.campaigns():
        try:
            recipe = load(project.campaign(name).recipe)
            say(f"  {name:<18} {recipe.experiment.id}: {recipe.title}")
        except InputError as error:
            say(f"  {name:<18} {error}")
