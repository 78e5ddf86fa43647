"""Parameters of very many runs summed up: one row a quantity, with its median, its range and the runs at both ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.findings import Parameter
from pipeline.report.gathered import gathered
from pipeline.report.numbers import THIN, alike, plain
from pipeline.report.reading_units import ReadingUnit
from pipeline.report.table import Head, Shown, TableView
from pipeline.report.words import clean

_RANGE = (0.05, 0.95)
_MOST_REASONS = 3
_MOST_PLACES = 12  # operating points besides the run with rows of their own


def summed_up(
    name: str,
    quantities: Sequence[tuple[Shown, ReadingUnit, Sequence[Parameter]]],
    command: str,
) -> TableView:
    """Return the table: for each quantity how many runs tell it, median, 5th and 95th percentile, lowest and highest run.

    Parameters
    ----------
    name
        Of the table.
    quantities
        What it is, the unit in which it is read, and its parameters, one a run.
    command
        What writes all numbers as a table.
    """
    heads = [Head("Quantity"), Head("Runs", number=True), Head("Median", number=True), Head("5th to 95th percentile", number=True),
             Head("Lowest", "run", True), Head("Highest", "run", True), Head("Unit")]  # fmt: skip
    runs = {p.at["run"] for _, _, parameters in quantities for p in parameters}
    caption = f"Run by run they stand in findings.json; '{command}' writes them as a table."
    rows = [_row(what, unit, parameters, {str(run) for run in runs}) for what, unit, parameters in quantities]
    return TableView(name, f"Parameters of {len(runs)} runs, summed up", caption, heads, rows)


def _row(what: Shown, unit: ReadingUnit, parameters: Sequence[Parameter], runs: set[str]) -> list[Shown]:
    known = [parameter for parameter in parameters if parameter.value is not None]
    missing = [parameter.description for parameter in parameters if parameter.value is None]
    count = Shown(_count(len(known)), f"of {_count(len(parameters))}" if missing else "", "number")
    what = Shown(what.text, "; ".join(filter(None, [what.below, *_reasons(missing, runs)])), what.kind)
    if not known:
        nothing = Shown("not determined", kind="number missing")
        return [what, count, nothing, *(Shown("", kind="number") for _ in range(3)), Shown("")]
    values = np.array([unit.read(parameter.value or 0.0) for parameter in known])
    low, middle, high = np.quantile(values, [_RANGE[0], 0.5, _RANGE[1]])
    first, last = int(values.argmin()), int(values.argmax())
    numbers = [float(number) for number in (low, middle, high, values[first], values[last])]
    texts = alike(numbers) or [plain(number) for number in numbers]
    ends = [
        Shown(text, clean(str(known[place].at["run"])), "number")
        for text, place in zip(texts[3:], (first, last), strict=True)
    ]
    span = Shown(f"{texts[0]} … {texts[2]}", kind="number")
    return [what, count, Shown(texts[1], kind="number"), span, *ends, Shown(unit.name)]


def _count(n: int) -> str:
    return f"{n:,}".replace(",", THIN)


def _reasons(descriptions: Sequence[str], runs: set[str]) -> list[str]:
    """Say why some runs do not tell it: the few reasons that come most often."""
    kinds = sorted(gathered(descriptions, runs), key=lambda one: -len(one.places))
    said = [f"{one.text} ({len(one.places)})" for one in kinds[:_MOST_REASONS]]
    return said + ([f"{len(kinds) - _MOST_REASONS} more reasons"] if len(kinds) > _MOST_REASONS else [])


def by_place(parameters: Sequence[Parameter], most: int) -> list[list[Parameter]]:
    """Part the parameters of one name by what stands in their operating point besides the run.

    Where that gives more parts than `most` or than a reader takes in, all stay together.
    """
    parts: dict[tuple[tuple[str, object], ...], list[Parameter]] = {}
    for parameter in parameters:
        parts.setdefault(_place(parameter.at), []).append(parameter)
    return list(parts.values()) if len(parts) <= min(most, _MOST_PLACES) else [list(parameters)]


def _place(at: Mapping[str, float | str | bool]) -> tuple[tuple[str, object], ...]:
    return tuple((name, value) for name, value in sorted(at.items()) if name != "run")
