"""What an experiment declares. A rig is a folder that exports ``EXPERIMENTS``, a tuple of these.

Everything else (reading, mapping, checking, storing, reporting, DVC) is shared and asks only these
declarations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol, TypeVar, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator

from pipeline.findings import Findings
from pipeline.findings.figures import Section
from pipeline.findings.signals import Signals
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.advice import Advice


class Settings(BaseModel):
    """Base of all settings: an unknown key is an error, which names the nearest known one.

    Numbers are finite; what else they can be, a `Range` says.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _true_is_no_number(cls, value: Any, info: ValidationInfo) -> Any:
        annotation = cls.model_fields[info.field_name or ""].annotation
        if isinstance(value, bool) and bool not in (annotation, *get_args(annotation)):
            raise ValueError("a number or a word, not true or false")
        return value


@dataclass(frozen=True)
class Range:
    """What a number can be, in SI: from `least` to `most`; `above` leaves out `least` itself.

    Of a condition it is the spec's `range`, of a setting it stands in its type:
    ``force_lag: Annotated[float, AfterValidator(Range(-0.1, 0.1).checked)]``.
    """

    least: float = -math.inf
    most: float = math.inf
    above: bool = False
    whole: bool = False

    def __contains__(self, value: float) -> bool:
        low = value > self.least if self.above else value >= self.least
        return math.isfinite(value) and low and value <= self.most and (not self.whole or value == int(value))

    def told(self, unit: str = "") -> str:
        """Return the range in words: ``"a whole number from 1 to 8"``, ``"more than 0 up to 1 m"``."""
        unit = "" if unit in ("", "1") else f" {unit}"
        low = f"more than {self.least:g}" if self.above else f"from {self.least:g}"
        ends = f"{low} {'up ' if self.above else ''}to {self.most:g}{unit}"
        if math.isinf(self.most):
            ends = f"{low}{unit}" if self.above else f"{self.least:g}{unit} or more"
        if math.isinf(self.least):
            ends = "finite" if math.isinf(self.most) else f"{self.most:g}{unit} or less"
        return f"a whole number, {ends}" if self.whole else ends

    def checked(self, value: float) -> float:
        """Return `value`; ValueError where it is outside."""
        if value not in self:
            raise ValueError(self.told())
        return value


@dataclass(frozen=True)
class ChannelSpec:
    """A channel that a run carries: canonical name, SI unit ('' for text), what it is and its sign.

    `limit` is the largest magnitude (SI) that is physically plausible; beyond it a wrong unit is
    suspected and said. `counts_samples` marks a counter by which the rig knows what was lost on the way: whether the
    gaps of its stream matter is then for the rig to say. `lists_entries` marks what makes its table a list of entries
    (events, samples of a culture): rows of the same time are all kept, and how evenly they come is not judged. `no_value` is
    a number (SI) that stands where nothing could be measured, and which the rig expects. `may_rest` marks what is set, counted or
    switched, not measured: it may stand still, at the end of its range too.
    """

    name: str
    unit: str
    description: str
    required: bool = True
    limit: float | None = None
    counts_samples: bool = False
    lists_entries: bool = False
    no_value: float | None = None
    may_rest: bool = False


@dataclass(frozen=True)
class ConditionSpec:
    """A condition of a run: name, SI unit ('' for text), what it is; `default` where it may be missing.

    A number outside `range` (SI) is refused wherever it is given. `read_as` is the unit in which the report shows it where
    that is no SI unit: 'degC', 'km/h', '%'.
    """

    name: str
    unit: str
    description: str
    required: bool = False
    default: float | str | bool | None = None
    range: Range = Range()
    read_as: str = ""


@dataclass(frozen=True)
class ParameterSpec:
    """A name that may stand in the findings: symbol (LaTeX), SI unit, meaning, equation.

    `key` marks the few that stand on top of the report; with `key_at` only those whose operating
    point has that entry do. `read_as` is the unit in which the report shows it where that is no SI unit: '%', 'mL/min'.
    """

    name: str
    symbol: str
    unit: str
    description: str
    source: str = ""
    key: bool = False
    key_at: str = ""
    read_as: str = ""


@dataclass(frozen=True)
class Equation:
    """An equation of an experiment's model: LaTeX, what it says, where it stands in the source."""

    latex: str
    about: str
    source: str = ""


@dataclass(frozen=True)
class Reference:
    """A source to cite, also as BibTeX."""

    key: str
    authors: str
    title: str
    journal: str
    year: int
    volume: str = ""
    pages: str = ""
    doi: str = ""
    note: str = ""


def _untold(_share: float, _what: str) -> None:
    """Tell nobody how far identification is."""


Result = TypeVar("Result")


class Each(Protocol):
    """Does independent work on runs, wherever the user wants it done: here, on all cores, on a cluster."""

    def __call__(
        self, function: Callable[..., Result], tasks: Sequence[tuple[Any, ...]], seconds: float
    ) -> Iterable[Result]:
        """Yield ``function(*task)`` for each task, in order, each as soon as it and those before it are done.

        `function` stands in a module, and it, its arguments and what it returns can be pickled; recordings of a campaign
        can, and are read where the work is done. `seconds` is about what all the work costs one core: little work is
        not sent away.
        """


def in_turn(function: Callable[..., Result], tasks: Sequence[tuple[Any, ...]], seconds: float) -> Iterable[Result]:
    """Do the work here, one task after the other; see `Each`."""
    del seconds
    return (function(*task) for task in tasks)


@dataclass(frozen=True)
class Context:
    """What identification may know besides the recordings: the campaign's name, findings that it uses.

    ``progress(share, what)`` tells the user how much of the whole is done, from 0 to 1, and what is being done; an
    experiment that takes seconds need not call it. ``each(function, tasks, seconds)`` does work on single runs in
    parallel, see `Each`; the findings do not depend on where it was done.
    """

    campaign: str
    uses: Mapping[str, Findings]
    progress: Callable[[float, str], None] = _untold
    each: Each = in_turn


@dataclass(frozen=True)
class Later:
    """A function that is imported when it is first called, so that listing experiments stays fast.

    `address` is where it stands, as ``pipeline.rigs.mre.shear.identify:identify``.
    """

    address: str

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        return self.function(*arguments)

    @property
    def function(self) -> Callable[..., Any]:
        """The function itself."""
        module, _, name = self.address.partition(":")
        found: Callable[..., Any] = getattr(import_module(module), name)
        return found


class Follower(Protocol):
    """An online method along one record, fed as the samples come in."""

    channels: Sequence[str]
    """The channels of one stream that it needs."""

    def heading(self) -> Sequence[str]:
        """Return the lines that stand above those of `say`."""

    def feed(self, time: np.ndarray, values: Sequence[np.ndarray]) -> None:
        """Take the next samples: time (s) and the channels in their order, SI, shape (n,) each, NaN where not measured."""

    def say(self) -> str:
        """Return what is known by now, in one line."""

    def finish(self) -> Sequence[str]:
        """Say that the record is over; return what is to be said at its end."""


@dataclass(frozen=True)
class Experiment:
    """One kind of test on a rig.

    Attributes
    ----------
    identify
        ``identify(recordings, settings, context) -> Findings``; raises InputError where nothing can
        be identified at all. It fills verdict, reasons, parameters, models, published, quality (its
        own findings; those of ingest are added by the caller), runs left out, advice and arrays.
    synthesize
        ``synthesize(truth, seed) -> recordings``; `truth` overrides the rig's known parameters.
    sections
        ``sections(findings) -> chapters of the report``; draws on parameters and arrays only.
    methods
        ``methods(findings) -> paragraphs`` for the report and for a paper.
    operating
        What stands in `at` of the parameters besides conditions and channels: its unit and meaning.
    check
        ``check(recording) -> quality findings`` that only this rig's physics can tell (swapped
        signs, wrong units), for `rigfit check` and ingest: in the words of `identify`, an error where that
        leaves the run out. Raises InputError where this run alone leaves nothing to identify.
    live
        ``live(recording, settings)`` makes what follows that record while it comes in (`Follower`), for
        `rigfit run --live`: it looks at conditions and channel names only. None where the experiment has no such method.
    builds_on
        Ids of the experiments of whose campaigns it can use the findings (`Context.uses`).
    reads_blocks
        Whether `check` and `identify` hold only blocks of a recording in memory, whatever its length.
    advise
        ``advise(findings)`` proposes the runs that would tell most beside those that the findings rest on, from parameters and
        arrays alone, for `rigfit advise`. None where the experiment cannot.
    signals
        Which of its arrays hold signals over time, measured and modelled, for `rigfit export --to mcap`.
    equations
        The model, as the report and the experiment's page in the documentation show it.
    """

    id: str
    title: str
    summary: str
    references: Sequence[Reference]
    channels: Sequence[ChannelSpec]
    conditions: Sequence[ConditionSpec]
    parameters: Sequence[ParameterSpec]
    settings: type[Settings]
    identify: Callable[[Sequence[Recording], Any, Context], Findings]
    synthesize: Callable[[Mapping[str, Any], int], list[Recording]]
    sections: Callable[[Findings], Sequence[Section]]
    methods: Callable[[Findings], Sequence[str]]
    check: Callable[[Recording], Sequence[QualityFinding]] = lambda _recording: ()
    operating: Sequence[ConditionSpec] = ()
    live: Callable[[Recording, Any], Follower] | None = None
    builds_on: Sequence[str] = ()
    reads_blocks: bool = False
    advise: Callable[[Findings], Advice] | None = None
    signals: Sequence[Signals] = ()
    equations: Sequence[Equation] = ()

    @property
    def rig(self) -> str:
        """The part of the id before the dot."""
        return self.id.split(".")[0]

    def channel(self, name: str) -> ChannelSpec | None:
        """Return the declaration of a channel, None where there is none."""
        return next((spec for spec in self.channels if spec.name == name), None)

    def condition(self, name: str) -> ConditionSpec | None:
        """Return the declaration of a condition, None where there is none."""
        return next((spec for spec in self.conditions if spec.name == name), None)

    def unit_of(self, name: str) -> str:
        """Return the SI unit of a condition, a channel or part of an operating point; '' for text and the undeclared."""
        conditions = {spec.name: spec.unit for spec in (*self.operating, *self.conditions)}
        return conditions.get(name) or {spec.name: spec.unit for spec in self.channels}.get(name, "")

    def read_as(self, name: str) -> str:
        """Return the unit in which a report shows a condition, channel or operating point."""
        own = next((spec.read_as for spec in (*self.operating, *self.conditions) if spec.name == name), "")
        unit = self.unit_of(name)
        return own or ("degC" if unit == "K" else unit)

    def parameter_read_as(self, name: str, unit: str) -> str:
        """Return the unit in which a report shows a parameter that the findings tell in `unit`."""
        return next((spec.read_as for spec in self.parameters if spec.name == name and spec.unit == unit), "") or unit

    def parameter(self, name: str) -> ParameterSpec:
        """Return the declaration of a parameter; LookupError where there is none."""
        for spec in self.parameters:
            if spec.name == name:
                return spec
        raise LookupError(f"{self.id} declares no parameter '{name}'")
