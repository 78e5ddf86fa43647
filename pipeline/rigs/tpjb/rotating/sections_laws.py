"""Tables of the models, distortion over the load ratio, and the comparison with the other tests."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Panel,
    Points,
    Rule,
    Status,
    Table,
    Text,
    Value,
)
from pipeline.rigs.tpjb.rotating import answers
from pipeline.rigs.tpjb.rotating.law import COEFFICIENTS
from pipeline.rigs.tpjb.rotating.sections_orbits import runs_in_order, title

_THD = Axis("THD of the bearing alone", "%")


def of_laws(findings: Findings) -> list[Figure | Table | Text]:
    """Return the table of models and that of their coefficients, one pair a static load."""
    table = findings.arrays.get("models")
    if table is None:
        return []
    blocks: list[Figure | Table | Text] = []
    for number, (group, part) in enumerate(table.groupby("group", sort=False)):
        blocks.append(_criteria(str(group), part, number))
        blocks += _coefficients(str(group), part, number)
    hidden = [f"{row['group']}: {row['model']} is left out of figures, {row['hidden']}."
              for _, row in table.iterrows() if row["hidden"]]  # fmt: skip
    return [*blocks, Text(hidden)] if hidden else blocks


def _criteria(group: str, part: pd.DataFrame, number: int) -> Table:
    rows: list[list[Cell]] = []
    for _, row in part.iterrows():
        state: Cell = Status("selected", "ok") if row["selected"] else ""
        rows.append(
            [
                row["model"], int(row["n_parameters"]), round(float(row["chi2_reduced"]), 2), round(float(row["bic"] - part["bic"].min())),
                float(f"{row['rms']:.3g}"), float(f"{row['effect']:.3g}"), _three(row["fold_margin"]),
                _three(row["mean_shift_x"]), _three(row["mean_shift_y"]), state,
            ]
        )  # fmt: skip
    return Table(
        f"models_{number}",
        f"Models, {group}",
        f"Which law do the orbits ask for? {answers.of_models(part)} The rule: smallest BIC, unless the term changes the orbit "
        "by less than 1 % of the 1X. chi2 is per degree of freedom with the noise that no smooth function of the force explains: 2 and more means that the law "
        "does not hold. Fold margin: least det J over det K on the orbit, 1 for a linear law, 0 at the fold. Mean shift: of "
        "the orbit from the equilibrium at the largest load.",
        [
            Column("model"), Column("terms"), Column("chi2"), Column("BIC above the best"), Column("misfit rms", "m"),
            Column("differs from the best by", "%"), Column("fold margin"), Column("mean shift x", "m"),
            Column("mean shift y", "m"), Column(""),
        ],
        rows,
    )  # fmt: skip


def _coefficients(group: str, part: pd.DataFrame, number: int) -> list[Table]:
    """Return the table of linear and that of quadratic coefficients."""
    tables = []
    for kind, names, unit in (("Linear", COEFFICIENTS[:4], "N/m"), ("Quadratic", COEFFICIENTS[4:], "N/m^2")):
        own = part[part[list(names)].notna().any(axis=1)]
        if own.empty:
            continue
        rows: list[list[Cell]] = []
        for _, row in own.iterrows():
            cells: list[Cell] = [str(row["model"])]
            for name in names:
                known = not math.isnan(row[name])
                cells.append(Value(float(row[name]), _positive(row[f"{name}_sd"])) if known else None)
            rows.append(cells)
        tables.append(
            Table(
                f"{kind.lower()}_{number}",
                f"{kind} coefficients of every model, {group}",
                f"What would each law say? {answers.of_coefficients(own, part)} Standard errors are of type A, under the residual of "
                "each law. What cannot be told one by one stands among the parameters with its reason.",
                [Column("model"), *(Column(name, unit) for name in names)],
                rows,
            )
        )
    return tables


def _positive(value: float) -> float | None:
    return float(value) if value > 0 and math.isfinite(value) else None


def of_limit(findings: Findings) -> list[Figure | Table]:
    """Return distortion over the load ratio with the limits, and the table of runs."""
    return [*_thd(findings), _runs(findings)]


def _thd(findings: Findings) -> list[Figure]:
    runs = runs_in_order(findings)
    told = runs[runs["thd"].notna() & runs["ratio"].notna()]
    if told.empty:
        return []
    curves = findings.arrays.get("limit")
    low = float(findings.settings.get("thd_linear", 0.025))
    high = float(findings.settings.get("thd_nonlinear", 0.05))
    over_ratio: list[Mark] = []
    over_displacement: list[Mark] = []
    limits = []
    for number, (group, part) in enumerate(told.groupby("group", sort=False)):
        if curves is not None:
            curve = curves[curves["group"] == group]
            over_ratio.append(Line(curve["ratio"].to_numpy(), curve["thd"].to_numpy(), number, str(group)))
            over_displacement.append(
                Line(curve["displacement"].to_numpy(), curve["thd"].to_numpy(), number, str(group))
            )
        y = part["thd"].to_numpy()
        half = 1.96 * part["thd_sd"].to_numpy()
        points = (y, number, f"{group}, measured", np.maximum(y - half, 0.0), y + half)
        over_ratio.append(Points(part["ratio"].to_numpy(), *points))
        over_displacement.append(Points(part["first"].to_numpy(), *points))
    rules = [
        Rule(y=low, label=f"{100 * low:g} %, linear below"),
        Rule(y=high, label=f"{100 * high:g} %, nonlinear above"),
    ]
    for found in findings.find("linear_limit"):
        if found.value is not None:
            load = found.at.get("static_load")
            where = f" at {float(load) / 1e3:.4g} kN" if isinstance(load, int | float) else ""
            short = f", {float(load) / 1e3:.4g} kN" if isinstance(load, int | float) else ""
            over_ratio.append(Rule(x=found.value, label=f"{found.value:.3g}{short}"))
            error = f" ± {(found.ci95[1] - found.ci95[0]) / 2:.1g}" if found.ci95 else ""
            limits.append(f"rho* = {found.value:.3f}{error}{where}")
    answer = f"Up to {'; '.join(limits)}" if limits else "No limit could be told, see the parameters"
    return [
        Figure(
            "thd",
            "Distortion over the load ratio",
            f"Up to which load is the bearing linear? {answer}. Points: each run, with 95 % limits, what the load's own "
            "harmonics explain taken out; lines: the selected law under a circular load. rho* is the load ratio at which "
            f"the THD is {100 * high:g} %.",
            "THD over load ratio and over the size of the orbit, with the limits of the verdict",
            [
                Panel([*over_ratio, *rules], Axis("load ratio F/W", "%"), _THD, "over the load ratio"),
                Panel([*over_displacement, *rules], Axis("1X amplitude of the orbit", "m"), _THD, "over the orbit"),
            ],
            columns=2,
            share_y=True,
        )
    ]


def _runs(findings: Findings) -> Table:
    low = float(findings.settings.get("thd_linear", 0.025))
    high = float(findings.settings.get("thd_nonlinear", 0.05))
    rows: list[list[Cell]] = []
    words = []
    for _, row in runs_in_order(findings).iterrows():
        thd = row["thd"]
        if math.isnan(thd):
            state = Status("refused")
        else:
            word = "linear" if thd < low else "marginal" if thd <= high else "nonlinear"
            state = Status(word, "ok" if thd < low else "warning" if thd <= high else "unsaid")
        words.append(state.word)
        rows.append(
            [
                title(row), _three(row["turns"]), Value(None if math.isnan(thd) else float(thd), _positive(row["thd_sd"])),
                _three(row["thd_load"]), _three(row["misfit_linear"]), _three(row["stiffness_change"]),
                _three(row["displacement"]), _three(row["over_clearance"]), state,
            ]
        )  # fmt: skip
    return Table(
        "distortion",
        "Distortion of each run",
        f"How nonlinear is each run? {answers.of_runs(words)} THD of what the linear bearing and the load's harmonics do not explain; misfit of a linear law (M2 of this run "
        "alone) over the rms orbit; change of its stiffness against the lowest ratio, where there are several; the largest distance from equilibrium.",
        [
            Column("run"), Column("turns"), Column("THD", "%"), Column("THD of the load", "%"),
            Column("misfit of a linear law", "%"), Column("change of stiffness", "%"), Column("largest |d|", "m"),
            Column("|d| over clearance", "%"), Column("verdict"),
        ],
        rows,
    )  # fmt: skip


def _three(value: float) -> float | None:
    return float(f"{value:.3g}") + 0.0 if math.isfinite(value) else None


_M6 = "Quadratic terms and stiffnesses of the orbits are those of M6, whichever model is selected. "
_POTENTIAL = "Has the film's force a potential"
_OF_MODEL = {"Load dependence of stiffness": _M6, _POTENTIAL: _M6}
_HOW = "Each side with its own error; z is the difference over its standard error, correlation of both sides included; within 3 they agree. "
_OF_UNIT = {"N/m": "stiffness", "N/m^2": "quadratic terms", "m": "static positions"}


def of_consistency(findings: Findings) -> list[Figure | Table | Text]:
    """Return the comparison with the dynamic test, the relations of load dependence, and the conservative check."""
    table = findings.arrays.get("consistency")
    if table is None:
        return []
    tables: list[Figure | Table | Text] = []
    for number, ((kind, unit), part) in enumerate(table.groupby(["kind", "unit"], sort=False)):
        rows: list[list[Cell]] = []
        for _, row in part.iterrows():
            z, holds = row["z"], row["holds"]
            state = Status.not_checkable if pd.isna(z) else Status.agrees if holds else Status.contradicts
            if kind == _POTENTIAL and not pd.isna(z):
                state = Status("holds", "ok") if holds else Status("does not hold", "warning")
            left = Value(None if pd.isna(row["left"]) else float(row["left"]), _positive(row["left_sd"]))
            right = Value(float(row["right"]), _positive(row["right_sd"]))
            rows.append(
                [
                    row["group"],
                    str(row["name"]).replace("dk", "d k"),
                    left,
                    right,
                    "" if pd.isna(z) else f"{z:+.1f}",
                    state,
                ]
            )
        sides = (
            ("left side", "right side") if part["name"].str.contains(" = ").all() else ("rotating load", "dynamic test")
        )
        meanings = list(dict.fromkeys(part.loc[part["holds"].isin([False]), "meaning"]))
        said = " ".join(f"Where it fails: {meaning}." for meaning in meanings)
        tables.append(
            Table(
                f"consistency_{number}",
                f"{kind}, {_OF_UNIT.get(str(unit), unit)}",
                f"{'Does the relation hold' if kind == _POTENTIAL else 'Do both sides agree'}? {answers.of_comparison(part)} "
                f"{_OF_MODEL.get(str(kind).split(' (')[0], '') if unit != 'm' else ''}{_HOW if not tables else ''}{said}".strip(),
                [
                    Column("bearing, load"),
                    Column("comparison"),
                    *(Column(side, str(unit)) for side in sides),
                    Column("z"),
                    Column("result"),
                ],
                rows,
            )
        )
    return tables
