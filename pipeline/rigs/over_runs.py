"""A campaign of many runs in a report: trend and odd runs of its numbers, drawn and listed; runs that stand for the others.

What is drawn is made by `over_runs` of `number_over_runs`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import numpy as np

from pipeline.errors import counted, listing
from pipeline.estimation.course import Course
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
from pipeline.rigs.number_over_runs import OverRuns, natural, over_runs, unit_text

__all__ = [
    "MANY",
    "OverRuns",
    "distribution_panel",
    "natural",
    "odd_table",
    "over_runs",
    "representative",
    "trend_figure",
    "trend_panel",
]

MANY = 40  # from so many runs on, trends and runs that stand for others say more than a panel for each

_BARS_UP_TO = 120  # runs whose own limits are drawn
_BLOCKS = 30  # of more runs, their means with limits
_IN_VIEW = 6.0  # spreads; a run farther off is drawn at the edge, with its number
_NAMED_ODD, _MOST_ODD_ROWS = 6, 50
_MOST_DAYS = 12
_ARROWS = ("\u2193", "\u2191")  # beside a run that is drawn at the edge
_DAY = 86400.0
_BINS = (8, 48)


def trend_panel(found: OverRuns, title: str = "") -> Panel:
    """Return the numbers over the order of the runs with what is expected of them, steps, and odd runs by name.

    Runs of several groups are shown as deviations from the level of their own group. Own 95 % limits are drawn up to 120
    runs; of more, the means of blocks of runs with theirs.
    """
    told = found.course
    known = np.flatnonzero(np.isfinite(told.values))
    odd = np.array([one.place for one in told.odd], dtype=int)
    usual = np.setdiff1d(known, odd)
    base = told.levels if found.grouped else 0.0
    x, y, expected = np.arange(1.0, told.values.size + 1), told.values - base, told.expected - base
    half = 1.96 * told.std_errors
    reach = _IN_VIEW * told.spread
    levels = np.split(known, np.searchsorted(known, _steps(told)))  # the runs between steps
    parts = [_spaced(part) for part in levels]
    at = np.concatenate(parts)
    spread = (
        told.spread[at] if known.size <= _BARS_UP_TO else np.full(at.size, math.sqrt(np.mean(told.spread[known] ** 2)))
    )
    marks: list[Mark] = [
        Band(x[at], *_about(expected[at], t_quantile(known.size - 1) * spread), "reference", "95 of 100 runs"),
        Band(x[at], *_about(expected[at], t_quantile(told.dof) * told.std_error[at]), "model", "95 % of the line"),
    ]
    bars = known.size <= _BARS_UP_TO and bool(np.isfinite(half).any())
    low, high = _about(y, half)
    marks.append(Points(x[usual], y[usual], 0, "runs", low[usual] if bars else None, high[usual] if bars else None))
    if known.size > _BARS_UP_TO:
        marks.append(_blocks(x, y, expected, [part[np.isin(part, usual)] for part in levels]))
    marks += [Line(x[part], expected[part], "model", "expected") for part in parts if part.size]
    if odd.size:
        far = np.abs(y - expected)[odd] > reach[odd]
        shown = np.clip(y[odd], expected[odd] - reach[odd], expected[odd] + reach[odd])
        texts = [
            f"{found.runs[place]}{f': {found.off_text(one)} {_ARROWS[one.off > 0]}' if beyond else ''}"
            if rank < _NAMED_ODD
            else ""
            for rank, (place, one, beyond) in enumerate(zip(odd, told.odd, far, strict=True))
        ]
        marks.append(Points(x[odd], shown, "fault", "off the others", texts=texts))
    marks += [Rule(x=float(x[first]) - 0.5, role="fault", label="step") for first in _steps(told)]
    marks += [Rule(x=at, label=day) for at, day in _days(found.begins)]
    heading = f"{found.what} less its group's level" if found.grouped else found.what
    return Panel(
        marks, Axis(f"run, {found.order}", whole=True), Axis(heading, "%" if found.share else found.unit), title
    )


def _about(centre: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return centre - half, centre + half


def _spaced(places: np.ndarray) -> np.ndarray:
    """Return places at which lines without corners are drawn: all of few, evenly spaced ones of many."""
    if places.size <= _BARS_UP_TO:
        return places
    return np.asarray(places[np.linspace(0, places.size - 1, _BLOCKS).round().astype(int)])


def _steps(told: Course) -> list[int]:
    """Return the places of the first runs after a step."""
    firsts = [change.first for change in told.changes if change.kind != "drift"]
    return sorted({*firsts, *(change.last + 1 for change in told.changes if change.kind == "spell")})


def _blocks(x: np.ndarray, y: np.ndarray, expected: np.ndarray, levels: Sequence[np.ndarray]) -> Points:
    """Return the means of neighbouring runs between steps, with their 95 % limits beside what is expected."""
    length = max(sum(part.size for part in levels) // _BLOCKS, 2)
    blocks = [block for part in levels if part.size > 1 for block in np.array_split(part, max(part.size // length, 1))]
    middle, mean = (np.array([values[block].mean() for block in blocks]) for values in (x, y))
    off = [(y - expected)[block] for block in blocks]
    half = np.array([t_quantile(one.size - 1) * one.std(ddof=1) / math.sqrt(one.size) for one in off])
    return Points(middle, mean, "residual", "mean of neighbours", mean - half, mean + half)


def trend_figure(numbers: Sequence[OverRuns], name: str, title: str, caption: str = "", columns: int = 1) -> Figure:
    """Return one panel a number; the caption ends with what the panels tell.

    `caption` asks the question; what changes and which runs are odd is said after it.
    """
    changes = [number.change_in_short(change) for number in numbers for change in number.course.changes]
    told = [f"With 95 % intervals: {'; '.join(changes)}."] if changes else []
    told += [number.odd_in_short() for number in numbers if number.course.odd]
    calm = [number.what for number in numbers if not number.sentences()]
    if calm:
        told.append(f"No change and no odd run that chance would not bring about: {listing(calm)}.")
    about = (
        "The line is what is expected of a run, the dark band its 95 % interval; the light band holds 95 of 100 runs. A run "
        "counts as off the others where chance would bring one so far in one campaign of twenty; one with an arrow is farther off "
        "than it is drawn."
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
    axis = Axis(f"{found.what} less what is expected of the run", "%" if found.share else found.unit)
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


def _days(begins: Sequence[float] | None) -> list[tuple[float, str]]:
    """Return where a new day (UTC) begins, and its date; nothing where days are many or all runs are of one."""
    if not begins:
        return []
    day = np.floor(np.asarray(begins) / _DAY)
    first = np.flatnonzero(np.diff(day) > 0) + 1
    if not 0 < first.size < _MOST_DAYS:
        return []
    return [(float(at) + 0.5, f"{datetime.fromtimestamp(begins[int(at)], UTC):%d %b}") for at in first]


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
            else f"{value:.5g} {unit_text(number.unit)}".rstrip()
        )
        lines.append([number.runs[one.place], number.what, cell, number.off_text(one), round(one.deviations, 1),
                      None if one.own_errors is None else round(one.own_errors, 1)])  # fmt: skip
    columns = [Column("Run"), Column("Number"), Column("Value", shared), Column("Off by"), Column("Deviations of the runs", "1"),
               Column("Own errors", "1")]  # fmt: skip
    kept = len(columns) - (0 if any(line[-1] is not None for line in lines) else 1)
    return Table(name, title, caption, columns[:kept], [line[:kept] for line in lines])


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
