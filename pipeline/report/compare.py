"""The page that holds findings against others of the same experiment: what is different, what moved, what came and went."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from pipeline import __version__
from pipeline.errors import counted
from pipeline.findings import Parameter, Quality
from pipeline.findings.comparison import Change, Comparison, without_numbers
from pipeline.findings.figures import Axis, Cell, Column, Figure, Mark, Mood, Panel, Points, Rule, Status, Table
from pipeline.report.chapters import Chapter, Code, Listed, Numbers, Paragraphs
from pipeline.report.figure import FigureView
from pipeline.report.numbers import Reading, fixed, plain, reading, warranted_decimals
from pipeline.report.page import VERDICTS, page
from pipeline.report.parameters import common_unit, key_parameters, place_of, symbol_of
from pipeline.report.reading_units import ReadingUnit
from pipeline.report.table import MOST_ROWS, NOTHING, Head, Shown, TableView, table_view
from pipeline.report.words import clean, shortened
from pipeline.rigs.experiment import Experiment

_DRAWN = 30  # parameters, those that moved most
_HASH = re.compile(r"[0-9a-f]{64}")
_HASH_DIGITS = 12
_MOST_DECIMALS = 6
_KEY_PLACES = 6  # operating points of one key parameter
_LONGEST_SIDE = 20.0  # widths of an m
_GLANCED = 6  # campaigns that the verdict names
_MOODS: dict[str, Mood] = {"error": "rejected", "warning": "warning", "note": "unsaid"}
_AGREES = {True: Status.agrees, False: Status.contradicts, None: Status.not_checkable}

Block = Paragraphs | Listed | Code | FigureView | TableView


@dataclass(frozen=True)
class Compared:
    """A comparison and the declaration of the experiment that both findings are of."""

    comparison: Comparison
    experiment: Experiment


def render_comparison(
    compared: Sequence[Compared], labels: tuple[str, str], alone: Sequence[str] = (), command: str = ""
) -> str:
    """Return the page as the text of an HTML file; the same arguments give the same text.

    Parameters
    ----------
    compared
        One for each campaign that both sides have, at least one.
    labels
        What the user called the two sides.
    alone
        A sentence for each campaign that only one side has.
    command
        What was typed, for whoever repeats it.
    """
    numbers = Numbers()
    single = len(compared) == 1 and not alone
    made: list[tuple[str, str, list[Block | Figure]]] = []
    if not single:
        made.append(("campaigns", "Campaigns", [_overview(compared), *([Listed(list(alone))] if alone else [])]))
    for place, one in enumerate(compared, 1):
        if single:
            made += _chapters(one)
        elif not (one.comparison.alike and not one.comparison.causes and one.comparison.logs.shared == "all"):
            parts = [block for _, _, blocks in _chapters(one) for block in blocks]
            made.append((f"campaign-{place}", _name(one), parts))
    if command:
        made.append(("repeat", "To repeat this", [Code("Command", command)]))
    verdicts = [(one.comparison.before.verdict, one.comparison.after.verdict) for one in compared]
    worst = max((new for _, new in verdicts), key=list(VERDICTS).index)
    changed = [one for one in compared if one.comparison.before.verdict != one.comparison.after.verdict]
    return page(
        "compare.html.j2",
        title=_name(compared[0]) if single else "Two states of the project",
        before=clean(labels[0]),
        now=clean(labels[1]),
        mood=worst,
        words=VERDICTS,
        verdicts=[
            ("" if single else _name(one), one.comparison.before.verdict, one.comparison.after.verdict)
            for one in (compared if single else changed[:_GLANCED])
        ],
        glance=_glance(compared, single),
        chapters=[Chapter(anchor, title, list(numbers.given(blocks))) for anchor, title, blocks in made if blocks],
        version=__version__,
    )


def moved_most(comparison: Comparison) -> Change | None:
    """Return what moved most in standard errors, None where nothing with a standard error moved."""
    return next((change for change in comparison.of("changed") if change.ratio), None)


def _name(one: Compared) -> str:
    old, new = one.comparison.before.campaign, one.comparison.after.campaign
    return clean(new) if old == new else f"{clean(old)} and {clean(new)}"


def _sides(comparison: Comparison) -> tuple[str, str]:
    """Return what the two are called: before and now, or their campaigns where these are different ones."""
    old, new = (clean(findings.campaign) for findings in (comparison.before, comparison.after))
    return ("Before", "Now") if old == new else (shortened(old, _LONGEST_SIDE, 1.0), shortened(new, _LONGEST_SIDE, 1.0))


def _glance(compared: Sequence[Compared], single: bool) -> str:
    if single:
        return " · ".join(_counts(compared[0].comparison))
    changed = sum(one.comparison.before.verdict != one.comparison.after.verdict for one in compared)
    moved = sum(bool(one.comparison.of("changed")) for one in compared)
    return (
        f"{counted(len(compared), 'campaign')} compared · {changed or 'no'} with another verdict · "
        f"{moved or 'none'} with other numbers"
    )


def _counts(comparison: Comparison) -> list[str]:
    total = len(comparison.changes)
    said = [f"{len(comparison.of('changed'))} of {counted(total, 'parameter')} changed"]
    said += [
        f"{count} {kind}"
        for kind in ("new", "gone", "determined now", "not determined now")
        if (count := len(comparison.of(kind)))
    ]
    came, went = len(comparison.quality_came), len(comparison.quality_went)
    return [*said, f"{counted(came, 'finding')} on the data came, {went} went"] if came or went else said


def _overview(compared: Sequence[Compared]) -> TableView:
    rows: list[list[Cell]] = []
    for one in compared:
        comparison = one.comparison
        most = moved_most(comparison)
        rows.append([
            _name(one), *(_verdict(findings.verdict) for findings in (comparison.before, comparison.after)),
            f"{comparison.logs.shared} the same" if comparison.logs.shared != "unknown" else "not named",
            len(comparison.of("changed")),
            None if most is None else _place(most.parameter, one.experiment),
            "" if most is None or most.ratio is None else _signed(most.ratio),
        ])  # fmt: skip
    columns = [Column(text) for text in ("Campaign", "Before", "Now", "Logs", "Parameters changed", "Moved most",
                                         "By, in standard errors")]  # fmt: skip
    caption = (
        "Campaigns without a chapter below are the same on both sides: the same logs, settings, versions and numbers."
    )
    return table_view(Table("campaigns", "Campaigns on both sides", caption, columns, rows))


def _verdict(verdict: str) -> Status:
    moods: dict[str, Mood] = {"ok": "ok", "warning": "warning", "rejected": "rejected"}
    return Status(VERDICTS[verdict][0], moods[verdict])


def _chapters(one: Compared) -> list[tuple[str, str, list[Block | Figure]]]:
    comparison = one.comparison
    return [
        ("causes", "What is different", [*_causes(comparison)]),
        ("moved", "What moved", [*_moved(one)]),
        ("came-and-went", "What came and what went", [*_came_and_went(one)]),
        ("claims", "Published values judged otherwise", [*_claims(comparison)]),
        ("quality", "Findings on the data", [*_quality(comparison)]),
    ]


def _causes(comparison: Comparison) -> Iterator[Block | Figure]:
    rows: list[list[Cell]] = [
        [clean(found.what), clean(found.before) or NOTHING, clean(found.after) or NOTHING]
        for found in comparison.causes
    ]
    logs = comparison.logs
    if logs.only_before or logs.only_after:
        rows.insert(0, ["log files, by content", *(f"{logs.common + len(own)}, of them {len(own)} only here"
                                                   for own in (logs.only_before, logs.only_after))])  # fmt: skip
    reasons = [_beyond(comparison.before.reasons, comparison.after.reasons),
               _beyond(comparison.after.reasons, comparison.before.reasons)]  # fmt: skip
    if any(reasons):
        rows.append(["reasons of the verdict", *("; ".join(map(clean, texts)) or NOTHING for texts in reasons)])
    columns = [Column(text) for text in ("What", *_sides(comparison))]
    if rows:
        yield table_view(Table("causes", "What is different besides the numbers", "", columns, rows))
    elif comparison.alike:
        yield Paragraphs(["Nothing: the logs, the settings, the versions and every number are the same."])
    else:
        yield Paragraphs(
            ["Neither logs nor settings nor versions are different, yet the numbers are: rigfit's code is another one of the same "
             "version, or findings of campaigns that this one uses have changed."]
        )  # fmt: skip


def _shown(text: str) -> str:
    """Return one side of a difference; of a hash the beginning."""
    return f"{text[:_HASH_DIGITS]}…" if _HASH.fullmatch(text) else clean(text) or NOTHING


def _beyond(texts: Sequence[str], known: Sequence[str]) -> list[str]:
    """Return sentences that are not among the known ones; other numbers do not make another sentence."""
    said = set(map(without_numbers, known))
    return [text for text in texts if without_numbers(text) not in said]


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


def _moved(one: Compared) -> Iterator[Block | Figure]:
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
    before, now = _sides(one.comparison)
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
        f"error, most {_place(most.parameter, experiment)}, by {_signed(most.ratio or 0.0)}. Shown are {which}, with 95 % "
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
    before, now = _sides(one.comparison)
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
        ratio = NOTHING if change.ratio is None else _signed(change.ratio)
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


def _place(parameter: Parameter, experiment: Experiment) -> str:
    place = place_of(parameter, experiment)
    return f"{clean(parameter.name)} at {place}" if place else clean(parameter.name)


def _moved_by(difference: float, error: float) -> str:
    """Write a difference to the digits that its error warrants."""
    decimals = warranted_decimals(error) if error > 0 and math.isfinite(error) else _MOST_DECIMALS + 1
    return fixed(difference, decimals) if decimals <= _MOST_DECIMALS else plain(difference, 3)


def _signed(ratio: float) -> str:
    text = fixed(ratio, 1) if abs(ratio) < 1000 else plain(ratio, 3)
    return f"+{text}" if ratio > 0 else text


def _came_and_went(one: Compared) -> Iterator[Block | Figure]:
    found = one.comparison.of("new", "gone", "determined now", "not determined now")
    if not found:
        return
    before, now = _sides(one.comparison)
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


def _claims(comparison: Comparison) -> Iterator[Block | Figure]:
    rows: list[list[Cell]] = [
        [clean(new.name), clean(new.where), _AGREES[old.agrees], _AGREES[new.agrees], clean(new.remark)]
        for old, new in comparison.claims
    ]
    columns = [Column(text) for text in ("Claim", "Where", *_sides(comparison), "Remark")]
    if rows:
        yield table_view(Table("claims", "Claims of the paper judged otherwise", "", columns, rows))


def _quality(comparison: Comparison) -> Iterator[Block | Figure]:
    for title, found in (("That came", comparison.quality_came), ("That went", comparison.quality_went)):
        rows: list[list[Cell]] = [_row(one) for one in found]
        columns = [Column(text) for text in ("Level", "Run", "Channel", "What was found")]
        if rows:
            name = title.lower().replace(" ", "-")
            yield table_view(
                Table(f"quality-{name}", f"Findings on the data {title[0].lower()}{title[1:]}", "", columns, rows)
            )


def _row(one: Quality) -> list[Cell]:
    return [Status(one.level, _MOODS[one.level]), clean(one.run or "all"), clean(one.channel or NOTHING), one.message]
