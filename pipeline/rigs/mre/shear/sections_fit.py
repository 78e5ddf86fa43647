"""How well the dynamic model is known: correlation, residuals, agreement and order of the runs (mre.md section 7)."""

from __future__ import annotations

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Column, Figure, Mark, Matrix, Panel, Points, Rule, Table
from pipeline.rigs.in_words import chance, found_by_tests
from pipeline.rigs.mre.shear.captions import off_the_model, stands_out
from pipeline.rigs.mre.shear.sections_many import is_many, residual_quantiles

_NO_GAIN = 1e-9
METRICS = {
    "stiffness_secant": "secant stiffness",
    "stiffness_storage": "storage stiffness K'",
    "damping": "damping",
    "loss_factor": "loss factor",
}


def of_fit(findings: Findings) -> list[Figure | Table]:
    """Return what there is to show of the fit."""
    if is_many(findings):
        return [*_correlation(findings), *residual_quantiles(findings), *_checks(findings)]
    return [
        *_correlation(findings),
        *_agreement(findings),
        *_residuals(findings),
        *_checks(findings),
        *_sequence(findings),
        *_runs(findings),
    ]


def _agreement(findings: Findings) -> list[Figure]:
    """Compare each run's metrics with the model at that run's own frequency and amplitude."""
    table = findings.arrays.get("agreement")
    if table is None:
        return []
    panels = []
    for name, label in METRICS.items():
        part = table[table["metric"] == name]
        order = np.arange(1, len(part) + 1, dtype=float)
        off, low, high = (part[column].to_numpy(float) for column in ("ratio", "low", "high"))
        marks: list[Mark] = [
            Points(order, off - 1, "measured", "", low - 1, high - 1),
            Rule(y=0.0),
        ]
        panels.append(
            Panel(
                marks, Axis("run, its number in 'Fit of each run'", whole=True), Axis("measured less model", "%"), label
            )
        )
    return [
        Figure(
            "agreement",
            "Loop metrics against the model",
            f"Do the loops agree with the model at their own frequency and amplitude? {off_the_model(table)}",
            "difference of secant and storage stiffness, damping and loss factor from the model, one point a run",
            panels,
            columns=2,
        )
    ]


def _checks(findings: Findings) -> list[Table]:
    table = findings.arrays.get("residual_checks")
    if table is None:
        return []
    rows = [[row["of"], row["name"], chance(row["p_value"]), row["verdict"]] for row in table.to_dict("records")]
    return [
        Table(
            "residual_checks",
            "Tests of the residual",
            f"Is the residual only noise? {found_by_tests(table['p_value'])} A chance below 1 % says that something is left besides noise, the last column "
            "how much.",
            [Column("residual of"), Column("test"), Column("chance"), Column("result")],
            rows,
        )
    ]


def _sequence(findings: Findings) -> list[Figure]:
    """Show the gain of each run in the order in which they were made."""
    table = findings.arrays.get("runs")
    if table is None or not {"sequence", "gain"} <= set(table.columns):
        return []
    known = table[table["sequence"].notna() & table["gain"].notna()].sort_values("sequence")
    if len(known) < 4:
        return []
    marks: list[Mark] = [
        Points(known["sequence"].to_numpy(float), known["gain"].to_numpy(float), "measured", "", texts=list(known["run"])),
        Rule(y=0.0),
    ]  # fmt: skip
    return [
        Figure(
            "sequence",
            "Runs in the order in which they were made",
            "Does the sample change during the campaign (heating, Mullins effect, relaxation)? Force of each run against "
            "the model; a trend would be one, scatter about zero is none.",
            "relative gain of each run over its place in the sequence",
            [Panel(marks, Axis("place in the sequence", whole=True), Axis("force against the model", "%"))],
        )
    ]


def _correlation(findings: Findings) -> list[Figure]:
    table = findings.arrays.get("correlation")
    if table is None or len(table) < 2:
        return []
    names = list(table["name"])
    condition = float(table["condition"].iloc[0])
    said = (
        "above 500: only combinations are known" if condition > 500 else "below 500: the parameters can be told apart"
    )
    if condition <= 500 and findings.verdict == "rejected":
        said = "of a model that does not hold, which tells nothing of the device"
    return [
        Figure(
            "correlation",
            "Correlation of the parameters",
            f"Which parameters trade for each other? Correlation of the estimates; condition number {condition:.3g}, {said}.",
            "matrix of correlation coefficients",
            [Panel([Matrix(table[names].to_numpy(), names, names)])],
        )
    ]


def _residuals(findings: Findings) -> list[Figure]:
    table = findings.arrays.get("residual_harmonics")
    if table is None:
        return []
    order = table["order"].to_numpy(float)
    marks: list[Mark] = [
        Points(order - 0.12, table["real"].to_numpy(), 0, "in phase"),
        Points(order + 0.12, table["imaginary"].to_numpy(), 1, "out of phase"),
        Rule(y=1.96, label="95 %"),
        Rule(y=-1.96),
    ]
    share = float((np.abs(table[["real", "imaginary"]].to_numpy()) < 1.96).mean())
    return [
        Figure(
            "residual_harmonics",
            "Residual by harmonic",
            f"Is the residual no more than noise? {100 * share:.0f} % lie within 1.96 standard deviations, 95 % would for pure noise; the "
            f"largest is {np.abs(table[['real', 'imaginary']].to_numpy()).max():.1f}. Misfit of every harmonic of "
            "every run over its standard deviation, run scatter not taken out.",
            "normalised residual over the order of the harmonic",
            [Panel(marks, Axis("order of the harmonic", whole=True), Axis("residual over its standard deviation"))],
        )
    ]


def _runs(findings: Findings) -> list[Table]:
    table = findings.arrays.get("runs")
    if table is None or "chi2_reduced" not in table:
        return []
    used = table[table["chi2_reduced"].notna()].head(200)
    columns = [
        Column("number", "1"),
        Column("run"),
        Column("misfit of the force", "%"),
        Column("chi2 per datum"),
    ]
    gains = used["gain"].abs().max() > _NO_GAIN
    if gains:
        columns.append(Column("gain against the model", "%"))
    predicted = "prediction_nrmse" in used and used["prediction_nrmse"].notna().any()
    if predicted:
        columns.append(Column("misfit when predicted by the others", "%"))
    rows = []
    for number, row in enumerate(used.to_dict("records"), 1):
        cells: list[str | float | None] = [number, row["run"], _three(row["nrmse"]), f"{row['chi2_reduced']:.3g}"]
        if gains:
            cells.append(_three(row["gain"]))
        if predicted:
            cells.append(_three(row["prediction_nrmse"]))
        rows.append(cells)
    return [
        Table(
            "fit_by_run",
            "Fit of each run",
            f"Does one run stand out? {stands_out(used)} It is without run scatter, near 1 where noise explains the misfit."
            + (
                " A gain far off the others' names a run to be checked."
                if gains
                else " No run has a gain of its own in the fit."
            ),
            columns,
            rows,
        )
    ]


def _three(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(f"{value:.3g}") + 0.0
