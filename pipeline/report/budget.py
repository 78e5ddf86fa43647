"""The budget of the errors: by parameter its scatter, what calibrations leave open, and which of them rule."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pipeline.errors import listing
from pipeline.findings import Findings, Parameter
from pipeline.findings.figures import Cell, Column, Table
from pipeline.report.numbers import plain
from pipeline.report.parameters import place_of, symbol_of
from pipeline.report.table import TableView, table_view
from pipeline.report.uncertainty import type_a
from pipeline.report.words import clean
from pipeline.rigs.calibration_effects import BUDGET
from pipeline.rigs.calibration_effects import place_of as named_place
from pipeline.rigs.experiment import Experiment

_TOLD = 3  # inputs named for a parameter
_LEAST = 0.005  # share of the variance from which an input is named


def budget_table(findings: Findings, experiment: Experiment) -> TableView | None:
    """List by parameter both parts of the standard error and what rules the second; None where there is no type B."""
    told = [p for p in findings.parameters if p.type_b is not None and p.std_error]
    if not told:
        return None
    by_place = _effects(findings)
    rows: list[list[Cell]] = []
    for p in told:
        size = abs(p.value or 0.0) or math.nan
        rows.append([
            symbol_of(p), place_of(p, experiment), _share(p.std_error, size), _share(type_a(p), size),
            _share(p.type_b, size), _ruling(by_place.get((p.name, named_place(p)), ()), p),
        ])  # fmt: skip
    columns = [Column("Parameter"), Column("At"), Column("Standard error"), Column("Type A"), Column("Type B"),
               Column("Type B mostly from")]  # fmt: skip
    kept = [place for place, column in enumerate(columns) if any(row[place] not in (None, "") for row in rows)]
    caption = (
        "Each in per cent of the value. Type A is the scatter of the data; type B is what calibrations leave open."
    )
    return table_view(
        Table(
            "budget",
            "Parts of the standard error",
            caption,
            [columns[k] for k in kept],
            [[row[k] for k in kept] for row in rows],
        )
    )


def _share(part: float | None, size: float) -> str:
    return "" if part is None or not math.isfinite(part / size) else f"{plain(100 * part / size, 2)} %"


def _effects(findings: Findings) -> Mapping[tuple[str, str], Sequence[tuple[str, float]]]:
    found: dict[tuple[str, str], list[tuple[str, float]]] = {}
    table = findings.arrays.get(BUDGET)
    if table is not None:
        for row in table.itertuples():
            found.setdefault((row.parameter, row.at), []).append(
                (f"{row.kind} of {clean(row.channel)}", float(row.effect))
            )
    return found


def _ruling(effects: Sequence[tuple[str, float]], parameter: Parameter) -> str:
    variance = (parameter.type_b or 0.0) ** 2
    largest = sorted(effects, key=lambda one: -abs(one[1]))[:_TOLD]
    named = [
        f"{what} {100 * effect**2 / variance:.0f} %"
        for what, effect in largest
        if variance and effect**2 > _LEAST * variance
    ]
    return listing(named, _TOLD) if named else ""
