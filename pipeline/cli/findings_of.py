"""The findings that a word of the command line names: a campaign of this project, or a findings.json or its folder."""

from __future__ import annotations

from pathlib import Path

from pipeline.campaign.project import Project
from pipeline.errors import InputError
from pipeline.findings import Findings, storage


def findings_of(campaign: str) -> tuple[Findings, Path]:
    """Return the findings and the folder that they lie in.

    Raises
    ------
    InputError
        If the campaign is unknown or has none yet, or the file holds none.
    """
    path = Path(campaign)
    if path.name == "findings.json" or (path / "findings.json").is_file():
        return storage.read(path), path if path.is_dir() else path.parent
    if path.suffix == ".json" or len(path.parts) > 1:
        raise InputError(
            f"{campaign}: there is no findings.json, nor a folder that holds one. Name one, or a campaign of this project."
        )
    results = Project.around(Path.cwd()).campaign(campaign).results
    if not (results / "findings.json").is_file():
        raise InputError(
            f"campaign '{campaign}' has no findings yet ({results}); run 'dvc repro' or 'rigfit identify {campaign}' first."
        )
    return storage.read(results), results
