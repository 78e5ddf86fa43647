"""Where the standard errors come from: scatter of the data (type A) and what calibrations leave open (type B)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from markupsafe import Markup

from pipeline.errors import listing
from pipeline.findings import Findings, Parameter
from pipeline.findings.figures import Cell, Column, Table
from pipeline.report.numbers import plain
from pipeline.report.reading_units import reading_unit
from pipeline.report.table import TableView, table_view
from pipeline.report.words import clean
from pipeline.rigs.calibration_effects import BUDGET, place_of
from pipeline.rigs.experiment import Experiment

_TOLD = 3  # inputs named for a parameter
_LEAST = 0.005  # share of the variance from which an input is named


def type_a(parameter: Parameter) -> float | None:
    """Return the part of the standard error that comes from scatter; None where there is no standard error."""
    if parameter.std_error is None:
        return None
    return math.sqrt(max(parameter.std_error**2 - (parameter.type_b or 0.0) ** 2, 0.0))


def stated(findings: Findings, experiment: Experiment) -> str:
    """Return what the recipe says of the channels' calibration and what was done with it, for readers and for a paper."""
    if not findings.calibration:
        more = " beyond what is told as type B" if any(p.type_b for p in findings.parameters) else ""
        return (
            f"The recipe states no uncertainty of the channels' calibration, so that none is in the intervals{more}: a gain or an "
            "offset that is off in all runs alike shifts the numbers unseen."
        )
    parts = []
    for name, entry in findings.calibration.items():
        of = []
        if entry.get("gain_u"):
            of.append(f"gain {plain(100 * entry['gain_u'], 3)} %")
        if entry.get("offset_u"):
            unit = reading_unit(experiment.unit_of(name) or "1", entry["offset_u"])
            of.append(f"offset {plain(entry['offset_u'] / unit.size, 3)} {unit.name}".rstrip())
        parts.append(f"{clean(name)} {' and '.join(of)}")
    return (
        f"Stated standard uncertainties (k = 1), common to all runs: {'; '.join(parts)}. The campaign was identified again "
        "with each of them one standard uncertainty high and low; the intervals hold both types. Bands and errors that "
        "the evidence shows beside the parameters, and comparisons and judgements made with them, are of type A."
    )


def budget_table(findings: Findings) -> TableView | None:
    """List by parameter both parts of the standard error and what rules the second; None where there is no type B."""
    told = [p for p in findings.parameters if p.type_b is not None and p.std_error]
    if not told:
        return None
    by_place = _effects(findings)
    rows: list[list[Cell]] = []
    for p in told:
        size = abs(p.value or 0.0) or math.nan
        rows.append([
            Markup("<code>{}</code>").format(clean(p.name)), clean(place_of(p)), _share(p.std_error, size), _share(type_a(p), size),
            _share(p.type_b, size), _ruling(by_place.get((p.name, place_of(p)), ()), p),
        ])  # fmt: skip
    columns = [Column("Parameter"), Column("At"), Column("standard error (%)"), Column("type A (%)"), Column("type B (%)"),
               Column("Type B mostly from")]  # fmt: skip
    kept = [place for place, column in enumerate(columns) if any(row[place] not in (None, "") for row in rows)]
    caption = "In per cent of the value. Type A is the scatter of the data; type B is what calibrations leave open."
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
    return "" if part is None or not math.isfinite(part / size) else plain(100 * part / size, 2)


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
