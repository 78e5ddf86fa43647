"""What to measure next: runs that would shrink intervals, as an experiment's `advise` proposes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.findings import Findings


@dataclass(frozen=True)
class Shrinkage:
    """The standard error of one parameter (SI) as it is `now` and as it would be `then`; None where it is not determined.

    `name` and `at` are those of the findings.
    """

    name: str
    at: Mapping[str, float | str | bool]
    now: float | None
    then: float | None
    unit: str

    @property
    def factor(self) -> float | None:
        """By what the standard error would be divided; None where it is not determined now, or would not be then."""
        return self.now / self.then if self.now is not None and self.then else None


@dataclass(frozen=True)
class Proposal:
    """Runs to add to the campaign.

    Attributes
    ----------
    conditions
        How they are run: conditions and set-points by name, SI.
    runs
        How many of them.
    why
        One plain sentence: what they tell that the campaign does not.
    shrinks
        What they do to the intervals, the greatest gain first.
    """

    conditions: Mapping[str, float | str]
    runs: int
    why: str
    shrinks: Sequence[Shrinkage]


@dataclass(frozen=True)
class Advice:
    """Proposals, the best first, and what else is to be said: what they rest on, what no run can help."""

    proposals: Sequence[Proposal] = ()
    remarks: Sequence[str] = field(default_factory=tuple)


def caveat(findings: Findings) -> str:
    """Return what a forecast from so few runs cannot know, whatever the experiment; '' where there are several."""
    if sum(run.used for run in findings.runs) != 1:
        return ""
    return "Reckoned from a single run: what changes from run to run is not known, so the forecast is a best case. Repeat that run first."


def advice_with_caveat(advise: Callable[[Findings], Advice], findings: Findings) -> Advice:
    """Return an experiment's advice, with what no experiment can know added to its remarks."""
    advice = advise(findings)
    said = caveat(findings) if advice.proposals else ""
    return replace(advice, remarks=(*advice.remarks, said)) if said else advice
