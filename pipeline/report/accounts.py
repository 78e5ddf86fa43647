"""What stands beside the numbers as tables: published values, data quality, runs, logs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import PurePosixPath

from markupsafe import Markup

from pipeline.errors import counted, listing
from pipeline.findings import Findings, Published, Quality, Run
from pipeline.findings.figures import Cell, Column, Mood, Status, Table
from pipeline.report.gathered import MOST_TOLD, gathered, runs_cell
from pipeline.report.many_runs import conditions_table, left_out_table
from pipeline.report.numbers import plain
from pipeline.report.parameters import condition_text, unit_of_condition
from pipeline.report.reading_units import ReadingUnit, reading_unit, typical
from pipeline.report.table import MOST_ROWS, NOTHING, PROSE_FROM, Head, Shown, TableView, badge, table_view
from pipeline.report.words import clean, typeset
from pipeline.rigs.experiment import Experiment

LEVELS = ("error", "warning", "note")
_AGREES = {True: Status.agrees, False: Status.contradicts, None: Status.not_checkable}
_HASH_DIGITS = 12
_EXTRACT = 60  # rows that stand for a table too long to be shown, the gravest first


def published_table(published: Sequence[Published]) -> TableView | None:
    """Set published numbers beside those found in these logs, each pair in one unit; None where there are none."""
    entries = [entry for entry in published if entry.basis == "logs"]
    rows = _pairs(sorted(entries, key=_agreement) if len(entries) > MOST_ROWS else entries)
    return (
        _pairs_view("published", "Published values beside those found", _held(entries), "Found", rows) if rows else None
    )


def _held(entries: Sequence[Published]) -> str:
    """Say how many published values agree with what was found."""
    counts = [(sum(entry.agrees is agrees for entry in entries), *told) for agrees, *told in _COUNTED]
    told = listing(f"{number} {one if number == 1 else more}" for number, one, more in counts if number)
    return f"Do the published values hold here? {told}."


_COUNTED: Sequence[tuple[bool | None, str, str]] = (
    (True, "agrees", "agree"),
    (False, "contradicts what was found", "contradict what was found"),
    (None, "cannot be checked", "cannot be checked"),
)


def paper_table(published: Sequence[Published]) -> TableView | None:
    """List what was computed from the paper's own numbers, which says nothing about these logs."""
    rows = _pairs([entry for entry in published if entry.basis == "paper"])
    caption = "Arithmetic with the paper's own numbers. No log of this campaign enters, so nothing here speaks for it."
    return _pairs_view("paper", "Is the paper consistent in itself", caption, "Recomputed", rows) if rows else None


def _agreement(entry: Published) -> int:
    """Sort what contradicts first, what agrees last."""
    return (False, None, True).index(entry.agrees)


def _pairs_view(name: str, title: str, caption: str, beside: str, rows: Sequence[Sequence[Shown]]) -> TableView:
    heads = [Head("Quantity"), Head("Published", number=True), Head(beside, number=True), Head("Unit"),
             Head("Agreement"), Head("Remark")]  # fmt: skip
    shown = rows if len(rows) <= MOST_ROWS else rows[:_EXTRACT]
    return TableView(name, title, caption, heads, shown, len(rows) - len(shown))


def _pairs(published: Sequence[Published]) -> list[list[Shown]]:
    rows = []
    for entry in published:
        numbers = [value for value in (entry.published, entry.found) if isinstance(value, float | int)]
        unit = reading_unit(entry.unit, typical(numbers))
        texts = [_number_or_words(value, unit) for value in (entry.published, entry.found)]
        rows.append([
            Shown(clean(entry.name), clean(entry.where)), Shown(texts[0], kind=_kind(entry.published)),
            Shown(texts[1], kind=_kind(entry.found)), Shown(unit.name), Shown(badge(_AGREES[entry.agrees])),
            Shown(typeset(clean(entry.remark)), kind="prose" if len(entry.remark) > PROSE_FROM else ""),
        ])  # fmt: skip
    return rows


def _number_or_words(value: float | str | None, unit: ReadingUnit) -> str:
    if isinstance(value, str):
        return typeset(clean(value))
    return NOTHING if value is None else plain(unit.read(value))


def _kind(value: float | str | None) -> str:
    return "" if isinstance(value, str) else "number"


def quality_table(quality: Sequence[Quality], runs: Sequence[Run]) -> TableView:
    """List what was noticed about the data, the gravest first; of many findings, those that say the same are one row."""
    ordered = sorted(quality, key=lambda finding: LEVELS.index(finding.level))
    kinds: dict[str, Mood] = {"error": "rejected", "warning": "warning", "note": "unsaid"}
    columns = [Column(text) for text in ("Level", "Run", "Channel", "Time (s)", "What was found")]
    if len(ordered) <= MOST_TOLD:
        rows: list[list[Cell]] = [
            [Status(q.level, kinds[q.level]), q.run or "all", q.channel or NOTHING, _span(q.span), q.message]
            for q in ordered
        ]
        counts = listing(counted(number, level) for level, number in quality_counts(quality).items() if number)
        return table_view(Table("quality", "Findings on the data", f"What was noticed? {counts}.", columns, rows))
    names = {run.run for run in runs}
    rows = []
    for one in gathered([q.message for q in ordered], names, [(q.level, q.channel) for q in ordered]):
        same = [ordered[place] for place in one.places]
        spans = {q.span for q in same}
        where = list(dict.fromkeys(q.run or "all" for q in same))
        span = _span(spans.pop()) if len(spans) == 1 else NOTHING
        level = same[0].level
        rows.append([Status(level, kinds[level]), runs_cell(where), same[0].channel or NOTHING, span, one.text])
    caption = f"{len(ordered)} findings; those that differ in their numbers only are one row. One by one they stand in findings.json."
    return table_view(Table("quality", "Findings on the data", caption, columns, rows))


def _span(span: tuple[float, float] | None) -> str:
    if span is None:
        return NOTHING
    start, end = (plain(seconds, 5) for seconds in span)
    return start if start == end else f"{start} to {end}"


def quality_counts(quality: Sequence[Quality]) -> dict[str, int]:
    """Return how many findings there are of each level, the gravest first."""
    return {level: sum(finding.level == level for finding in quality) for level in LEVELS}


def runs_tables(runs: Sequence[Run], experiment: Experiment) -> tuple[list[TableView], str]:
    """List runs with the conditions that differ; return the table and a sentence on those that are the same.

    Of more runs than a table shows, what they are like is told before, and runs that were not used come first.
    """
    names = [spec.name for spec in experiment.conditions]
    names += sorted({name for run in runs for name in run.conditions} - set(names))
    same: list[str] = []
    differ: list[str] = []
    for name in names:
        values = {run.conditions.get(name) for run in runs}
        if values - {None}:
            (same if len(values) == 1 else differ).append(name)
    columns = [Column("Run"), Column("Used"), Column("Duration", "s"), Column("Samples", "1")]
    columns += [Column(clean(name).replace("_", " "), unit_of_condition(experiment, name)) for name in differ]
    reasons = any(run.reason for run in runs)
    columns += [Column("Why not used")] if reasons else []
    ordered = sorted(runs, key=lambda run: run.used) if len(runs) > MOST_ROWS else runs
    rows: list[list[Cell]] = [
        [
            run.run, "yes" if run.used else Status("no", "warning"), run.duration, run.n_samples,
            *(run.conditions.get(name) for name in differ), *([run.reason] if reasons else []),
        ]
        for run in ordered
    ]  # fmt: skip
    constant = "; ".join(_condition(runs[0], name, experiment) for name in same)
    of = "The same in all runs" if len(runs) > 1 else "Conditions of the run"
    sentence = f"{of}: {constant.rstrip('.')}." if constant else ""
    table = Table("runs", "Runs", "", columns, rows)
    if len(runs) <= MOST_ROWS:
        return [table_view(table)], sentence
    glance = [conditions_table(runs, differ, experiment), left_out_table(runs), table_view(table, _EXTRACT)]
    return [view for view in glance if view], sentence


def _condition(run: Run, name: str, experiment: Experiment) -> str:
    value = condition_text(run.conditions[name], unit_of_condition(experiment, name))
    return f"{clean(name).replace('_', ' ')} {value}"


def repairs_table(runs: Sequence[Run]) -> TableView | None:
    """List what was changed in the data on the way, and in which runs; None where nothing was."""
    where: dict[str, list[str]] = {}
    for run in runs:
        for repair in run.repairs:
            where.setdefault(repair, []).append(run.run)
    if len(where) > MOST_TOLD:
        repairs = list(where)
        where = {one.text: [run for place in one.places for run in where[repairs[place]]]
                 for one in gathered(repairs, {run.run for run in runs})}  # fmt: skip
    rows: list[list[Cell]] = [[repair, runs_cell(list(dict.fromkeys(found)))] for repair, found in where.items()]
    columns = [Column("What was changed"), Column("Runs")]
    return table_view(Table("repairs", "Repairs made to the data", "", columns, rows)) if rows else None


def logs_table(findings: Findings) -> TableView | None:
    """List the log files with the beginning of their SHA-256, of very many one hash of them all; None where there are none."""
    rows: list[list[Cell]] = [
        [run.run, PurePosixPath(clean(path)).name, Markup("<code>{}</code>").format(digest[:_HASH_DIGITS])]
        for run in findings.runs
        for path, digest in zip(run.files, run.sha256, strict=False)
    ]
    if len(rows) > MOST_ROWS:
        return _all_logs(findings.runs)
    columns = [Column("Run"), Column("File"), Column("SHA-256 begins")]
    return table_view(Table("logs", "Log files", "Whole hashes are in findings.json.", columns, rows)) if rows else None


def _all_logs(runs: Sequence[Run]) -> TableView:
    """Return one hash that changes with any byte of any log, and how to make it again."""
    logs = sorted((path, digest) for run in runs for path, digest in zip(run.files, run.sha256, strict=False))
    lines = "".join(f"{digest}  {path}\n" for path, digest in logs)
    digest = hashlib.sha256(lines.encode(errors="surrogateescape")).hexdigest()
    caption = (
        "The hash of each log is in findings.json. This one is of all their lines, 'hash, two spaces, file, line end' as sha256sum "
        "writes them, in the order of the files' names: it changes with any byte of any log."
    )
    rows: list[list[Cell]] = [[f"{len(logs)} logs", Markup("<code>{}</code>").format(digest)]]
    return table_view(Table("logs", "Log files", caption, [Column("Files"), Column("SHA-256 of all")], rows))
