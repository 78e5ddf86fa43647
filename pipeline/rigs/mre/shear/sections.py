"""What the report of `mre.shear` shows, drawn from parameters and arrays only (mre.md section 7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Column,
    Figure,
    Line,
    Mark,
    Panel,
    Points,
    Rule,
    Section,
    Table,
    Text,
    Value,
)
from pipeline.rigs.mre.micromechanics.sections import sections as micromechanics
from pipeline.rigs.mre.shear import captions
from pipeline.rigs.mre.shear.captions import level_text
from pipeline.rigs.mre.shear.sections_field import of_field
from pipeline.rigs.mre.shear.sections_fit import of_fit
from pipeline.rigs.mre.shear.sections_many import by_condition, is_many, means, middle, of_many

DISPLACEMENT, FORCE = Axis("displacement", "m"), Axis("force", "N")
METRICS = {
    "stiffness_secant": Axis("secant stiffness", "N/m"),
    "stiffness_storage": Axis("storage stiffness K'", "N/m"),
    "damping": Axis("damping", "N s/m"),
    "loss_factor": Axis("loss factor"),
}
_PANELS = 16
# Of many runs those are shown that stand at these shares of all, from the best met to the worst.
_SHARES = {"best": 0.0, "lower quartile": 0.25, "median": 0.5, "upper quartile": 0.75, "worst": 1.0}


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    chapters = [
        Section("loops", "Measured loops and the model", [*_loops(findings), *_half_cycles(findings)]),
        Section("records", "Records without a period", _records(findings)),
        Section("over_runs", "From run to run", of_many(findings) if is_many(findings) else []),
        Section(
            "metrics",
            "Stiffness and damping by condition" if is_many(findings) else "Stiffness and damping of each run",
            _metrics(findings),
        ),
        Section("field", "What the field adds", of_field(findings)),
        Section("fit", "How well the model is known", of_fit(findings)),
    ]
    return [*(chapter for chapter in chapters if chapter.blocks), *micromechanics(findings)]


def _chosen(runs: Sequence[str], table: pd.DataFrame) -> list[str]:
    """Take all runs where they are few, else the best, the worst and some between, by misfit."""
    if len(runs) <= _PANELS:
        return list(runs)
    misfit = (
        table.set_index("run")["nrmse"].reindex(list(runs)) if "nrmse" in table else pd.Series(0.0, index=list(runs))
    )
    ordered = list(misfit.sort_values(kind="stable").index)
    kept = {ordered[round(i)] for i in np.linspace(0, len(ordered) - 1, _PANELS)}
    return [run for run in runs if run in kept]


def _titles(findings: Findings) -> dict[str, str]:
    titles = {}
    for row in findings.arrays["runs"].to_dict("records"):
        parts = [str(row["run"])]
        if pd.notna(row.get("frequency")):
            parts.append(f"{row['frequency']:.3g} Hz")
        if pd.notna(row.get("current")):
            parts.append(level_text(row["current"]))
        if isinstance(row.get("stands_for"), str):
            parts.insert(0, row["stands_for"])
        titles[str(row["run"])] = ", ".join(parts)
    return titles


def _loops(findings: Findings) -> list[Figure]:
    if "loops" not in findings.arrays:
        return []
    loops, samples = findings.arrays["loops"], findings.arrays["samples"]
    titles = _titles(findings)
    every_run = findings.arrays["runs"]
    of_many = is_many(findings) and "stands_for" in every_run
    every = (
        list(every_run[every_run["stands_for"].notna()].sort_values("nrmse", kind="stable")["run"])
        if of_many and "nrmse" in every_run
        else list(loops["run"].unique())
    )
    shown = _chosen(every, every_run)
    panels, rest = [], []
    for run in shown:
        curve, cloud = loops[loops["run"] == run], samples[samples["run"] == run]
        x, F, model, missed = (_closed(curve[n].to_numpy()) for n in ("displacement", "force", "model", "residual"))
        marks: list[Mark] = [Points(cloud["displacement"].to_numpy(), cloud["force"].to_numpy(), "measured", "samples")]
        fitted = np.isfinite(model).any()
        marks.append(Line(x, model, "model", "model") if fitted else Line(x, F, "reference", "harmonics"))
        panels.append(Panel(marks, DISPLACEMENT, FORCE, titles.get(run, run)))
        if fitted:
            rest.append(Panel([Line(x, missed, "residual"), Rule(y=0.0)], DISPLACEMENT, FORCE, titles.get(run, run)))
    number = (
        f"{len(shown)} of {len(every_run)} runs, at fixed shares of all from the best met to the worst (misfit of the force over its rms)"
        if of_many
        else f"{len(shown)} of {len(every)} runs, from the best to the worst met"
        if len(shown) < len(every)
        else "every run"
    )
    figures = [
        Figure(
            "loops",
            "Loops",
            f"Does the model follow the loops? {captions.followed(every_run)} Samples, and the loop of the fitted model, of {number}.{captions.not_fitted(loops)} "
            "A loop that looks right proves little: see the residuals.",
            "force over displacement, samples and model, one panel a run",
            panels,
            columns=3 if of_many else 4 if len(panels) > 4 else 2,
            share_x=True,
            share_y=True,
        )
    ]
    if rest:
        figures.append(
            Figure(
                "loop_residuals",
                "Residual loops",
                f"What does the model miss? {captions.missed(loops)} Measured harmonics less model over one cycle, those on the mains left out; a shape that repeats from run to "
                "run is the model's fault, one that does not is the run's.",
                "residual force over displacement, one panel a run",
                rest,
                columns=3 if of_many else 4 if len(rest) > 4 else 2,
                share_x=True,
                share_y=True,
            )
        )
    return figures


def _closed(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.r_[values, values[:1]])


def _half_cycles(findings: Findings) -> list[Figure]:
    if "half_cycles" not in findings.arrays:
        return []
    table = findings.arrays["half_cycles"]
    panels = []
    for run in list(table["run"].unique())[:_PANELS]:
        part = table[table["run"] == run]
        line = Line(part["displacement"].to_numpy(), part["force"].to_numpy(), "measured", "load and unload")
        panels.append(Panel([line], DISPLACEMENT, FORCE, str(run)))
    return [
        Figure(
            "half_cycles",
            "Half cycles",
            "How much work is lost? The area between loading (upper branch) and unloading. One half cycle only: neither "
            "damping nor the dynamic model can be told from it.",
            "force over displacement, one panel a run",
            panels,
            columns=2,
        )
    ]


def _records(findings: Findings) -> list[Figure | Text]:
    if "series" not in findings.arrays:
        return []
    table = findings.arrays["series"]
    errors = [model.cv_error for model in findings.models if model.cv_error is not None]
    predicted = (
        f" Fitted to the first half only, it misses {100 * max(errors):.3g} % of the force (rms) in the second."
        if errors
        else ""
    )
    blocks: list[Figure | Text] = []
    for run in list(table["run"].unique())[:4]:
        part = table[table["run"] == run]
        time = part["time"].to_numpy()
        few = slice(0, min(time.size, 1200))
        force, model = part["force"].to_numpy(), part["model"].to_numpy()
        blocks.append(
            Figure(
                f"record_{len(blocks)}",
                f"Record {run}",
                f"Does the model follow the record? A stretch of its second half; the model shown is that of the whole "
                f"record.{predicted}",
                "force over time, measured and model; below the residual; beside the loops",
                [
                    Panel(
                        [
                            Line(time[few], force[few], "measured", "measured"),
                            Line(time[few], model[few], "model", "model"),
                        ],
                        Axis("time", "s"),
                        FORCE,
                        "force",
                    ),
                    Panel(
                        [Line(time[few], (force - model)[few], "residual"), Rule(y=0.0)],
                        Axis("time", "s"),
                        FORCE,
                        "residual",
                    ),
                    Panel(
                        [
                            Line(part["displacement"].to_numpy(), force, "measured", "measured"),
                            Line(part["displacement"].to_numpy(), model, "model", "model"),
                        ],
                        DISPLACEMENT,
                        FORCE,
                        "loops",
                    ),
                ],
                columns=1,
            )
        )
    return blocks


def _metrics(findings: Findings) -> list[Figure | Table]:
    runs = findings.arrays.get("runs")
    if runs is None or "stiffness_secant" not in runs:
        return []
    runs = runs[runs["stiffness_secant"].notna()].copy()
    runs["level"] = [level_text(value) for value in runs["current"].astype(float)]
    blocks: list[Figure | Table] = []
    fitted = runs[runs["chi2_reduced"].notna()] if "chi2_reduced" in runs else runs  # of one preload
    if len(fitted) > 2:
        for over, label, unit in (("frequency", "frequency", "Hz"), ("amplitude", "amplitude", "m")):
            if fitted[over].max() > 1.05 * fitted[over].min():
                blocks.append(_against(findings, fitted, over, Axis(label, unit)))
    return [*blocks, *(by_condition(findings) if is_many(findings) else _metrics_tables(findings, runs))]


def _against(findings: Findings, runs: pd.DataFrame, over: str, axis: Axis) -> Figure:
    lines = findings.arrays.get("model_lines")
    other = "amplitude" if over == "frequency" else "frequency"
    shown = "each run"
    if is_many(findings):
        runs = middle(runs, other)
        at = float(runs[other].median())
        lines = lines[(lines[other] / at - 1).abs() < 0.05] if lines is not None and other in lines else lines
        shown = (
            f"means of the runs of each condition at {f'{1e3 * at:.3g} mm' if other == 'amplitude' else f'{at:.3g} Hz'}"
        )
        runs = means(runs, list(METRICS))
    known = sorted({round(float(value), 1) for value in runs["current"].dropna()})
    levels: list[float | None] = [*known] or [None]
    panels = []
    for name, y in METRICS.items():
        marks: list[Points | Line] = []
        for number, level in enumerate(levels):
            near = runs if level is None else runs[(runs["current"] - level).abs() < 0.3]
            part = near.sort_values(over)
            marks.append(
                Points(
                    part[over].to_numpy(float),
                    part[name].to_numpy(float),
                    number,
                    level_text(level),
                    part[f"{name}_low"].to_numpy(float),
                    part[f"{name}_high"].to_numpy(float),
                )
            )
            if lines is not None:
                curves = lines[lines["over"] == over]
                curves = curves if level is None else curves[(curves["current"] - level).abs() < 0.3]
                if len(curves):
                    marks.append(Line(*_strokes(curves, over, name), number))
        panels.append(Panel(marks, axis, y, y.label))
    drawn = ""
    if lines is not None and (lines["over"] == over).any():
        own = bool(lines.loc[lines["over"] == over, "own"].all())
        drawn = (
            f"; lines: the model at the {other} of the runs that they pass."
            if own
            else f"; lines: the model at the median {other}, so points at another may lie off them without contradiction."
        )
    return Figure(
        f"metrics_{over}",
        f"Stiffness and damping over {over}",
        f"How do stiffness and damping change with {over}? {captions.course(runs, over)} Points with 95 % intervals: {shown}{'' if is_many(findings) else f' at its own {other}'}"
        f"{drawn or '.'}",
        f"secant and storage stiffness, damping and loss factor over {over}, one colour a current",
        panels,
        columns=2,
    )


def _strokes(curves: pd.DataFrame, over: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return lines one after the other, with a gap (NaN) between them."""
    parts = [np.r_[part[[over, name]].to_numpy(float), [[np.nan, np.nan]]] for _, part in curves.groupby("line")]
    x, y = np.concatenate(parts).T
    return x, y


def _metrics_tables(findings: Findings, runs: pd.DataFrame) -> list[Table]:
    tables = [
        _run_table(
            findings,
            runs,
            "metrics",
            "Loop metrics",
            f"How stiff and how lossy are the loops? They have {captions.between(runs, captions.LOOPS)} Each run by itself, without the dynamic model. For an ellipse K_sec is |K*|, not K'.",
            {
                "stiffness_secant": Column("K_sec", "N/m"),
                "stiffness_storage": Column("K'", "N/m"),
                "damping": Column("damping", "N s/m"),
                "loss_factor": Column("loss factor", "1"),
            },
        )
    ]
    if "shear_modulus_storage" in runs:
        moduli = {"shear_modulus_storage": Column("G'", "Pa"), "shear_modulus_loss": Column("G''", "Pa")}
        told = f"Which moduli has the material? It has {captions.between(runs, captions.MODULI)} K' and K'' of each run times h/(2A), for the pads as declared."
        tables.append(_run_table(findings, runs, "moduli", "Shear moduli", told, moduli))
    return tables


def _run_table(
    findings: Findings, runs: pd.DataFrame, name: str, title: str, caption: str, columns: Mapping[str, Column]
) -> Table:
    by_run = {(p.name, p.at.get("run")): p for p in findings.parameters}
    rows = []
    for row in runs.head(200).to_dict("records"):
        cells: list[str | float | Value | None] = [str(row["run"]), row["frequency"], row["amplitude"]]
        cells.append(level_text(row["current"]) if pd.notna(row["current"]) else "")
        for column in columns:
            found = by_run.get((column, row["run"]))
            cells.append(Value(found.value, found.std_error, found.ci95) if found else None)
        rows.append(cells)
    first = [Column("run"), Column("frequency", "Hz"), Column("amplitude", "m"), Column("current")]
    return Table(name, title, caption, [*first, *columns.values()], rows)
