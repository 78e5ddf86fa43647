"""The models that competed for the data, and which of them was taken by how much."""

from __future__ import annotations

from collections.abc import Sequence, Set

from markupsafe import Markup

from pipeline.findings import ModelResult
from pipeline.findings.figures import Cell, Column, Status, Table
from pipeline.report.many_runs import models_summary
from pipeline.report.numbers import plain
from pipeline.report.reading_units import reading_unit
from pipeline.report.table import MOST_ROWS, TableView, badge, table_view
from pipeline.report.words import clean
from pipeline.rigs.in_words import sentence

_MOST_ANSWERS = 3  # families whose models a caption names


def models_table(models: Sequence[ModelResult]) -> TableView:
    """Compare models; AICc and BIC are shown above the smallest of the family. Very many fits are summed up."""
    if len(models) > MOST_ROWS:
        return models_summary(models)
    least: dict[tuple[str, str], float] = {}
    for model in models:
        for name in ("aicc", "bic"):
            value = getattr(model, name)
            if value is not None:
                least[model.family, name] = min(value, least.get((model.family, name), value))

    def above(model: ModelResult, name: str) -> float | None:
        value = getattr(model, name)
        return None if value is None else value - least[model.family, name]

    units = {m.unit for m in models if m.rms_residual is not None and m.unit}
    shared = next(iter(units)) if len(units) == 1 else ""

    def residual(model: ModelResult) -> Cell:
        if shared or model.rms_residual is None or not model.unit:
            return model.rms_residual
        read = reading_unit(model.unit, model.rms_residual)
        return f"{plain(read.read(model.rms_residual), 3)} {read.name}"

    columns = [
        Column("Of"), Column("Model"), Column("Parameters"), Column("Data"), Column("rms residual", shared or ("" if units else "1")),
        Column("NRMSE", "%"), Column("χ² reduced", "1"), Column("ΔAICc", "1"), Column("ΔBIC", "1"),
        Column("Error on runs left out", "%"), Column("What it is"),
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        [
            clean(m.family), Markup("<b>{}</b> {}").format(clean(m.name), badge(Status("selected", "ok"))) if m.selected else clean(m.name),
            m.n_parameters, m.n_data, residual(m), m.nrmse, m.chi2_reduced, above(m, "aicc"),
            above(m, "bic"), m.cv_error, clean(m.description),
        ]
        for m in models
    ]  # fmt: skip
    kept = [place for place in range(len(columns)) if any(row[place] not in (None, "") for row in rows)]
    caption = _which(models, {columns[place].heading for place in kept})
    return table_view(
        Table(
            "models", "Models compared", caption, [columns[c] for c in kept], [[row[c] for c in kept] for row in rows]
        )
    )


def _which(models: Sequence[ModelResult], shown: Set[str]) -> str:
    """Say which models are taken and by how much they are better, and what the columns mean that are `shown`."""
    taken = [model for model in models if model.selected]
    said = ["Which model do the data support?"]
    if 0 < len(taken) <= _MOST_ANSWERS:
        said.append(
            sentence(
                "; ".join(
                    f"{f'for {one.family} ' if one.family else ''}“{one.name}”{_ahead(one, models)}" for one in taken
                )
            )
        )
    if "NRMSE" in shown:
        said.append("NRMSE is the rms residual over the rms of the measured signal about its mean.")
    if shown & {"ΔAICc", "ΔBIC"}:
        said.append(
            "ΔAICc and ΔBIC count from the best model of the same data; a difference above about 10 is decisive."
        )
    return " ".join(said)


def _ahead(taken: ModelResult, models: Sequence[ModelResult]) -> str:
    """Say how far a model is ahead of the others of its family: by AICc, by BIC where there is none."""
    for criterion, name in (("aicc", "AICc"), ("bic", "BIC")):
        own = getattr(taken, criterion)
        rivals = [getattr(one, criterion) for one in models if one.family == taken.family and one is not taken]
        others = [value for value in rivals if value is not None]
        if own is None or not others:
            continue
        ahead = min(others) - own
        if ahead < 0:
            return f", although the {name} of another is {-ahead:.{_places(-ahead)}f} less"
        return f", its {name} {ahead:.{_places(ahead)}f} below the next"
    return ""


def _places(number: float) -> int:
    return 0 if number >= 10.0 else 1
