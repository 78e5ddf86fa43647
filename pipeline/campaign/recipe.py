"""Recipes: which experiment a campaign is, how its channels are called in the logs, settings.

A recipe is strict: an unknown key, channel, condition or unit is answered with its line and the
nearest known name.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator

from pipeline.campaign import yaml_text
from pipeline.campaign.conditions import condition_value, name_pattern
from pipeline.campaign.recipe_faults import first_fault
from pipeline.errors import InputError, listing, nearest
from pipeline.ingest.mapping import ChannelMap
from pipeline.recording import Condition
from pipeline.recording.units import conversion, number_and_unit, quantity
from pipeline.rigs.calibration import Calibration
from pipeline.rigs.experiment import Experiment, Settings
from pipeline.rigs.registry import experiment as find_experiment


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _one_value(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str):
        raise ValueError("one value: a number, a number with a unit such as '2 A', true or false, or text")
    return value


def _a_number(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("a number")
    return value


def _sign(value: Any) -> Any:
    return {"1": 1, "+1": 1, "-1": -1, "+": 1, "-": -1}.get(value, value) if isinstance(value, str) else value


Scalar = Annotated[Any, BeforeValidator(_one_value)]
Factor = Annotated[float, BeforeValidator(_a_number)]


class ChannelEntry(_Entry):
    """How one canonical channel is found in the logs: ``force: {channel: "Load cell", unit: kN, sign: -1}``."""

    channel: str | None = None
    unit: str | None = None
    sign: Annotated[Literal[1, -1], BeforeValidator(_sign)] = 1
    scale: Factor = 1.0
    offset: Factor = 0.0
    table: str | None = None
    rate: Scalar = None
    stamp: Literal["first", "last"] | None = None
    gain_u: Scalar = None
    offset_u: Scalar = None

    @field_validator("scale")
    @classmethod
    def _scale_keeps_the_signal(cls, value: float) -> float:
        if value == 0 or not math.isfinite(value):
            raise ValueError("a factor other than 0: the logged number times it is in the channel's unit")
        return value


class SyntheticEntry(_Entry):
    """How the example campaign is made: seed, what of the rig's truth is changed, file formats in turn."""

    seed: int = Field(1, ge=0)
    truth: dict[str, Any] = Field(default_factory=dict)
    formats: list[Literal["csv", "mcap"]] = ["csv"]


class RecipeFile(_Entry):
    """A recipe as written; `load` checks it against the experiment that it names."""

    experiment: str
    title: str = ""
    description: str = ""
    channels: dict[str, ChannelEntry] = Field(default_factory=dict)
    conditions: dict[str, Scalar] = Field(default_factory=dict)
    file_name: str | None = None
    exclude: dict[str, str] = Field(default_factory=dict)
    settings: dict[str, Any] = Field(default_factory=dict)
    uses: list[str] = Field(default_factory=list)
    synthetic: SyntheticEntry | None = None

    @field_validator("channels", "conditions", "settings", "exclude", mode="before")
    @classmethod
    def _nothing_below_a_key_is_nothing(cls, value: Any) -> Any:
        return {} if value is None else value

    @field_validator("channels", mode="before")
    @classmethod
    def _a_bare_name_is_the_channel(cls, value: Any) -> Any:
        if isinstance(value, Mapping):
            return {k: {"channel": v} if isinstance(v, str) else v for k, v in value.items()}
        return value

    @field_validator("exclude", mode="before")
    @classmethod
    def _a_bare_list_has_no_reasons(cls, value: Any) -> Any:
        return dict.fromkeys(map(str, value), "excluded by the recipe") if isinstance(value, list) else value


@dataclass(frozen=True)
class Recipe:
    """A checked recipe: the experiment, channel maps, constant conditions in SI, settings."""

    path: str
    experiment: Experiment
    title: str
    description: str
    channels: Mapping[str, ChannelMap]
    calibration: Mapping[str, Calibration]
    conditions: Mapping[str, Condition]
    file_name: str | None
    exclude: Mapping[str, str]
    settings: Settings
    uses: Sequence[str]
    synthetic: SyntheticEntry
    digest: str

    @classmethod
    def default(cls, experiment: Experiment) -> Recipe:
        """Return the recipe for logs that bear the canonical names: everything as the experiment has it."""
        return _checked(RecipeFile(experiment=experiment.id), {}, "", experiment)

    def shown_as(self, path: str) -> Recipe:
        """Return the same recipe with the path that messages and provenance show."""
        return replace(self, path=path)


def load(path: Path, experiment_id: str | None = None) -> Recipe:
    """Read and check a recipe.

    Raises
    ------
    InputError
        For anything unknown, misspelt or of the wrong kind: file, line, what is known. Also where
        the recipe is for another experiment than `experiment_id`.
    """
    content = yaml_text.load(path)
    if "experiment" not in content and experiment_id is not None:
        content["experiment"] = experiment_id
    try:
        written = RecipeFile.model_validate(yaml_text.plain(content))
    except ValidationError as error:
        raise InputError(first_fault(error, content, str(path), RecipeFile)) from error
    if experiment_id is not None and written.experiment != experiment_id:
        raise InputError(
            f"{path} line {yaml_text.line_of(content, ['experiment'])}: this recipe is for "
            f"'{written.experiment}', not for '{experiment_id}'. Name that experiment or another recipe."
        )
    try:
        experiment = find_experiment(written.experiment)
    except InputError as error:
        raise InputError(f"{path} line {yaml_text.line_of(content, ['experiment'])}: {error}") from error
    return _checked(written, content, str(path), experiment)


def _checked(written: RecipeFile, content: Any, path: str, experiment: Experiment) -> Recipe:
    def where(*place: str) -> str:
        line = yaml_text.line_of(content, place)
        return f"{path} line {line}" if line else path

    try:
        settings = experiment.settings.model_validate(written.settings)
    except ValidationError as error:
        raise InputError(first_fault(error, content, path, experiment.settings, ("settings",))) from error
    channels = {
        name: mapped
        for name, entry in written.channels.items()
        if (mapped := _channel_map(name, entry, experiment, where("channels", name))) != ChannelMap()
    }
    calibration = {
        name: _calibration(name, entry, experiment, where("channels", name))
        for name, entry in written.channels.items()
        if entry.gain_u is not None or entry.offset_u is not None
    }
    conditions: dict[str, Condition] = {}
    for name, value in written.conditions.items():
        spec = experiment.condition(name)
        if spec is None:
            known = [spec.name for spec in experiment.conditions]
            raise InputError(
                f"{where('conditions', name)}: {experiment.id} knows no condition '{name}'.{nearest(name, known)} "
                f"Known conditions: {listing(known, 40)}."
            )
        conditions[name] = condition_value(value, spec, f"{where('conditions', name)}, condition '{name}'")
    digest = hashlib.sha256(json.dumps(written.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()
    recipe = Recipe(
        path=path,
        experiment=experiment,
        title=written.title or experiment.title,
        description=written.description,
        channels=channels,
        calibration=calibration,
        conditions=conditions,
        file_name=written.file_name,
        exclude=written.exclude,
        settings=settings,
        uses=tuple(written.uses),
        synthetic=written.synthetic or SyntheticEntry(),
        digest=digest,
    )
    if recipe.file_name is not None:
        name_pattern(replace(recipe, path=where("file_name")))
    return recipe


def _channel_map(name: str, entry: ChannelEntry, experiment: Experiment, where: str) -> ChannelMap:
    spec = experiment.channel(name)
    if spec is None and name != "time":
        known = ["time", *(spec.name for spec in experiment.channels)]
        raise InputError(
            f"{where}: {experiment.id} knows no channel '{name}'.{nearest(name, known)} "
            f"Known channels: {listing(known, 40)}. Left of the colon stands the rig's name, right of it the log's."
        )
    for key, value in (("rate", entry.rate), ("stamp", entry.stamp)):
        if spec is not None and value is not None:
            raise InputError(
                f"{where}, channel '{name}': '{key}' is for 'time' only, which all channels of a table share. "
                f"Write `time: {{{key}: {value}}}`, or leave it out."
            )
    si_unit = "s" if spec is None else spec.unit
    if entry.unit is not None and si_unit:
        conversion(entry.unit, si_unit, f"{where}, channel '{name}'")
    rate = None if entry.rate is None else quantity(entry.rate, "Hz", f"{where}, rate")
    if rate is not None and (isinstance(entry.rate, bool) or not 0 < rate < math.inf):
        raise InputError(f"{where}: rate must be a frequency above 0, as '5 kHz'; found {entry.rate}.")
    return ChannelMap(
        channel=entry.channel,
        unit=entry.unit,
        sign=float(entry.sign),
        scale=entry.scale,
        offset=entry.offset,
        table=entry.table,
        rate=rate,
        stamp=entry.stamp,
    )


def _calibration(name: str, entry: ChannelEntry, experiment: Experiment, where: str) -> Calibration:
    """Return the standard uncertainties of a channel's gain and offset, SI."""
    spec = experiment.channel(name)
    if spec is None or not spec.unit:
        raise InputError(
            f"{where}, channel '{name}': 'gain_u' and 'offset_u' are for channels that are measured and carry a unit; "
            f"'{name}' does not. Leave them out."
        )
    gain = 0.0 if entry.gain_u is None else quantity(entry.gain_u, "1", f"{where}, gain_u")
    if isinstance(entry.gain_u, bool) or not 0 <= gain < 0.5:
        raise InputError(
            f"{where}: gain_u is the relative standard uncertainty of the channel's gain, from 0 up to 50 %, as '0.5 %' or "
            f"0.005; found {entry.gain_u}."
        )
    offset = _offset_u(entry, spec.unit, where)
    if spec.limit is not None and offset > spec.limit:
        raise InputError(
            f"{where}: offset_u {entry.offset_u} is more than '{name}' itself can plausibly be ({spec.limit:g} {spec.unit}); check its unit."
        )
    return Calibration(gain, offset)


def _offset_u(entry: ChannelEntry, unit: str, where: str) -> float:
    if entry.offset_u is None:
        return 0.0
    value, own = number_and_unit(str(entry.offset_u)) or (math.nan, "")
    if isinstance(entry.offset_u, bool) or not 0 <= value < math.inf or (not own and unit != "1" and value):
        raise InputError(
            f"{where}: offset_u is the standard uncertainty of the channel's offset, a number of 0 or more with its unit, as "
            f"'2 {unit}'; found {entry.offset_u}."
        )
    # An uncertainty is a difference: of units with a zero of their own (degC) only the size counts.
    return value * conversion(own, unit, f"{where}, offset_u").factor if own else value
