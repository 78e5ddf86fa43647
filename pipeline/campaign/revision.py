"""A state of the project that Git and DVC know: a commit, branch, tag or `dvc exp` experiment, and the findings of then."""

from __future__ import annotations

import logging
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

from pipeline.campaign import yaml_text
from pipeline.campaign.project import Project
from pipeline.errors import InputError, listing, nearest
from pipeline.findings import Findings
from pipeline.findings.storage import parse, read

PRESENT = "workspace"  # as DVC calls the files as they lie here


class Revision:
    """The findings of a project as they were at one revision, ``workspace`` as they are now.

    Results are outputs of DVC: what a revision says of them stands in its dvc.lock, the bytes in DVC's cache or, with
    credentials, in its remote.

    Parameters
    ----------
    project
        The project; its folder must be under Git and DVC for a revision.
    name
        What Git or DVC call it: ``HEAD~1``, a branch, a tag, a hash, the name of an experiment.

    Raises
    ------
    InputError
        If there is no such revision, or the project is not under Git and DVC.
    """

    def __init__(self, project: Project, name: str) -> None:
        self.project, self.name = project, name
        self._files: Any = None
        if name != PRESENT:
            self._files, self._place = _files_of(project, name)

    @cached_property
    def campaigns(self) -> list[str]:
        """The campaigns that params.yaml lists there."""
        if self._files is None:
            return self.project.campaigns()
        content = self._bytes("params.yaml")
        shown = f"params.yaml at {self.name}"
        if content is None:
            raise InputError(f"{shown}: there is none; that revision is no rigfit project.")
        listed = yaml_text.loads(content.decode(errors="replace"), shown).get("campaigns") or []
        return [str(name) for name in listed] if isinstance(listed, list) else []

    def findings(self, campaign: str) -> Findings | None:
        """Return the findings of a campaign without arrays, None where it has none there.

        Raises
        ------
        InputError
            If it is no campaign there, or its findings cannot be had or read.
        """
        if campaign not in self.campaigns:
            raise InputError(
                f"there is no campaign '{campaign}' at '{self.name}'.{nearest(campaign, self.campaigns)} Campaigns there: "
                f"{listing(self.campaigns)}."
            )
        path = f"reports/{campaign}/findings.json"
        if self._files is None:
            place = self.project.root / path
            return read(place) if place.is_file() else None
        content = self._bytes(path)
        return None if content is None else parse(content, f"{path} at {self.name}")

    def _bytes(self, path: str) -> bytes | None:
        """Return the bytes of a file, None where that revision has none."""
        from dvc.exceptions import DvcException

        try:
            place = (self._place / path).as_posix()
            if not self._files.exists(place):
                return None
            kept = self._files.info(place).get("dvc_info")
            if kept and not kept.get("md5"):
                return None  # named in dvc.yaml, and never made by then
            return bytes(self._files.read_bytes(place))
        except FileNotFoundError as error:
            raise InputError(
                f"{path} at '{self.name}': DVC knows its hash, but its bytes are not in the cache here ({error}). "
                f"'dvc fetch --all-commits' brings them from the remote, if they were pushed there; else 'git checkout {self.name}' "
                "and 'dvc repro' make them anew."
            ) from error
        except (DvcException, OSError) as error:
            raise InputError(f"{path} at '{self.name}': cannot be read ({error}).") from error


def _files_of(project: Project, name: str) -> tuple[Any, PurePosixPath]:
    """Return the file system of DVC at a revision, and where in it the project lies: it may be a folder of its repository."""
    from dvc.api import DVCFileSystem
    from dvc.exceptions import DvcException, NotDvcRepoError
    from dvc.scm import RevError, SCMError

    logging.getLogger("dvc").setLevel(logging.CRITICAL)  # what it has to say is said in our words
    try:
        files = DVCFileSystem(str(project.root), rev=name, subrepos=True)
        top = Path(files.repo.scm.root_dir).resolve()  # the repository is opened when it is first asked for
        return files, PurePosixPath("/", project.root.resolve().relative_to(top).as_posix())
    except RevError as error:
        raise InputError(
            f"'{name}': no revision of this project, nor one of its campaigns, nor a findings.json or its folder. A revision is "
            f"what 'git log' or 'dvc exp show' list, '{PRESENT}' the files as they lie here; REV:CAMPAIGN means one campaign of it."
        ) from error
    except (NotDvcRepoError, SCMError) as error:
        raise InputError(
            f"{project.root}: is not under Git and DVC, so that it has no revision '{name}' ({error}). Name campaigns, or a "
            "findings.json or its folder."
        ) from error
    except DvcException as error:
        raise InputError(f"'{name}': DVC cannot open that revision ({error}).") from error
