"""The ring's parameters with priors and correlations, and what the data can tell apart."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Cell,
    Column,
    Figure,
    Matrix,
    Panel,
    Points,
    Rule,
    Status,
    Stems,
    Table,
    Text,
    Value,
)
from pipeline.rigs.tire.bench import captions
from pipeline.rigs.tire.bench.sections_waveform import Blocks


def of_ring(findings: Findings) -> Blocks:
    """Return the table of parameters, misfit by run, correlations and singular values."""
    table = findings.arrays["ring"]
    if table.empty:
        return []
    rows: list[list[Cell]] = [
        [
            _SHOWN[row["parameter"]][0], _in_words(row), round(float(row["relative"]), 4), round(float(row["relative_a"]), 4), round(float(row["with_gain"]), 2) + 0.0,
            str(row["prior"]), Status("told", "ok") if row["told"] else Status("not told", "warning"),
        ]
        for row in table.to_dict("records")
    ]  # fmt: skip
    return [
        Text(list(findings.arrays["ring_statements"]["statement"])),
        Table(
            "ring_parameters", "Parameters of the joint fit",
            f"{captions.told_parameters(table)} The relative errors with and without type B (pressure, load cell, radii), the correlation with the sensor's gain c, and what was known "
            "before. What is not told here is null among the parameters, with its reason.",
            [Column("parameter"), Column("value, 95 %"), Column("error, all", "%"), Column("error, type A", "%"), Column("correlation with c"),
             Column("prior"), Column("")],
            rows,
        ),
        *_misfit(findings),
        *_told_apart(findings),
    ]  # fmt: skip


def _in_words(row: dict[str, Any]) -> str:
    """Write a value with its unit and error: rows of one column have units of their own."""
    _, unit, size = _SHOWN[row["parameter"]]
    value, sd = row["value"] / size, row["sd"] / size
    if not np.isfinite(value):
        return "–"
    if not np.isfinite(sd) or sd <= 0.0:
        return f"{value:.4g} {unit}".strip()
    digits = max(0, 1 - math.floor(math.log10(sd)))
    return f"{value:.{digits}f} ± {1.96 * sd:.{digits}f} {unit}".strip()


def _misfit(findings: Findings) -> Blocks:
    table = findings.arrays["ring_runs"]
    if table.empty:
        return []
    rows: list[list[Cell]] = [
        [
            str(row["run"]), float(row["load"]), float(row["rotation"]), round(float(row["chi2_reduced"]), 2), round(float(row["rms"]), 2), round(float(row["relative"]), 5),
            Value(float(row["contact_length"]), float(row["contact_length_sd"])),
        ]
        for row in table.to_dict("records")
    ]  # fmt: skip
    figure = Figure(
        "misfit", "Misfit of each run",
        f"Does the misfit grow with load or speed? {captions.grows_with(table)} One is what the scatter of the revolutions explains; a rise with load or speed would be "
        "physics that the ring lacks.",
        "reduced chi-square of each run",
        [
            Panel(
                [Points(table[name].to_numpy(), table["chi2_reduced"].to_numpy(), "residual", "", texts=list(table["run"].astype(str))), Rule(y=1.0)],
                axis, Axis("χ² reduced"), f"over {axis.label}",
            )
            for name, axis in (("load", Axis("load", "N")), ("rotation", Axis("rotation", "rad/s")))
        ],
        columns=2,
    )  # fmt: skip
    return [
        Table(
            "ring_runs", "The fit run by run", f"{captions.left_of_peak(table)} What the joint fit leaves of each waveform, and the contact length that it gives the run.",
            [Column("run"), Column("load", "N"), Column("rotation", "rad/s"), Column("χ² reduced"), Column("rms residual", "ohm"),
             Column("of the peak", "%"), Column("Lc", "m")],
            rows,
        ),
        figure,
    ]  # fmt: skip


def _told_apart(findings: Findings) -> Blocks:
    matrix, singular = findings.arrays["ring_correlation"], findings.arrays["ring_singular"]
    if matrix.empty or not findings.arrays["fit"]["model_fits"].iloc[0]:
        return []
    names = [name for name in matrix.columns if name != "parameter"]
    labels = [_SHOWN[name][0] for name in names]
    panels = [
        Panel([Matrix(matrix[names].to_numpy(), labels, labels)], title="correlation"),
        Panel(
            [Stems(singular["number"].to_numpy(dtype=float), singular["value"].to_numpy(), "model")],
            Axis("singular value, weakest last", whole=True), Axis("relative to the first", "1", "log"), "singular values",
        ),
    ]  # fmt: skip
    weakest = str(singular["direction"].iloc[-1])
    return [
        Figure(
            "told_apart", "What the data tell apart",
            f"Which combination is known worst? {weakest[:1].upper()}{weakest[1:]}. Stiffnesses and gain move together: their ratios are known better than each. The "
            "singular values are those of the weighted Jacobian, in relative changes, priors included.",
            "correlation matrix of the fitted parameters and singular values of the fit", panels, columns=2,
        )
    ]  # fmt: skip


# Name: symbol, unit for reading, its size in SI.
_SHOWN = {
    "bending_stiffness": ("EI", "N m²", 1.0),
    "belt_width": ("b", "mm", 1e-3),
    "foundation_radial": ("kw", "kN/m²", 1e3),
    "foundation_tangential": ("kv", "kN/m²", 1e3),
    "tread_stiffness": ("kt", "MN/m²", 1e6),
    "sensor_gain": ("c", "Ω m", 1.0),
    "loss_factor": ("η", "", 1.0),
    "sensor_lag": ("τf", "ms", 1e-3),
    "sensor_length": ("Ls", "mm", 1e-3),
}
