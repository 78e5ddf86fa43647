"""What to measure next: runs that would shrink intervals, as an experiment's `advise` proposes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


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
