"""The page that holds findings against others of the same experiment: what is different, what moved, what came and went."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from pipeline import __version__
from pipeline.errors import counted
from pipeline.findings import Quality
from pipeline.findings.comparison import Comparison, without_numbers
from pipeline.findings.figures import Cell, Column, Figure, Mood, Status, Table
from pipeline.report.chapters import Chapter, Code, Listed, Numbers, Paragraphs
from pipeline.report.compare_numbers import Compared, came_and_went, moved, moved_most, place_in_words, sides, signed
from pipeline.report.figure import FigureView
from pipeline.report.naming import Naming
from pipeline.report.page import VERDICTS, page
from pipeline.report.table import NOTHING, TableView, table_view
from pipeline.report.words import clean

_HASH = re.compile(r"[0-9a-f]{64}")
_HASH_DIGITS = 12
_GLANCED = 6  # campaigns that the verdict names
_MOODS: dict[str, Mood] = {"error": "rejected", "warning": "warning", "note": "unsaid"}
_AGREES = {True: Status.agrees, False: Status.contradicts, None: Status.not_checkable}

Block = Paragraphs | Listed | Code | FigureView | TableView


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
    both = [findings for one in compared for findings in (one.comparison.before, one.comparison.after)]
    specs = (spec for one in compared for spec in one.experiment.parameters)
    numbers = Numbers(Naming(specs, (run.run for findings in both for run in findings.runs)))
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


def _name(one: Compared) -> str:
    old, new = one.comparison.before.campaign, one.comparison.after.campaign
    return clean(new) if old == new else f"{clean(old)} and {clean(new)}"


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
            None if most is None else place_in_words(most.parameter, one.experiment),
            "" if most is None or most.ratio is None else signed(most.ratio),
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
        ("moved", "What moved", [*moved(one)]),
        ("came-and-went", "What came and what went", [*came_and_went(one)]),
        ("claims", "Published values judged otherwise", [*_claims(comparison)]),
        ("quality", "Findings on the data", [*_quality(comparison)]),
    ]


def _causes(comparison: Comparison) -> Iterator[Block | Figure]:
    rows: list[list[Cell]] = [
        [clean(found.what), _shown(found.before), _shown(found.after)]
        for found in comparison.causes
        if clean(found.before) != clean(found.after)
    ]
    logs = comparison.logs
    if logs.only_before or logs.only_after:
        rows.insert(0, ["log files, by content", *(f"{logs.common + len(own)}, of them {len(own)} only here"
                                                   for own in (logs.only_before, logs.only_after))])  # fmt: skip
    reasons = [_beyond(comparison.before.reasons, comparison.after.reasons),
               _beyond(comparison.after.reasons, comparison.before.reasons)]  # fmt: skip
    if any(reasons):
        rows.append(["reasons of the verdict", *("; ".join(map(clean, texts)) or NOTHING for texts in reasons)])
    columns = [Column(text) for text in ("What", *sides(comparison))]
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


def _claims(comparison: Comparison) -> Iterator[Block | Figure]:
    rows: list[list[Cell]] = [
        [clean(new.name), clean(new.where), _AGREES[old.agrees], _AGREES[new.agrees], clean(new.remark)]
        for old, new in comparison.claims
    ]
    columns = [Column(text) for text in ("Claim", "Where", *sides(comparison), "Remark")]
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
