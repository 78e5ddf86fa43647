"""One number of each run of a campaign in the order of the runs, and in words what it does there.

For six runs as for ten thousand. The statistics are `pipeline.estimation.course`, the pictures `over_runs`; which numbers are
worth it, and what a change means on the rig, is the experiment's to say.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from pipeline.errors import counted, listing
from pipeline.estimation.course import Change, Course, Odd, course

_TOLD_ODD, _MORE_ODD = 3, 5
_CLEAR_OF_ZERO = 10.0  # spreads; a level that far off is one of which a change is a share


@dataclass(frozen=True, eq=False)
class OverRuns:
    """One number of the runs of a campaign, in their order.

    Attributes
    ----------
    what, unit
        What the number is ("stiffness"), as it stands in a sentence, and its SI unit ('1' for a ratio).
    runs, values, std_errors
        Names, numbers and their own errors (SI, NaN where not known) in the order of the runs, shape (n,).
    order
        What tells the order, in words: "in the order in which the logs begin".
    begins
        When they began, s since 1970, or None.
    grouped, share
        Whether `course` tells deviations from the level of the run's group, and whether they are shares of it.
    course
        Level, scatter, changes, odd runs.
    """

    what: str
    unit: str
    runs: Sequence[str]
    values: np.ndarray
    std_errors: np.ndarray
    order: str
    begins: Sequence[float] | None
    grouped: bool
    share: bool
    course: Course

    def sentences(self) -> list[str]:
        """Say what changes and which runs are odd, one sentence each; none where all is as chance would have it."""
        odd = self.odd_sentence()
        return [self.change_sentence(change) for change in self.course.changes] + ([odd] if odd else [])

    def change_sentence(self, change: Change) -> str:
        """Say a change with its size, its 95 % interval and where it is."""
        low, high = change.ci95
        size = f"{self._size(change.size)} (95 %: {self._size(low)} to {self._size(high)})"
        if change.kind == "drift":
            return f"The {self.what} drifts by {size} from the first to the last run, {self.order}."
        first, last = (f"'{self.runs[place]}'" for place in (change.first, change.last))
        begin, end = (f" ({_date(self.begins[place])})" if self.begins else "" for place in (change.first, change.last))
        if change.kind == "spell":
            return f"The {self.what} is off by {size} from run {first}{begin} to run {last}{end}, and back after it."
        before = self.runs[self._known_before(change.first)]
        return f"The {self.what} steps by {size} between run '{before}' and run {first}{begin}."

    def odd_sentence(self) -> str:
        """Say which runs are off the others, and by how much; an empty text for none."""
        odd = self.course.odd
        if not odd:
            return ""
        told = [
            f"'{self.runs[one.place]}' by {self.off_text(one)} ({abs(one.deviations):.1f} standard deviations of the runs"
            + (f", {one.own_errors:.1f} of its own errors)" if one.own_errors is not None else ")")
            for one in odd[:_TOLD_ODD]
        ]  # fmt: skip
        rest = listing([self.runs[one.place] for one in odd[_TOLD_ODD:]], _MORE_ODD)
        more = f", and {counted(len(odd) - _TOLD_ODD, 'more run')} ({rest})" if len(odd) > _TOLD_ODD else ""
        verb = "is" if len(odd) == 1 else "are"
        return f"In {self.what} {counted(len(odd), 'run')} of {self._known} {verb} off the others: {', '.join(told)}{more}."

    def change_in_short(self, change: Change) -> str:
        """Say a change with its size and its 95 % interval, as part of a sentence on several."""
        low, high = change.ci95
        size = f"{self._size(change.size)} ({self._size(low)} to {self._size(high)})"
        first, last = self.runs[change.first], self.runs[change.last]
        where = {
            "drift": "drifts by",
            "step": f"steps at run '{first}' by",
            "spell": f"is off from run '{first}' to run '{last}' by",
        }
        return f"{self.what} {where[change.kind]} {size}"

    def odd_in_short(self) -> str:
        """Name the runs that are off the others, and by how much; for where a table tells the rest."""
        odd = [f"'{self.runs[one.place]}' ({self.off_text(one)})" for one in self.course.odd]
        return f"Off the others in {self.what}: {listing(odd, _TOLD_ODD)}."

    def off_text(self, one: Odd) -> str:
        """Return by how much a run is off, with its sign."""
        whole = self._whole
        own = whole is not None and not self.share
        return self._told(one.off, abs(float(self.course.expected[one.place])) if own else whole)

    def scatter_text(self) -> str:
        """Return the scatter between runs beyond their own errors, as a share where that says more."""
        return self._told(self.course.scatter, self._whole, "")

    @property
    def _whole(self) -> float | None:
        """What sizes are shares of; None where they are told in SI."""
        if self.share:
            return 1.0
        known = np.isfinite(self.course.values)
        expected, spread = self.course.expected[known], self.course.spread[known]
        far = not self.grouped and bool(np.all(np.abs(expected) > _CLEAR_OF_ZERO * spread))
        return abs(self.course.level) if far else None

    @property
    def _known(self) -> int:
        return int(np.isfinite(self.course.values).sum())

    def _known_before(self, place: int) -> int:
        return int(np.flatnonzero(np.isfinite(self.course.values[:place]))[-1])

    def _size(self, size: float) -> str:
        return self._told(size, self._whole)

    def _told(self, size: float, whole: float | None, sign: str = "+") -> str:
        if whole is None:
            return f"{size:{sign}.3g} {unit_text(self.unit)}".rstrip()
        percent = 100 * size / whole
        return (f"{percent:{sign}.0f}" if abs(percent) >= 99.5 else f"{percent:{sign}#.2g}".rstrip(".")) + " %"


def over_runs(
    what: str,
    unit: str,
    runs: Sequence[str],
    values: Sequence[float | None] | np.ndarray,
    std_errors: Sequence[float | None] | np.ndarray | None = None,
    *,
    groups: Sequence[str] | None = None,
    sequence: Sequence[float | None] | None = None,
    begins: Sequence[float | None] | None = None,
    among: int = 1,
) -> OverRuns:
    """Put one number of each run into the order of the runs and tell what it does there.

    Parameters
    ----------
    what, unit
        What the number is, as it stands in a sentence, and its SI unit.
    runs, values, std_errors
        Names, numbers (SI; None or NaN where not determined) and their standard errors, shape (n,).
    groups
        In words what else tells runs apart: each group has its own level, changes are common to all.
    sequence, begins
        Which place a run had, and when it began (s since 1970). The first that is known for every run gives the order; without
        any, the names do (run 2 before run 10).
    among
        How many numbers of the campaign are looked at so: false alarms are counted over all of them.

    Raises
    ------
    ValueError
        If no run has a value.
    """
    place, order = _order(runs, sequence, begins)
    moments = None if begins is None else _numbers([begins[at] for at in place])
    ordered = _numbers([values[at] for at in place])
    if not np.isfinite(ordered).any():
        raise ValueError(f"none of the runs has a value of {what}")
    own = _numbers([None if std_errors is None else std_errors[at] for at in place])
    labels = None if groups is None else [groups[at] for at in place]
    if labels is None or len(set(labels)) < 2:
        share, found = False, course(ordered, own, among=among)
    else:
        level = _group_level(ordered, labels)
        usual = float(np.nanmedian(np.abs(ordered - level)))
        share = bool(np.nanmin(np.abs(level)) > _CLEAR_OF_ZERO * usual)
        size = np.abs(level) if share else np.ones(level.size)
        found = course((ordered - level) / size, own / size, labels, among=among)
    return OverRuns(
        what, unit, [runs[at] for at in place], ordered, own, order,
        moments.tolist() if moments is not None and np.isfinite(moments).all() else None,
        labels is not None and len(set(labels)) > 1, share, found,
    )  # fmt: skip


def _numbers(values: Sequence[float | None]) -> np.ndarray:
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _group_level(values: np.ndarray, labels: Sequence[Hashable]) -> np.ndarray:
    """Return the median of each run's group, shape (n,); NaN where none of the group is known."""
    member: dict[Hashable, list[int]] = {}
    for place, label in enumerate(labels):
        if np.isfinite(values[place]):
            member.setdefault(label, []).append(place)
    level = {label: float(np.median(values[places])) for label, places in member.items()}
    return np.array([level.get(label, np.nan) for label in labels])


def _order(
    runs: Sequence[str], sequence: Sequence[float | None] | None, begins: Sequence[float | None] | None
) -> tuple[list[int], str]:
    names = [natural(run) for run in runs]
    for given, told in (
        (sequence, "in the order of their sequence numbers"),
        (begins, "in the order in which the logs begin"),
    ):
        keys = _numbers([] if given is None else list(given))
        if np.isfinite(keys).all() and np.unique(keys).size > 1:
            return sorted(range(len(runs)), key=lambda at: (float(keys[at]), names[at])), told
    return sorted(range(len(runs)), key=lambda at: names[at]), "in the order of their names"


def natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts run 2 before run 10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)]


def _date(moment: float) -> str:
    return f"{datetime.fromtimestamp(moment, UTC):%Y-%m-%d %H:%M} UTC"


def unit_text(unit: str) -> str:
    """Return a unit as it stands behind a number in a sentence: nothing for a ratio."""
    return "" if unit == "1" else unit
