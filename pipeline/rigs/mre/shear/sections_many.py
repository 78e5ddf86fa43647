"""What the report of `mre.shear` shows of many runs in place of each: trends, odd runs, conditions, quantiles of residuals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.errors import counted
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Mark, Panel, Points, Rule, Table, Value
from pipeline.rigs.mre.shear.captions import LOOPS, between
from pipeline.rigs.mre.shear.trend import gains_over_runs
from pipeline.rigs.over_runs import MANY, OverRuns, distribution_panel, odd_table, over_runs, trend_figure

# Conditions are compared with themselves where half of them have so many repeats.
_REPEATS = 4
_NO_CURRENT = 1e-5
_CONDITION = ["current", "frequency", "amplitude"]
_METRICS = {
    "stiffness_secant": Column("K_sec", "N/m"),
    "stiffness_storage": Column("K'", "N/m"),
    "damping": Column("damping", "N s/m"),
    "loss_factor": Column("loss factor", "1"),
}


def is_many(findings: Findings) -> bool:
    """Tell whether there are too many runs to show each."""
    table = findings.arrays.get("runs")
    return table is not None and "condition" in table and len(table) > MANY


def numbers_over_runs(findings: Findings) -> list[OverRuns]:
    """Return what is looked at over the order of the runs; empty where nothing is known of half of them."""
    table = findings.arrays["runs"]
    known = table[table["gain"].notna()] if "gain" in table else table[:0]
    first: list[OverRuns] = []
    if len(known) > MANY and findings.verdict != "rejected":
        order = [[None if pd.isna(value) else float(value) for value in known[name]] for name in ("sequence", "begins")]
        first.append(gains_over_runs(list(known["run"]), known["gain"].to_list(), *order))
    chosen: list[tuple[str, np.ndarray, list[str] | None]] = []
    groups = [str(value) for value in table["condition"]]
    if table["condition"].value_counts().median() >= _REPEATS:
        chosen.append(("storage stiffness", table["stiffness_storage"].to_numpy(float), groups))
        chosen.append(("loss factor", table["loss_factor"].to_numpy(float), groups))
    if "nrmse" in table and not first and not chosen:
        chosen.append(("misfit of the force", table["nrmse"].to_numpy(float), None))
    told = [one for one in chosen if np.isfinite(one[1]).mean() > 0.5]
    by = {name: _told(table, name) for name in ("sequence", "begins")}
    units = {"storage stiffness": "N/m"}
    # The interval of a stiffness holds the scatter between runs already, that of a loss factor noise alone.
    errors = {"loss factor": (table["loss_factor_high"] - table["loss_factor_low"]).to_numpy(float) / 3.92}
    # The verdict rests on the gain, which is judged by itself; the others share one chance of a false alarm.
    return first + [
        over_runs(
            what,
            units.get(what, "1"),
            list(table["run"]),
            values,
            errors.get(what),
            groups=of,
            among=len(told),
            **by,
        )
        for what, values, of in told
    ]


def _told(table: pd.DataFrame, name: str) -> list[float | None] | None:
    if name not in table or table[name].isna().any():
        return None
    return [float(value) for value in table[name]]


def of_many(findings: Findings) -> list[Figure | Table]:
    """Return trends, distributions and odd runs."""
    numbers = numbers_over_runs(findings)
    if not numbers:
        return []
    odd = odd_table(numbers)
    return [
        trend_figure(
            numbers,
            "over_runs",
            "The campaign from run to run",
            "Does the rig or the sample change during the campaign (heating, Mullins effect, relaxation), and which runs are not as "
            "their like? Runs that were left out are not in it; the chapter on the runs names them.",
        ),
        Figure(
            "scatter",
            "Scatter from run to run",
            "How far do runs scatter about what is expected of them? Runs far off are counted in the outermost bars.",
            "histograms of the deviation of each run",
            [distribution_panel(number, number.what) for number in numbers],
            columns=2,
        ),
        *([odd] if odd is not None else []),
    ]


def by_condition(findings: Findings) -> list[Table]:
    """Return the metrics of each condition: means of its runs with the interval that their scatter gives."""
    table = findings.arrays["runs"]
    table = table[table["stiffness_secant"].notna()]
    rows: list[Sequence[Cell]] = []
    for condition, part in sorted(table.groupby("condition"), key=lambda entry: _place(entry[1])):
        cells: list[Cell] = [str(condition), float(len(part))]
        for name in _METRICS:
            value, low, high = _mean_of(part, name)
            cells.append(Value(value, (high - low) / 4, (low, high)))
        cells.append(
            None
            if len(part) < 2
            else float(f"{part['stiffness_storage'].std() / abs(part['stiffness_storage'].mean()):.2g}")
        )
        rows.append(cells)
    every = f"each of the {counted(len(table), 'run')} stands in arrays/runs.parquet"
    return [
        Table(
            "metrics_by_condition",
            "Loop metrics by condition",
            f"How stiff and how lossy are the loops? They have {between(table, LOOPS)} Without the dynamic model: means of the runs of a condition with the 95 % interval by their scatter, of one run its own; {every}. For an "
            "ellipse K_sec is |K*|, not K'.",
            [Column("condition"), Column("runs", "1"), *_METRICS.values(), Column("scatter of K'", "%")],
            rows,
        )
    ]


def _place(runs: pd.DataFrame) -> tuple[float, ...]:
    """Return what sorts conditions: current, frequency, amplitude, to two digits."""
    return tuple(
        float(f"{value:.2g}") if abs(value) > _NO_CURRENT else 0.0 for value in runs[_CONDITION].fillna(0).median()
    )


def _mean_of(runs: pd.DataFrame, name: str) -> tuple[float, float, float]:
    """Return the mean of the runs of one condition and its 95 % interval by their scatter; one run keeps its own."""
    values = runs[name].to_numpy(float)
    if values.size < 2:
        return float(values[0]), float(runs[f"{name}_low"].iloc[0]), float(runs[f"{name}_high"].iloc[0])
    mean = float(values.mean())
    half = t_quantile(values.size - 1) * float(values.std(ddof=1)) / np.sqrt(values.size)
    return mean, mean - half, mean + half


def middle(runs: pd.DataFrame, held: str) -> pd.DataFrame:
    """Return the runs whose `held` (frequency, amplitude) is next to the median of all, within 5 %."""
    values = runs[held].astype(float)
    nearest = float(values.iloc[int((values - values.median()).abs().argmin())])
    return runs[(values / nearest - 1).abs() < 0.05]


def means(runs: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Return one row a condition: means of its runs, and as limits the interval by their scatter; one run keeps its own."""
    rows = []
    for _, part in runs.groupby("condition"):
        row = {key: float(part[key].astype(float).mean()) for key in _CONDITION}
        for name in names:
            row[name], row[f"{name}_low"], row[f"{name}_high"] = _mean_of(part, name)
        rows.append(row)
    return pd.DataFrame(rows)


def residual_quantiles(findings: Findings) -> list[Figure]:
    """Return the spread of the normalised residual of each harmonic over all runs."""
    table = findings.arrays.get("residual_harmonics")
    if table is None:
        return []
    quantiles = table.groupby("order")[["real", "imaginary"]].quantile([0.025, 0.5, 0.975]).unstack()
    order = quantiles.index.to_numpy(float)
    marks: list[Mark] = []
    for number, (part, label) in enumerate((("real", "in phase"), ("imaginary", "out of phase"))):
        low, median, high = (quantiles[part, share].to_numpy(float) for share in (0.025, 0.5, 0.975))
        marks.append(Points(order + (0.24 * number - 0.12), median, number, label, low, high))
    marks += [Rule(y=1.96, label="95 %"), Rule(y=-1.96)]
    share = float((np.abs(table[["real", "imaginary"]].to_numpy()) < 1.96).mean())
    return [
        Figure(
            "residual_harmonics",
            "Residual by harmonic",
            f"Is the residual no more than noise? Median of all runs, and the range that holds 95 of 100, of the misfit of each "
            f"harmonic over its standard deviation, the gain of each run taken out; {100 * share:.0f} % lie within 1.96, 95 % would for "
            "pure noise. A median off zero is the model's fault, a wide range the runs'.",
            "quantiles of the normalised residual over the order of the harmonic",
            [Panel(marks, Axis("order of the harmonic", whole=True), Axis("residual over its standard deviation"))],
        )
    ]
