"""The numbers of a comparison: what moved and how far beside its own uncertainty, what only one of the two tells."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from pipeline.errors import counted
from pipeline.findings import Parameter
from pipeline.findings.comparison import Change, Comparison
from pipeline.findings.figures import Axis, Figure, Mark, Panel, Points, Rule
from pipeline.report.chapters import Paragraphs
from pipeline.report.numbers import Reading, fixed, plain, reading, warranted_decimals
from pipeline.report.parameters import common_unit, key_parameters, place_of, symbol_of
from pipeline.report.reading_units import ReadingUnit
from pipeline.report.table import MOST_ROWS, NOTHING, Head, Shown, TableView
from pipeline.report.words import clean, shortened
from pipeline.rigs.experiment import Experiment

_DRAWN = 30  # parameters, those that moved most
_MOST_DECIMALS = 6
_KEY_PLACES = 6  # operating points of one key parameter
_LONGEST_SIDE = 20.0  # widths of an m


@dataclass(frozen=True)
class Compared:
    """A comparison and the declaration of the experiment that both findings are of."""

    comparison: Comparison
    experiment: Experiment


def moved_most(comparison: Comparison) -> Change | None:
    """Return what moved most in standard errors, None where nothing with a standard error moved."""
    return next((change for change in comparison.of("changed") if change.ratio), None)


def sides(comparison: Comparison) -> tuple[str, str]:
    """Return what the two are called: before and now, or their campaigns where these are different ones."""
    old, new = (clean(findings.campaign) for findings in (comparison.before, comparison.after))
    return ("Before", "Now") if old == new else (shortened(old, _LONGEST_SIDE, 1.0), shortened(new, _LONGEST_SIDE, 1.0))


def _measure(comparison: Comparison) -> str:
    """Say what a difference is measured by, and what that does not mean."""
    shared, logs = comparison.logs.shared, comparison.logs
    if shared == "none":
        count = len(comparison.of("changed"))
        return (
            "The two share no log. A difference is told over the root of the sum of the squares of both standard errors, which is "
            "its standard error as far as the two are independent: calibrations of the same sensors and a common specimen are not. "
            f"Of {counted(count, 'parameter')} about {math.ceil(count / 20)} would lie beyond ±2 by chance alone."
        )
    what = {
        "all": "Both rest on the same logs",
        "some": f"Both rest on {counted(logs.common, 'common log')} ({len(logs.only_before)} only before, {len(logs.only_after)} only now)",
        "unknown": "Nothing says whether both rest on the same logs",
    }[shared]
    return (
        f"{what}, so that their errors are common to both and a difference has no standard error of its own. It is told in "
        "standard errors of the number itself (the larger of the two): how far it moved beside its own uncertainty. That is no "
        "test: also a move by less than one is a change of the method or the data, not chance."
    )


def moved(one: Compared) -> Iterator[Paragraphs | Figure | TableView]:
    """Yield what a difference is measured by, the key numbers, and what moved, as a figure and a table."""
    changed = one.comparison.of("changed")
    if changed:
        yield Paragraphs([_measure(one.comparison)])
    if key := _key(one):
        yield _table("key-numbers", "The numbers that matter", "", key, one, number=False)
    same = len(one.comparison.of("same"))
    if not changed:
        yield Paragraphs([f"No parameter: all {same} that both sides tell are the same to the last digit."] if same
                         else ["No parameter is told by both sides."])  # fmt: skip
        return
    unmoved = f" {same} more are the same to the last digit." if same else ""
    if drawn := [change for change in changed if change.ratio is not None][:_DRAWN]:
        yield _figure(drawn, len(changed), one)
    yield _table(
        "moved", "Parameters that changed", f"What moved most comes first.{unmoved}", changed, one, number=True
    )


def _key(one: Compared) -> list[Change]:
    """Return the changes of what the experiment calls key, in its order; of what varies with the place, as much as a page bears."""
    shown = [
        p for same in key_parameters(one.comparison.after, one.experiment) if len(same) <= _KEY_PLACES for p in same
    ]
    ids = {id(parameter): place for place, parameter in enumerate(shown)}
    found = [change for change in one.comparison.changes if change.after is not None and id(change.after) in ids]
    return sorted(found, key=lambda change: ids[id(change.after)])


def _figure(drawn: Sequence[Change], of: int, one: Compared) -> Figure:
    experiment = one.experiment
    before, now = sides(one.comparison)
    place = np.arange(1.0, len(drawn) + 1)
    pairs = [(change, change.before, change.after) for change in drawn]
    apart = 0.12 if len(drawn) > 1 else 0.03
    old_low, old_high = _limits([(change, before) for change, before, _ in pairs])
    new_low, new_high = _limits([(change, after) for change, _, after in pairs])
    moved = np.array([change.ratio or 0.0 for change in drawn])
    marks: list[Mark] = [
        Rule(y=0.0),
        Points(place - apart, np.zeros(len(drawn)), "reference", before.lower(), old_low, old_high),
        Points(place + apart, moved, 0, now.lower(), new_low, new_high),
    ]
    beyond = sum(abs(change.ratio or 0.0) > 1 for change in drawn)
    which = f"the {len(drawn)} that moved most of {of}" if of > len(drawn) else "all that moved"
    most = drawn[0]
    caption = (
        f"How far did the numbers move beside their own uncertainty? {beyond or 'None'} of {len(drawn)} by more than one standard "
        f"error, most {place_in_words(most.parameter, experiment)}, by {signed(most.ratio or 0.0)}. Shown are {which}, with 95 % "
        "intervals; numbered as in the table below."
    )
    return Figure(
        "moved", "Difference over standard error", caption, caption,
        [Panel(marks, Axis("parameter, by its number in the table", whole=True),
               Axis("difference in standard errors"))],
    )  # fmt: skip


def _limits(pairs: Sequence[tuple[Change, Parameter | None]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the 95 % limits of parameters, counted from the value before in the errors of the changes; NaN without."""
    limits = np.full((2, len(pairs)), np.nan)
    for place, (change, parameter) in enumerate(pairs):
        zero = change.before.value if change.before else None
        if parameter is not None and parameter.ci95 is not None and zero is not None and change.error:
            limits[:, place] = (np.array(parameter.ci95) - zero) / change.error
    return limits[0], limits[1]


def _table(name: str, title: str, caption: str, changes: Sequence[Change], one: Compared, number: bool) -> TableView:
    """Lay out parameters before and now, each row in its own unit; with a `number` where a figure names it by that."""
    before, now = sides(one.comparison)
    rows = []
    for place, change in enumerate(changes[:MOST_ROWS], 1):
        unit = common_unit([p for p in (change.before, change.after) if p is not None], one.experiment)
        what = _what(change.parameter, one.experiment)
        if number:
            what = Shown(Markup("{}. {}").format(place, what.text), what.below)
        moved = (
            NOTHING
            if change.difference is None
            else _moved_by(change.difference / unit.size, (change.error or 0.0) / unit.size)
        )
        ratio = NOTHING if change.ratio is None else signed(change.ratio)
        texts = [_told(p, _reading(p, unit)) for p in (change.before, change.after)]
        rows.append(
            [
                what,
                *(Shown(text, kind="number") for text in (*texts, moved)),
                Shown(unit.name),
                Shown(ratio, kind="number"),
            ]
        )
    heads = [Head("Quantity"), Head(before, "± standard error", True), Head(now, "± standard error", True),
             Head("Difference", "", True), Head("Unit"), Head("Difference", "in standard errors", True)]  # fmt: skip
    return TableView(name, title, caption, heads, rows, len(changes) - len(rows))


def _reading(parameter: Parameter | None, unit: ReadingUnit) -> Reading | None:
    if parameter is None or parameter.value is None:
        return None
    return reading(parameter.value, parameter.std_error, None, unit.size, unit.zero)


def _what(parameter: Parameter, experiment: Experiment) -> Shown:
    name = Markup(" <code>{}</code>").format(clean(parameter.name)) if parameter.symbol else ""
    spec = next((spec for spec in experiment.parameters if spec.name == parameter.name), None)
    place = place_of(parameter, experiment)
    about = "; ".join(filter(None, (f"at {place}" if place else "", clean(spec.description) if spec else "")))
    return Shown(symbol_of(parameter) + name, about)


def _moved_by(difference: float, error: float) -> str:
    """Write a difference to the digits that its error warrants."""
    decimals = warranted_decimals(error) if error > 0 and math.isfinite(error) else _MOST_DECIMALS + 1
    return fixed(difference, decimals) if decimals <= _MOST_DECIMALS else plain(difference, 3)


def signed(ratio: float) -> str:
    """Write a difference in standard errors with its sign."""
    text = fixed(ratio, 1) if abs(ratio) < 1000 else plain(ratio, 3)
    return f"+{text}" if ratio > 0 else text


def place_in_words(parameter: Parameter, experiment: Experiment) -> str:
    """Return the name of a parameter with its operating point."""
    place = place_of(parameter, experiment)
    return f"{clean(parameter.name)} at {place}" if place else clean(parameter.name)


def came_and_went(one: Compared) -> Iterator[TableView]:
    """Yield the parameters that only one of the two tells."""
    found = one.comparison.of("new", "gone", "determined now", "not determined now")
    if not found:
        return
    before, now = sides(one.comparison)
    rows = []
    for change in found[:MOST_ROWS]:
        parameter = change.parameter
        known = [p for p in (change.before, change.after) if p is not None]
        unit = common_unit(known, one.experiment)
        texts = [_told(p, _reading(p, unit)) for p in (change.before, change.after)]
        reason = parameter.description if parameter.value is None else ""
        rows.append([
            _what(parameter, one.experiment), Shown(change.kind), *(Shown(text, kind="number") for text in texts),
            Shown(unit.name), Shown(clean(reason)),
        ])  # fmt: skip
    heads = [Head("Quantity"), Head("Is"), Head(before, "± standard error", True), Head(now, "± standard error", True),
             Head("Unit"), Head("Why")]  # fmt: skip
    kept = [place for place in range(len(heads)) if heads[place].text != "Why" or any(row[place].text for row in rows)]
    yield TableView(
        "came-and-went", "Parameters that only one side tells",
        f"An operating point of other data counts as the same within {plain(1.0)} %.", [heads[k] for k in kept],
        [[row[k] for k in kept] for row in rows], len(found) - len(rows),
    )  # fmt: skip


def _told(parameter: Parameter | None, found: Reading | None) -> str:
    if parameter is None:
        return NOTHING
    return "not determined" if found is None else str(found)
