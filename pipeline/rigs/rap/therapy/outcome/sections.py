"""What the report of `rap.therapy` shows, drawn from parameters and arrays only (rap.md, section 7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Cell, Column, Section, Status, Table, Text
from pipeline.rigs.rap.therapy.outcome import captions
from pipeline.rigs.rap.therapy.outcome.frames import of_run, records, runs_of
from pipeline.rigs.rap.therapy.outcome.paper import set_point_notes
from pipeline.rigs.rap.therapy.outcome.sections_alarms import of_alarms, of_redundancy
from pipeline.rigs.rap.therapy.outcome.sections_battery import of_battery
from pipeline.rigs.rap.therapy.outcome.sections_clocks import of_clocks
from pipeline.rigs.rap.therapy.outcome.sections_membrane import of_membrane
from pipeline.rigs.rap.therapy.outcome.sections_temperature import of_temperature
from pipeline.rigs.rap.therapy.outcome.sections_volume import of_volume
from pipeline.rigs.rap.therapy.record import PARTS


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    if "parts" not in findings.arrays:
        return []
    chapters = [
        Section("verdicts", "Verdicts and what each run tells", [*_checks(findings), *_parts(findings)]),
        Section("set-points", "Set-points", _set_points(findings)),
        Section("clocks", "Clocks", of_clocks(findings)),
        Section("volume", "Ultrafiltrate volume", of_volume(findings)),
        Section("membrane", "Membrane", of_membrane(findings)),
        Section("battery", "Battery", of_battery(findings)),
        Section("alarms", "Events and alarms", of_alarms(findings)),
        Section("redundancy", "Control and protective unit", of_redundancy(findings)),
        Section("temperature", "Temperature", of_temperature(findings)),
    ]
    return [chapter for chapter in chapters if chapter.blocks]


def _checks(findings: Findings) -> list[Table]:
    checks = records(findings.arrays["checks"])
    if not checks:
        return []
    rows: list[list[Cell]] = [
        [row["criterion"], row["run"], row["found"], row["allowed"], Status(row["word"], row["mood"])] for row in checks
    ]
    return [
        Table(
            "checks", "Verdicts",
            f"Does the device keep what is asked of it? {captions.met(findings.arrays['checks'])} Red: outside its limit beyond doubt; amber: at the limit, or to be looked at.",
            [Column("Criterion"), Column("Run"), Column("Found"), Column("Asked"), Column("Verdict")], rows,
        )
    ]  # fmt: skip


def _parts(findings: Findings) -> list[Table]:
    parts = findings.arrays["parts"]
    rows: list[list[Cell]] = []
    for run in runs_of(parts):
        own = {str(row["part"]): row for row in records(of_run(parts, run))}
        rows.append([run, *(_told(own[part]) for part in PARTS)])
    return [
        Table(
            "parts", "What each run tells",
            "A run tells what its channels allow. 'Not logged': it has no channel for it, and nothing is asked of it there.",
            [Column("Run"), *(Column(part) for part in PARTS)], rows,
        )
    ]  # fmt: skip


def _told(row: dict[str, object]) -> Cell:
    if not row["asked"]:
        return "not logged"
    return Status("told", "ok") if row["told"] else Status("not told", "warning")


def _set_points(findings: Findings) -> list[Table | Text]:
    """Return the set-points of the runs and what the paper's arithmetic says at them (section 4, rows 4 and 6)."""
    table = findings.arrays["set_points"]
    rows: list[list[Cell]] = []
    found: list[tuple[float | None, ...]] = []
    for row in records(table):
        rates = tuple(_number(row[name]) for name in ("blood_flow_set", "uf_flow_set", "heparin_flow_set"))
        rows.append([row["run"], *rates])
        found.append(rates)
    if not rows:
        return []
    # Runs that log less of the same set-points have nothing of their own to say.
    own = [rates for rates in dict.fromkeys(found) if not any(_says_more(other, rates) for other in found)]
    told = list(dict.fromkeys(note for rates in own for note in set_point_notes(*rates)))
    return [
        Table(
            "set_points", "Set-points", "The usual ones while the pumps run, as the device logs them; an empty cell is not logged.",
            [Column("Run"), Column("Blood flow", "mL/min"), Column("Ultrafiltration", "mL/min"), Column("Heparin", "mL/h")], rows,
        ),
        Text(told),
    ]  # fmt: skip


def _says_more(other: tuple[float | None, ...], rates: tuple[float | None, ...]) -> bool:
    """Tell whether other set-points hold all of these and more."""
    pairs = list(zip(other, rates, strict=True))
    return other != rates and all(mine is None or mine == theirs for theirs, mine in pairs)


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else None
