"""What the report of `mre.axial` shows, drawn from parameters and arrays only (mre.md section 7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.findings import Findings, Parameter
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
    Section,
    Table,
    Text,
    Value,
)
from pipeline.rigs.mre.axial import captions
from pipeline.rigs.mre.axial.captions import place
from pipeline.rigs.mre.axial.sections_motion import gauge, runs_seen
from pipeline.rigs.mre.micromechanics.sections import sections as micromechanics

_D, _F, _REST = Axis("compression", "m"), Axis("force", "N"), Axis("residual", "N")
_PANELS = 12
_STIFFNESSES = {"stiffness_secant": "secant", "stiffness_slope": "slope"}
_MODEL = {
    "stiffness": Column("k", "N/m"),
    "stiffness_cubic": Column("k_3", "N/m^3"),
    "alpha": Column("alpha", "N"),
    "rho": Column("rho", "1/m"),
}


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    chapters = [
        Section("loops", "Loops of compression", _loops(findings)),
        Section("stiffness", "Stiffness, stiffening and loss", _stiffness(findings)),
        Section("model", "The loop model", _model(findings)),
    ]
    return [*(chapter for chapter in chapters if chapter.blocks), *micromechanics(findings)]


def _title(row: pd.Series) -> str:
    current = row["current"]
    return f"{row['run']}, {current:g} A" if pd.notna(current) else str(row["run"])


def _current(p: Parameter) -> float | None:
    value = p.at.get("coil_current")
    return float(value) if isinstance(value, float | int) else None


def _loops(findings: Findings) -> list[Figure | Table | Text]:
    runs, samples, loops = (findings.arrays[name] for name in ("runs", "samples", "loops"))
    shown = runs.head(_PANELS)
    panels, rest = [], []
    for _, row in shown.iterrows():
        cloud, curve = samples[samples["run"] == row["run"]], loops[loops["run"] == row["run"]]
        x, F = cloud["displacement"].to_numpy(float), cloud["force"].to_numpy(float)
        marks: list[Mark] = [
            Points(x, F, "measured", "samples"),
            Line(curve["displacement"].to_numpy(float), curve["model"].to_numpy(float), "model", "model"),
        ]
        marks += _theory_lines(findings, float(x.max()))
        panels.append(Panel(marks, _D, _F, _title(row)))
        rest.append(
            Panel([Points(x, cloud["residual"].to_numpy(float), "residual"), Rule(y=0.0)], _D, _REST, _title(row))
        )
    number = f"the first {len(shown)} of {len(runs)} runs" if len(runs) > len(shown) else "every run"
    theory = (
        f" Dashed: E A/h by eq. (1). {captions.theory_beside(findings)}".rstrip() if "theory" in findings.arrays else ""
    )
    wide = 2 if len(panels) < 5 else 3
    return [
        Figure(
            "loops",
            "Loops",
            f"Does the model follow the loops? {captions.followed(runs)} Samples at the displacement that the motion gives between the gauge's steps, and the "
            f"model, of {number}; offset of the force taken off.{theory}",
            "force over compression, samples and model with the theory line, one panel a run",
            panels,
            columns=wide,
            share_x=True,
            share_y=True,
        ),
        Figure(
            "loop_residuals",
            "What the model leaves",
            f"Is what is left only noise? {captions.noise(runs)} Force less model. A pattern that both branches share is a fault of the elastic part, an opposite one of the hysteresis, a peak at the turn "
            "of the motion.",
            "residual force over compression, one panel a run",
            rest,
            columns=wide,
            share_x=True,
            share_y=True,
        ),
        *_shape_remark(findings),
    ]


def _joined(*sentences: str) -> str:
    return " ".join(filter(None, sentences))


def _theory_lines(findings: Findings, d_max: float) -> list[Mark]:
    theory = findings.arrays.get("theory")
    if theory is None:
        return []
    x = np.array([0.0, d_max])
    return [Line(x, float(k) * x, "reference", "E A/h", dashed=True) for k in theory["stiffness"].head(3)]


def _shape_remark(findings: Findings) -> list[Text]:
    theory = findings.arrays.get("theory")
    if theory is None:
        text = "No theory line: E A/h needs pad_diameter, pad_height, powder_fraction, matrix_shear_modulus and poisson_ratio."
        return [Text([text])]
    said = []
    for row in theory.head(3).to_dict("records"):
        factor = row["bonded"] / row["stiffness"]
        said.append(
            f"Theory without field: E = {row['modulus'] / 1e6:.3g} MPa and E A/h = {row['stiffness'] / 1e3:.4g} kN/m. That holds for faces that slip freely. With a shape factor S = d/(4 h) = "
            f"{row['shape_factor']:.3f}, faces that cannot slip would make an incompressible pad {factor:.3g} times as stiff (E_c = E (1 + 2 S^2) after Gent and Lindley, {row['bonded'] / 1e3:.4g} kN/m): a measured "
            "stiffness near E A/h means well lubricated faces or a compressible compound."
        )
    return [Text(said)]


def _stiffness(findings: Findings) -> list[Figure | Table | Text]:
    blocks: list[Figure | Table | Text] = [_stiffness_table(findings)]
    figure = _over_current(findings)
    if figure is not None:
        blocks.insert(0, figure)
    runs = findings.arrays["runs"]
    if runs["current"].value_counts().max() > 1:
        blocks.append(_run_table(runs))
    return blocks


def _stiffness_table(findings: Findings) -> Table:
    names = [
        "stiffness_secant",
        "stiffness_slope",
        "stiffening_secant",
        "stiffening_slope",
        "loss_ratio",
        "unloading_drop",
    ]
    places = list(dict.fromkeys(place(p) for p in findings.parameters))
    found = {(p.name, place(p)): p for p in findings.parameters}
    rows: list[list[Cell]] = []
    for at in places:
        cells: list[Cell] = [at]
        for name in names:
            p = found.get((name, at))
            cells.append(Value(p.value, p.std_error, p.ci95) if p is not None else None)
        rows.append(cells)
    return Table(
        "stiffness",
        "Stiffness in both definitions",
        _joined(
            "How stiff is the pad, and how much of the work is lost?",
            captions.definitions(findings),
            captions.lost(findings),
            "Secant: F(d_max)/d_max. Slope: regression of the loading branch over 20 to 80 % of d_max. The loop hardens and hysteresis lifts its start, so both "
            "differ, and so does the stiffening relative to 0 A: say which one is meant. Work lost: of that of the loading. Drop: of the force when the release begins. Offset of the force taken off.",
        ),
        [
            Column("coil current"),
            Column("secant", "N/m"),
            Column("slope", "N/m"),
            Column("stiffening, secant", "%"),
            Column("stiffening, slope", "%"),
            Column("work lost", "%"),
            Column("drop", "N"),
        ],
        rows,
    )


def _over_current(findings: Findings) -> Figure | None:
    panels = []
    for names, axis in (
        (_STIFFNESSES, Axis("stiffness", "N/m")),
        ({"stiffening_secant": "secant", "stiffening_slope": "slope"}, Axis("stiffening", "%")),
    ):
        marks: list[Mark] = []
        for number, (name, label) in enumerate(names.items()):
            found = [p for p in findings.find(name) if p.value is not None and _current(p) is not None]
            if found:
                x = np.array([_current(p) for p in found], dtype=float)
                value = np.array([p.value for p in found], dtype=float)
                low, high = np.array([p.ci95 or (np.nan, np.nan) for p in found], dtype=float).T
                if name.startswith("stiffening"):  # none at 0 A, by definition
                    x, value, low, high = (np.r_[0.0, part] for part in (x, value, low, high))
                marks.append(Points(x, value, number, label, low, high))
        if marks:
            panels.append(Panel(marks, Axis("coil current", "A"), axis, axis.label))
    levels = {_current(p) for p in findings.find("stiffness_secant")} - {None}
    if len(levels) < 2 or not panels:
        return None
    return Figure(
        "over_current",
        "Stiffness and stiffening over the current",
        f"How much does the field stiffen the pad? {captions.stiffened(findings)} Both definitions with 95 % intervals.",
        "secant and slope stiffness and the stiffening relative to 0 A over coil current",
        panels,
        columns=2,
    )


def _run_table(runs: pd.DataFrame) -> Table:
    rows: list[list[Cell]] = []
    for row in runs.head(60).to_dict("records"):
        cells: list[Cell] = [str(row["run"]), row["current"]]
        for name in ("stiffness_secant", "stiffness_slope", "alpha", "loss_ratio"):
            value, error = row[name], row[f"{name}_error"]
            cells.append(Value(float(value), float(error)) if pd.notna(value) else None)
        rows.append(cells)
    return Table(
        "runs",
        "Runs one by one",
        "Runs at one current should agree within their errors; what they scatter beyond these (Mullins effect, heating, another seat of the pad) is in the errors of their mean.",
        [
            Column("run"),
            Column("coil current", "A"),
            Column("secant", "N/m"),
            Column("slope", "N/m"),
            Column("alpha", "N"),
            Column("loss over loading work", "%"),
        ],
        rows,
    )


def _model(findings: Findings) -> list[Figure | Table | Text]:
    places = list(dict.fromkeys(place(p) for p in findings.find("stiffness")))
    found = {(p.name, place(p)): p for p in findings.parameters}
    rows: list[list[Cell]] = []
    for at in places:
        parameters = [found.get((name, at)) for name in _MODEL]
        rows.append([at, *(None if p is None else Value(p.value, p.std_error, p.ci95) for p in parameters)])
    table = Table(
        "model",
        "Parameters of the loop",
        _joined(
            "What is elastic in the loop and what is hysteresis?",
            captions.hysteresis(findings),
            "k: spring; k_3: its stiffening; alpha: largest hysteretic force; 1/rho: displacement over which it builds up, not told where it is far below what "
            "the gauge resolves or beyond the stroke.",
        ),
        [Column("coil current"), *_MODEL.values()],
        rows,
    )
    return [table, runs_seen(findings.arrays["runs"]), *gauge(findings)]
