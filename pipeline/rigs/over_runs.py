"""A campaign of many runs in a report: trend and odd runs of a number, told and drawn; runs that stand for the others.

For six runs as for ten thousand. The statistics are `pipeline.estimation.course`; which numbers are worth it, and what a
change means on the rig, is the experiment's to say.
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from pipeline.errors import counted, listing
from pipeline.estimation.course import Change, Course, Odd, course
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings.figures import (
    Axis,
    Band,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Panel,
    Points,
    Rule,
    Stems,
    Table,
    Value,
)

MANY = 40  # from so many runs on, trends and runs that stand for others say more than a panel for each

_BARS_UP_TO = 200  # runs whose own limits are drawn
_BLOCKS = 30  # of more runs, their means with limits
_IN_VIEW = 8.0  # spreads; a run farther off is drawn at the edge, with its number
_NAMED_ODD, _TOLD_ODD, _MOST_ODD_ROWS = 6, 3, 50
_MOST_DAYS = 12
_DAY = 86400.0
_BINS = (8, 48)
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
        before, after = self.runs[self._known_before(change.first)], self.runs[change.first]
        when = f" ({_date(self.begins[change.first])})" if self.begins else ""
        return f"The {self.what} steps by {size} between run '{before}' and run '{after}'{when}."

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
        rest = listing([self.runs[one.place] for one in odd[_TOLD_ODD:]], 5)
        more = f", and {counted(len(odd) - _TOLD_ODD, 'more run')} ({rest})" if len(odd) > _TOLD_ODD else ""
        verb = "is" if len(odd) == 1 else "are"
        return f"In {self.what} {counted(len(odd), 'run')} of {self._known} {verb} off the others: {', '.join(told)}{more}."

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
            return f"{size:{sign}.3g} {_unit(self.unit)}".rstrip()
        return f"{100 * size / whole:{sign}#.2g}".rstrip(".") + " %"


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
    timed = begins is not None and all(moment is not None for moment in begins)
    labels = None if groups is None else [groups[at] for at in place]
    ordered = _numbers([values[at] for at in place])
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
        [float(begins[at] or 0.0) for at in place] if begins is not None and timed else None,
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
    for keys, told in (
        (sequence, "in the order of their sequence numbers"),
        (begins, "in the order in which the logs begin"),
    ):
        if keys is not None and all(key is not None for key in keys) and len(set(keys)) > 1:
            return sorted(range(len(runs)), key=lambda at: (keys[at], natural(runs[at]))), told
    return sorted(range(len(runs)), key=lambda at: natural(runs[at])), "in the order of their names"


def natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts run 2 before run 10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)]


def trend_panel(found: OverRuns, title: str = "") -> Panel:
    """Return the numbers over the order of the runs with what is expected of them, steps, and odd runs by name.

    Runs of several groups are shown as deviations from the level of their own group. Own 95 % limits are drawn up to 200
    runs; of more, the means of blocks of runs with theirs.
    """
    told = found.course
    known = np.flatnonzero(np.isfinite(told.values))
    odd = np.array([one.place for one in told.odd], dtype=int)
    usual = np.setdiff1d(known, odd)
    base = told.levels if found.grouped else 0.0
    x, y, expected = np.arange(1.0, told.values.size + 1), told.values - base, told.expected - base
    half = 1.96 * told.std_errors
    wide, reach = t_quantile(told.dof), _IN_VIEW * told.spread
    marks: list[Mark] = [
        Band(x[known], *_about(expected[known], wide * told.spread[known]), "reference", "95 of 100 runs"),
        Band(x[known], *_about(expected[known], wide * told.std_error[known]), "model", "95 % of what is expected"),
    ]
    bars = known.size <= _BARS_UP_TO and bool(np.isfinite(half).any())
    low, high = _about(y, half)
    marks.append(
        Points(x[usual], y[usual], "measured", "runs", low[usual] if bars else None, high[usual] if bars else None)
    )
    if known.size > _BARS_UP_TO:
        marks.append(_blocks(x[usual], (y - expected)[usual], expected[usual]))
    for part in np.split(known, np.searchsorted(known, sorted(_steps(told)))):
        marks.append(Line(x[part], expected[part], "model", "expected"))
    if odd.size:
        far = np.abs(y - expected)[odd] > reach[odd]
        shown = np.clip(y[odd], expected[odd] - reach[odd], expected[odd] + reach[odd])
        texts = [
            f"{found.runs[place]}{f': {found.off_text(one)}' if beyond else ''}" if rank < _NAMED_ODD else ""
            for rank, (place, one, beyond) in enumerate(zip(odd, told.odd, far, strict=True))
        ]
        marks.append(Points(x[odd], shown, "fault", "off the others", texts=texts))
    marks += [Rule(x=float(x[first]) - 0.5, role="fault", label="step") for first in _steps(told)]
    marks += [Rule(x=at, label=day) for at, day in _days(found.begins)]
    heading = f"{found.what} beside the level of its group" if found.grouped else found.what
    return Panel(
        marks, Axis(f"run, {found.order}", whole=True), Axis(heading, "%" if found.share else found.unit), title
    )


def _about(centre: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return centre - half, centre + half


def _steps(told: Course) -> list[int]:
    return [change.first for change in told.changes if change.kind == "step"]


def _blocks(x: np.ndarray, off: np.ndarray, expected: np.ndarray) -> Points:
    """Return the mean of each block of neighbouring runs with its 95 % limits."""
    parts = np.array_split(np.arange(x.size), _BLOCKS)
    middle = np.array([x[part].mean() for part in parts])
    mean = np.array([(off + expected)[part].mean() for part in parts])
    half = np.array([t_quantile(part.size - 1) * off[part].std(ddof=1) / math.sqrt(part.size) for part in parts])
    return Points(middle, mean, "residual", f"mean of {x.size // _BLOCKS} runs", mean - half, mean + half)


def trend_figure(numbers: Sequence[OverRuns], name: str, title: str, caption: str = "", columns: int = 1) -> Figure:
    """Return one panel a number; the caption ends with what the panels tell.

    `caption` asks the question; what changes and which runs are odd is said after it.
    """
    told = [sentence for number in numbers for sentence in number.sentences()]
    calm = [number.what for number in numbers if not number.sentences()]
    if calm:
        told.append(f"No change and no odd run that chance would not bring about: {listing(calm)}.")
    about = (
        "The line is what is expected of a run, the dark band its 95 % interval; the light band holds 95 of 100 runs. A run "
        "counts as off the others where chance would bring one so far in one campaign of twenty."
    )
    panels = [
        trend_panel(number, number.what[:1].upper() + number.what[1:] if len(numbers) > 1 else "") for number in numbers
    ]
    alt = (
        f"{listing([number.what for number in numbers])} over {counted(len(numbers[0].runs) if numbers else 0, 'run')}."
    )
    return Figure(name, title, " ".join(filter(None, [caption, *told, about])), alt, panels, columns)


def distribution_panel(found: OverRuns, title: str = "") -> Panel:
    """Return how many runs lie how far from what is expected of them; runs far off are counted in the outermost bars."""
    told = found.course
    known = np.isfinite(told.values)
    off = (told.values - told.expected)[known]
    count, edges = _histogram(off)
    middle = (edges[:-1] + edges[1:]) / 2
    bars = Stems(middle, count.astype(float), "measured", "", width=float(0.94 * (edges[1] - edges[0])))
    axis = Axis(f"{found.what} beside what is expected of the run", "%" if found.share else found.unit)
    return Panel([bars, Rule(x=0.0)], axis, Axis("runs", whole=True), title)


def _histogram(off: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return counts and edges of equal bins (Freedman and Diaconis 1981); what is far off goes into the outermost."""
    low, median, high = np.quantile(off, [0.25, 0.5, 0.75])
    quartiles = float(high - low)
    reach = 6 * quartiles if quartiles > 0 else float(np.ptp(off)) or max(abs(float(median)), 1e-12)
    first, last = max(float(off.min()), median - reach), min(float(off.max()), median + reach)
    if not last > first:
        first, last = float(median) - reach / 2, float(median) + reach / 2
    wanted = (last - first) / (2 * quartiles * off.size ** (-1 / 3)) if quartiles > 0 else 0
    bins = int(min(max(math.ceil(wanted), _BINS[0]), _BINS[1]))
    return np.histogram(np.clip(off, first, last), bins, (first, last))


def odd_table(numbers: Sequence[OverRuns], name: str = "odd-runs", title: str = "Runs off the others") -> Table | None:
    """Return the odd runs of all numbers, the farthest first; None where there is none.

    At most 50 stand in it; the caption tells how many there are.
    """
    rows = sorted(
        ((one, number) for number in numbers for one in number.course.odd),
        key=lambda row: (-abs(row[0].deviations), row[1].what, row[0].place),
    )
    if not rows:
        return None
    caption = (
        "A run stands here where chance would bring one so far in one campaign of twenty, if runs scatter normally. Deviations "
        "are counted in standard deviations of the runs, robust against odd ones."
    )
    if len(rows) > _MOST_ODD_ROWS:
        caption += f" The farthest {_MOST_ODD_ROWS} of {len(rows)} are shown."
    units = {number.unit for _, number in rows[:_MOST_ODD_ROWS]}
    whats = {number.what for _, number in rows[:_MOST_ODD_ROWS]}
    shared = units.pop() if len(units) == 1 and len(whats) == 1 else ""
    lines: list[list[Cell]] = []
    for one, number in rows[:_MOST_ODD_ROWS]:
        value, error = float(number.values[one.place]), float(number.std_errors[one.place])
        cell = (
            Value(value, error if math.isfinite(error) else None)
            if shared
            else f"{value:.5g} {_unit(number.unit)}".rstrip()
        )
        lines.append([number.runs[one.place], number.what, cell, number.off_text(one), round(one.deviations, 1),
                      None if one.own_errors is None else round(one.own_errors, 1)])  # fmt: skip
    columns = [Column("Run"), Column("Number"), Column("Value", shared), Column("Off by"), Column("Deviations of the runs", "1"),
               Column("Own errors", "1")]  # fmt: skip
    return Table(name, title, caption, columns, lines)


def representative(runs: Sequence[str], misfit: Sequence[float | None] | np.ndarray) -> Mapping[str, str]:
    """Choose runs that stand for all by how badly the model fits them: best, median and worst.

    Ties go to the first by name, whatever order the runs come in. Runs without a misfit are left out; of two runs there is
    no median, of one only the best.

    Examples
    --------
    >>> representative(["r10", "r2", "r1"], [0.3, 0.1, 0.2])
    {'best': 'r2', 'median': 'r1', 'worst': 'r10'}
    """
    told = [(float(size), natural(run), run) for run, size in zip(runs, misfit, strict=True)
            if size is not None and math.isfinite(size)]  # fmt: skip
    told.sort()
    places = {1: {"best": 0}, 2: {"best": 0, "worst": 1}}.get(
        len(told), {"best": 0, "median": (len(told) - 1) // 2, "worst": len(told) - 1}
    )
    return {word: told[place][2] for word, place in places.items()} if told else {}


def _days(begins: Sequence[float] | None) -> list[tuple[float, str]]:
    """Return where a new day (UTC) begins, and its date; nothing where days are many or all runs are of one."""
    if not begins:
        return []
    day = np.floor(np.asarray(begins) / _DAY)
    first = np.flatnonzero(np.diff(day) > 0) + 1
    if not 0 < first.size < _MOST_DAYS:
        return []
    return [(float(at) + 0.5, f"{datetime.fromtimestamp(begins[int(at)], UTC):%d %b}") for at in first]


def _date(moment: float) -> str:
    return f"{datetime.fromtimestamp(moment, UTC):%Y-%m-%d %H:%M} UTC"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
