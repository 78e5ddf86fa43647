"""Findings: what identification yields. `findings.json` is these models written out.

The names are a contract with users and other programs: `docs/findings.schema.json` is made from
here. All values are SI; the report converts for reading.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator
from pydantic.functional_validators import BeforeValidator

SCHEMA_VERSION = 1

Verdict = Literal["ok", "warning", "rejected"]
OperatingPoint = dict[str, float | str | bool]


def _finite_or_none(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


Number = Annotated[float | None, BeforeValidator(_finite_or_none)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Parameter(_Strict):
    """One identified number with its interval, or null and the reason in `description`."""

    name: str = Field(description="name as in the experiment's list of parameters")
    symbol: str = Field(description="symbol in the paper, LaTeX")
    value: Number = Field(description="SI; null where the data cannot determine it")
    std_error: Number = Field(None, description="combined standard error (types A and B), SI")
    type_b: Number = Field(
        None, description="the part of std_error that comes from calibrations and stated uncertainties (type B), SI"
    )
    ci95: tuple[float, float] | None = Field(None, description="95 % interval, SI")
    unit: str = Field(description="SI unit; '1' for a ratio")
    at: OperatingPoint = Field(default_factory=dict, description="operating point, SI; {'run': ...} for one run")
    description: str = Field("", description="what it is; of one without a value, why")
    source: str = Field("", description="equation or table of the paper")
    method: str = Field("", description="how it was found")

    @model_validator(mode="after")
    def _undetermined_has_no_error(self) -> Self:
        if self.value is None and (self.std_error is not None or self.ci95 is not None):
            raise ValueError(f"{self.name}: an undetermined parameter carries no interval")
        if self.value is None and not self.description:
            raise ValueError(f"{self.name}: an undetermined parameter needs the reason in its description")
        return self


class ModelResult(_Strict):
    """How one model (variant) fits; exactly one of a family is selected.

    Models of one family were fitted to the same data: only among them do `aicc` and `bic` compare.
    """

    name: str = Field(description="name of the model or variant")
    family: str = Field("", description="what the models compete for; '' where all of the findings do")
    selected: bool = Field(False, description="whether the parameters are those of this one")
    n_parameters: int = Field(description="how many numbers were fitted")
    n_data: int = Field(description="to how many data")
    rms_residual: Number = Field(None, description="root mean square of the residual, in `unit`")
    unit: str = Field("", description="SI unit of rms_residual")
    nrmse: Number = Field(None, description="rms residual over rms of the measured signal about its mean")
    chi2_reduced: Number = Field(
        None, description="chi-square per degree of freedom; 1 where noise explains the misfit"
    )
    aicc: Number = Field(None, description="Akaike's criterion, corrected for few data; less is better")
    bic: Number = Field(None, description="Bayesian criterion; less is better")
    cv_error: Number = Field(None, description="leave-one-run-out prediction error, as nrmse")
    description: str = Field("", description="what the model is")


class Published(_Strict):
    """A number or claim of the paper beside what was found; `agrees` is null where neither can be said.

    `basis` says what `found` was computed from: these logs, or the paper's own numbers alone.
    """

    name: str = Field(description="which number or claim")
    published: float | str | None = Field(description="what the paper says, in `unit`")
    found: float | str | None = Field(description="what was found, in `unit`")
    unit: str = Field("1", description="unit of both")
    where: str = Field("", description="place in the paper")
    agrees: bool | None = Field(None, description="null where neither can be said")
    remark: str = Field("", description="why, or under which conditions")
    basis: Literal["logs", "paper"] = Field("logs", description="'paper': computed without these logs")


class Quality(_Strict):
    """What was noticed about the data: see `pipeline.recording.QualityFinding`."""

    level: Literal["note", "warning", "error"] = Field(
        description="note: harmless; warning: to be read before the numbers are used; error: something was left out"
    )
    run: str | None = Field(None, description="which run; null for all")
    channel: str | None = Field(None, description="which channel; null for none in particular")
    span: tuple[float, float] | None = Field(None, description="from when to when, s since the start of the run")
    message: str = Field(description="what was noticed, in words")


class Run(_Strict):
    """One run: its conditions (SI), whether it was used, and if not why."""

    run: str = Field(description="name of the run")
    used: bool = Field(True, description="whether it was identified")
    reason: str = Field("", description="if not, why")
    conditions: dict[str, float | str | bool] = Field(default_factory=dict, description="by name, SI")
    files: list[str] = Field(default_factory=list, description="its logs")
    sha256: list[str] = Field(default_factory=list, description="their hashes, in the same order")
    duration: Number = Field(None, description="s")
    n_samples: int = Field(0, description="samples of all its streams together")
    begins: Number = Field(None, description="moment of second 0, s since 1970 (UTC); null where the logs bear no date")
    repairs: list[str] = Field(default_factory=list, description="what was mended at ingest, a sentence each")


class _Known:
    """The parameters of one list by name, and by name and run. No part of what findings are: not compared, not copied."""

    def __init__(self) -> None:
        self.told: list[Parameter] = []
        self.count = 0
        self.by_name: dict[str, list[Parameter]] = {}
        self.by_run: dict[tuple[str, object], list[Parameter]] = {}

    def of(self, parameters: list[Parameter], name: str, at: Mapping[str, object]) -> list[Parameter]:
        """Return those of `parameters` that may be meant, in their order."""
        if self.told is not parameters or self.count != len(parameters):
            self.told, self.count, self.by_name, self.by_run = parameters, len(parameters), {}, {}
            for parameter in parameters:
                self.by_name.setdefault(parameter.name, []).append(parameter)
                if "run" in parameter.at:
                    self.by_run.setdefault((parameter.name, parameter.at["run"]), []).append(parameter)
        wanted = at.get("run")
        return self.by_name.get(name, []) if wanted is None else self.by_run.get((name, wanted), [])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[type[_Known], tuple[()]]:
        return _Known, ()


class Findings(_Strict):
    """All that identification of one campaign yields.

    `arrays` (not in the JSON) are tables written beside it as ``arrays/<name>.parquet``: pandas
    DataFrames with SI columns, for figures and for whoever wants to go on.
    """

    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True, populate_by_name=True)

    schema_version: int = Field(
        SCHEMA_VERSION, alias="schema", description="which schema; a higher one may hold other fields"
    )
    campaign: str = Field(description="name of the campaign")
    experiment: str = Field(description="id of the experiment, as mre.shear")
    verdict: Verdict = Field(description="ok: to be used; warning: with reservations; rejected: not to be used")
    reasons: list[str] = Field(default_factory=list, description="one plain sentence each: why this verdict")
    parameters: list[Parameter] = Field(default_factory=list, description="what was identified")
    models: list[ModelResult] = Field(default_factory=list, description="the models that were compared")
    published: list[Published] = Field(default_factory=list, description="numbers of the paper beside those found")
    quality: list[Quality] = Field(default_factory=list, description="what was noticed about the data")
    runs: list[Run] = Field(default_factory=list, description="all runs, also those that were left out")
    advice: list[str] = Field(default_factory=list, description="what to measure or mend next")
    settings: dict[str, Any] = Field(default_factory=dict, description="settings that were used, defaults included")
    calibration: dict[str, dict[str, float]] = Field(
        default_factory=dict,
        description="by channel the standard uncertainties that are carried in: gain_u (relative), offset_u (SI)",
    )
    provenance: dict[str, Any] = Field(
        default_factory=dict, description="versions, and hashes of code, recipe, logs and findings used"
    )
    arrays: dict[str, Any] = Field(default_factory=dict, exclude=True)

    _known: _Known = PrivateAttr(default_factory=lambda: _Known())

    def find(self, name: str, **at: float | str | bool) -> list[Parameter]:
        """Return the parameters of that name whose operating point holds all of `at`.

        With ``run=...`` as fast in a campaign of 10 000 runs as in one of ten.
        """
        return [p for p in self._known.of(self.parameters, name, at) if all(p.at.get(k) == v for k, v in at.items())]

    def one(self, name: str, **at: float | str | bool) -> Parameter:
        """Return the only parameter of that name at that operating point; LookupError otherwise."""
        found = self.find(name, **at)
        if len(found) != 1:
            raise LookupError(f"{len(found)} parameters are called '{name}' at {at}")
        return found[0]
