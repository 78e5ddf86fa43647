"""What the report of `rap.pressures` shows, drawn from parameters and arrays only (rap.md, section 7, items 1 to 3 and 7)."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.findings import Findings
from pipeline.findings.figures import Cell, Column, Section, Status, Table
from pipeline.rigs.rap.pressures.sections_agreement import of_agreement, of_coherence, of_gains
from pipeline.rigs.rap.pressures.sections_alignment import Blocks, clock_table, of_clock, of_overlay, of_poles
from pipeline.rigs.rap.pressures.sections_checks import of_checks
from pipeline.rigs.rap.pressures.sections_hydraulics import of_hydraulics, of_set_points


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    if "runs" not in findings.arrays or findings.arrays["runs"].empty:
        return []
    chapters = [
        Section("answers", "Answers", _answers(findings)),
        Section("clock", "Clock and overlay", [*of_overlay(findings), *clock_table(findings), *of_clock(findings)]),
        Section("gain", "Gain, offset and pole", [*of_gains(findings), *of_poles(findings)]),
        Section("agreement", "Limits of agreement", of_agreement(findings)),
        Section("coherence", "Coherence", of_coherence(findings)),
        Section("set_points", "Set-points used", of_set_points(findings)),
        Section("hydraulics", "Hydraulics", of_hydraulics(findings)),
        Section("checks", "What is left over", of_checks(findings)),
    ]
    return [chapter for chapter in chapters if chapter.blocks]


def _answers(findings: Findings) -> Blocks:
    table = findings.arrays["verdicts"]
    if table.empty:
        return []
    several = table["run"].nunique() > 1
    rows: list[list[Cell]] = [
        [*([str(r["run"])] if several else []), str(r["tap"]), str(r["question"]), str(r["answer"]), Status(str(r["word"]), r["mood"])]
        for r in table.to_dict("records")
    ]  # fmt: skip
    columns = [
        *([Column("run")] if several else []),
        Column("tap"),
        Column("question"),
        Column("answer, 95 %"),
        Column("verdict"),
    ]
    met = int((table["mood"] == "ok").sum())
    caption = f"{met} of {len(table)} questions are answered as they should be. Within: the whole interval lies in the tolerance. Outside: none of it does. Undecided: it crosses the edge, and a longer run would tell."
    return [Table("answers", "What was asked of the pressures", caption, columns, rows)]
