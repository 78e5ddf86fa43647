"""Very many runs and models at a glance: how often each condition has which value, why runs are left out, which models win."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from pipeline.findings import ModelResult, Run
from pipeline.findings.figures import Cell, Column, Table
from pipeline.report.gathered import gathered, runs_cell
from pipeline.report.numbers import plain
from pipeline.report.parameters import condition_text, unit_of_condition
from pipeline.report.reading_units import reading_unit, typical
from pipeline.report.table import TableView, table_view
from pipeline.report.words import clean
from pipeline.rigs.experiment import Experiment

_MOST_VALUES = 8


def conditions_table(runs: Sequence[Run], names: Sequence[str], experiment: Experiment) -> TableView:
    """Tell how many runs were made at which value of each condition in `names`, and how long they are."""
    rows: list[list[Cell]] = [["duration", _values([run.duration for run in runs], "s")]]
    rows += [
        [
            clean(name).replace("_", " "),
            _values([run.conditions.get(name) for run in runs], unit_of_condition(experiment, name)),
        ]
        for name in names
    ]
    caption = "In brackets the number of runs."
    return table_view(
        Table("conditions", f"Conditions of {len(runs)} runs", caption, [Column("Condition"), Column("Values")], rows)
    )


def _values(values: Sequence[float | str | bool | None], unit: str) -> str:
    counts = Counter(value for value in values if value is not None)
    missing = len(values) - counts.total()
    numbers = [value for value in counts if isinstance(value, int | float) and not isinstance(value, bool)]
    ordered = sorted(
        counts, key=lambda value: (isinstance(value, str), value if isinstance(value, str) else float(value))
    )
    if len(counts) <= _MOST_VALUES:
        told = [f"{condition_text(value, unit)} ({counts[value]})" for value in ordered]
    elif len(numbers) == len(counts):
        every = np.array([float(value) for value in values if value is not None])
        shown = reading_unit(unit or "1", typical(every))
        low, middle, high = (plain(shown.read(float(value))) for value in (every.min(), np.median(every), every.max()))
        told = [
            f"{low} … {high} {shown.name}".rstrip(),
            f"median {middle} {shown.name}".rstrip(),
            f"{len(counts)} values",
        ]
    else:
        often = [f"{condition_text(value, unit)} ({n})" for value, n in counts.most_common(_MOST_VALUES)]
        told = [*often, f"{len(counts) - _MOST_VALUES} other values"]
    return "; ".join(told + ([f"not given ({missing})"] if missing else []))


def left_out_table(runs: Sequence[Run]) -> TableView | None:
    """List why runs are not used, each reason once, and which runs; None where all are used."""
    left_out = [run for run in runs if not run.used]
    kinds = gathered([run.reason or "no reason is told" for run in left_out], {run.run for run in runs})
    kinds.sort(key=lambda one: -len(one.places))
    rows: list[list[Cell]] = [
        [clean(one.text), len(one.places), runs_cell([left_out[place].run for place in one.places])] for one in kinds
    ]
    columns = [Column("Why not used"), Column("How many"), Column("Runs")]
    return table_view(Table("left-out", "Runs that are not used", "", columns, rows)) if rows else None


def models_summary(models: Sequence[ModelResult]) -> TableView:
    """Tell of each model how often it was fitted and selected, and how well it usually fits."""
    by_name: dict[str, list[ModelResult]] = {}
    for model in models:
        by_name.setdefault(model.name, []).append(model)
    of: list[tuple[Column, Callable[[ModelResult], float | None]]] = [
        (Column("Median NRMSE", "%"), lambda model: model.nrmse),
        (Column("Median χ² reduced", "1"), lambda model: model.chi2_reduced),
        (Column("Median error on runs left out", "%"), lambda model: model.cv_error),
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        [clean(name), len(same), sum(model.selected for model in same), *(_median([get(model) for model in same]) for _, get in of),
         clean(same[0].description)]
        for name, same in by_name.items()
    ]  # fmt: skip
    columns = [
        Column("Model"),
        Column("Fitted"),
        Column("Selected"),
        *(column for column, _ in of),
        Column("What it is"),
    ]
    kept = [place for place in range(len(columns)) if any(row[place] not in (None, "") for row in rows)]
    caption = (
        "NRMSE is the rms residual over the rms of the measured signal about its mean. Each fit with AICc and BIC stands in "
        "findings.json."
    )
    return table_view(
        Table(
            "models",
            f"{len(models)} fits, by model",
            caption,
            [columns[c] for c in kept],
            [[row[c] for c in kept] for row in rows],
        )
    )


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None
