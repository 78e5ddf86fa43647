"""The project a user works in: where its folders are, which campaigns it lists, how one is added."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.campaign import yaml_text
from pipeline.campaign.logs import RUNS_TABLE
from pipeline.campaign.remote.urls import secrets, shown
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

    def uses(self) -> list[tuple[str, str]]:
        """Return the pairs of `params.yaml` of a campaign and one whose findings it builds on."""
        listed = yaml_text.load(self.root / "params.yaml").get("uses") or []
        return [(str(e.get("campaign")), str(e.get("of"))) for e in listed if isinstance(e, dict)]

    def not_handed_over(self, name: str, uses: Sequence[str]) -> list[str]:
        """Return which of the campaigns that `name` uses `params.yaml` does not list, so that DVC cannot know."""
        pairs = self.uses()
        return [other for other in uses if (name, other) not in pairs]

    def dataset(self, name: str) -> str:
        """Return the URL that `params.yaml` gives the logs of a campaign.

        Raises
        ------
        InputError
            If it gives none.
        """
        path = self.root / "params.yaml"
        content = yaml_text.load(path)
        listed = content.get("datasets") or {}
        expected = f"'datasets: {{{name}: s3://bucket/logs}}' or any other URL of fsspec"
        if not isinstance(listed, dict):
            raise InputError(
                f"{path} line {yaml_text.line_of(content, ['datasets'])}: 'datasets' must say of campaigns where their logs lie: "
                f"{expected}."
            )
        if name not in listed:
            raise InputError(
                f"{path}: 'datasets' gives no URL for the campaign '{name}', so its logs are those in datasets/{name}/. "
                f"Expected is {expected}, if they lie elsewhere."
            )
        url = listed[name]
        if not isinstance(url, str) or not url.strip():
            line = yaml_text.line_of(content, ["datasets", name])
            raise InputError(f"{path} line {line}: '{name}' has no URL; expected is {expected}.")
        return str(url).strip()

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

    def add(self, name: str, experiment: Experiment, title: str, dataset: str = "") -> Campaign:
        """Make recipe and folder of a new campaign and list it in `params.yaml`, with the URL of its logs if they lie elsewhere.

        Raises
        ------
        InputError
            If the name is taken or cannot be a file name, or the URL holds a password.
        """
        if secrets(dataset):
            raise InputError(
                f"{shown(dataset)}: the URL holds a user, a password or a signature, and params.yaml is no place for these: it "
                "is kept under version control. Leave them out; they are taken from the environment (docs/logs.md)."
            )
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
            raise InputError(f"'{name}' cannot be a campaign's name: use letters, digits, '-' and '_'.")
        campaign = Campaign(name, self.root)
        if campaign.recipe.exists() or name in self.campaigns():
            raise InputError(f"there is a campaign '{name}' already (recipes/{name}.yaml); choose another name.")
        path = self.root / "params.yaml"
        if dataset:
            yaml_text.add(path, "datasets", name, dataset)
        yaml_text.add(path, "campaigns", name)
        campaign.logs.mkdir(parents=True, exist_ok=True)
        (campaign.logs / ".gitkeep").touch()
        campaign.recipe.parent.mkdir(exist_ok=True)
        with whole_or_not(campaign.recipe) as recipe:
            recipe.write_text(recipe_template(experiment, title or name), encoding="utf-8")
        return campaign


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
    def fetched(self) -> Path:
        """Logs of elsewhere, made by DVC."""
        return self.logs / "fetched"

    def runs_table(self) -> Path | None:
        """Return the table of conditions per run, if there is one: dropped beside the logs, or fetched with them.

        Raises
        ------
        InputError
            If there are both.
        """
        tables = [path for path in (self.logs / RUNS_TABLE, self.fetched / RUNS_TABLE) if path.is_file()]
        if len(tables) > 1:
            own, fetched = (path.relative_to(self.root).as_posix() for path in tables)
            raise InputError(
                f"{own} and {fetched}: there are two tables of conditions, one dropped here and one fetched with the logs; keep "
                "one: remove the one here, or the one at the URL."
            )
        return next(iter(tables), None)

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
        "# What a calibration leaves uncertain (k = 1) goes into every interval: gain_u: 0.5 %, offset_u: 2 N",
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
