"""The project a user works in: where its folders are, which campaigns it lists, how one is added."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.campaign import yaml_text
from pipeline.campaign.logs import RUNS_TABLE
from pipeline.errors import InputError, listing, nearest
from pipeline.recording.storage import whole_or_not
from pipeline.rigs.experiment import Experiment


@dataclass(frozen=True)
class Project:
    """A folder with `params.yaml`, `dvc.yaml`, `recipes/`, `datasets/`."""

    root: Path

    @classmethod
    def around(cls, start: Path) -> Project:
        """Return the project that `start` lies in.

        Raises
        ------
        InputError
            If neither it nor a folder above it is one.
        """
        for folder in (start, *start.parents):
            if (folder / "params.yaml").is_file() and (folder / "dvc.yaml").is_file():
                return cls(folder)
        raise InputError(
            f"{start}: not inside a rigfit project (no params.yaml and dvc.yaml here or above); change to the "
            "project's folder, or use 'rigfit run EXPERIMENT LOG... --out DIR', which needs none."
        )

    def campaigns(self) -> list[str]:
        """Return the campaigns that `params.yaml` lists."""
        listed = yaml_text.load(self.root / "params.yaml").get("campaigns") or []
        if not isinstance(listed, list):
            raise InputError(f"{self.root / 'params.yaml'}: 'campaigns' must be a list of names.")
        return [str(name) for name in listed]

    def not_handed_over(self, name: str, uses: Sequence[str]) -> list[str]:
        """Return which of the campaigns that `name` uses `params.yaml` does not list, so that DVC cannot know."""
        listed = yaml_text.load(self.root / "params.yaml").get("uses") or []
        pairs = [(str(e.get("campaign")), str(e.get("of"))) for e in listed if isinstance(e, dict)]
        return [other for other in uses if (name, other) not in pairs]

    def campaign(self, name: str) -> Campaign:
        """Return the paths of one campaign.

        Raises
        ------
        InputError
            If it has no recipe; names the nearest campaign.
        """
        campaign = Campaign(name, self.root)
        if not campaign.recipe.is_file():
            known = sorted(path.stem for path in (self.root / "recipes").glob("*.yaml"))
            raise InputError(
                f"there is no campaign '{name}' (recipes/{name}.yaml is missing).{nearest(name, known)} "
                f"Campaigns here: {listing(known)}. 'rigfit new EXPERIMENT {name}' makes one."
            )
        return campaign

    def add(self, name: str, experiment: Experiment, title: str) -> Campaign:
        """Make recipe and folder of a new campaign and list it in `params.yaml`.

        Raises
        ------
        InputError
            If the name is taken or cannot be a file name.
        """
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
            raise InputError(f"'{name}' cannot be a campaign's name: use letters, digits, '-' and '_'.")
        campaign = Campaign(name, self.root)
        if campaign.recipe.exists() or name in self.campaigns():
            raise InputError(f"there is a campaign '{name}' already (recipes/{name}.yaml); choose another name.")
        campaign.logs.mkdir(parents=True, exist_ok=True)
        (campaign.logs / ".gitkeep").touch()
        campaign.recipe.parent.mkdir(exist_ok=True)
        with whole_or_not(campaign.recipe) as path:
            path.write_text(recipe_template(experiment, title or name), encoding="utf-8")
        self._list(name)
        return campaign

    def _list(self, name: str) -> None:
        """Add a line to the list in `params.yaml`; all else in it, comments too, stays as it is."""
        path = self.root / "params.yaml"
        listed = yaml_text.load(path).get("campaigns")
        lines = path.read_text(encoding="utf-8").splitlines()
        if listed and not listed.fa.flow_style():
            last = listed.lc.item(len(listed) - 1)[0]
            lines.insert(last + 1, re.sub(r"-\s*.*", f"- {name}", lines[last], count=1))
        else:
            names = ", ".join([*map(str, listed or ()), name])
            entry = f"campaigns: [{names}]"
            at = next((i for i, line in enumerate(lines) if re.match(r"campaigns\s*:", line)), None)
            lines = [*lines, entry] if at is None else [*lines[:at], entry, *lines[at + 1 :]]
        with whole_or_not(path) as partial:
            partial.write_text("\n".join(lines) + "\n", encoding="utf-8")


@dataclass(frozen=True)
class Campaign:
    """Where the parts of one campaign lie."""

    name: str
    root: Path

    @property
    def recipe(self) -> Path:
        """The recipe."""
        return self.root / "recipes" / f"{self.name}.yaml"

    @property
    def logs(self) -> Path:
        """The folder that logs are dropped into."""
        return self.root / "datasets" / self.name

    @property
    def runs_table(self) -> Path:
        """Conditions per run, optional."""
        return self.logs / RUNS_TABLE

    @property
    def synthetic(self) -> Path:
        """Logs of the synthetic rig, made by DVC."""
        return self.logs / "synthetic"

    @property
    def recordings(self) -> Path:
        """What ingest writes."""
        return self.root / "recordings" / self.name

    @property
    def results(self) -> Path:
        """What identification and the report write."""
        return self.root / "reports" / self.name

    @property
    def index_entry(self) -> Path:
        """What the index shows of this campaign."""
        return self.root / "reports" / "entries" / f"{self.name}.json"


def recipe_template(experiment: Experiment, title: str) -> str:
    """Return the text of a new recipe: every channel, condition and setting of the experiment, explained."""
    lines = [
        f"# Recipe of a campaign of {experiment.id}: {experiment.title}",
        f"experiment: {experiment.id}",
        f"title: {_quoted(title)}",
        "",
        "# Left the rig's name, right what the logs call it. A log that uses the rig's names and declares its",
        '# units needs no entry. Example:  force: {channel: "Load cell", unit: kN, sign: -1}',
        "channels:",
        "#  time: {channel: Time, unit: s}        # or {rate: 5 kHz} where the logs have no time",
    ]
    for channel in experiment.channels:
        need = "" if channel.required else " (optional)"
        lines.append(
            f"#  {channel.name}: {{channel: ..., unit: {channel.unit or 'text'}}}   # {channel.description}{need}"
        )
    lines += [
        "",
        "# Constants of all runs. Per run: a column in runs.csv, or a comment line or metadata in the log.",
        "conditions:",
    ]
    for condition in experiment.conditions:
        need = "" if condition.required else " (optional)"
        value = f"... {condition.unit}" if condition.unit not in ("", "1") else "..."
        lines.append(f"#  {condition.name}: {value}   # {condition.description}{need}")
    numeric = next((spec for spec in experiment.conditions if spec.unit not in ("", "1")), None)
    if numeric is not None:
        example = f"run1_{{{numeric.name}:{numeric.unit}}}"
        lines += ["", "# Conditions that stand in the logs' file names:", f'# file_name: "{example}"']
    if experiment.builds_on:
        lines += [
            "",
            f"# Campaigns of {' and '.join(experiment.builds_on)} whose findings this one uses. Name them in params.yaml too,",
            "# so that DVC keeps the order:  uses: [{campaign: this-one, of: my-other-campaign}]",
            "# uses: [my-other-campaign]",
        ]
    lines += ["", "settings:"]
    for name, field in experiment.settings.model_fields.items():
        lines.append(f"#  {name}: {_yaml(field.default)}   # {field.description or ''}".rstrip())
    return "\n".join(lines) + "\n"


def _yaml(value: object) -> str:
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
