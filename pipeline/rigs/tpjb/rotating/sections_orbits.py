"""Load and orbits as the report shows them: the counterparts of the paper's Figures 4 to 7, 10 and 11."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Figure, Line, Mark, Outline, Panel, Points
from pipeline.rigs.tpjb.rotating import answers

FORCE_X, FORCE_Y = Axis("horizontal dynamic load", "N"), Axis("vertical dynamic load", "N")
DISPLACEMENT_X, DISPLACEMENT_Y = Axis("horizontal displacement", "m"), Axis("vertical displacement", "m")
_SHOWN_MODELS, _MOST_MODELS = 4, 12


def of_orbits(findings: Findings) -> list[Figure]:
    """Return load plot, absolute orbits, orbits with the models, and the residual."""
    return [*_load(findings), *_absolute(findings), *_relative(findings), *_residual(findings)]


def runs_in_order(findings: Findings) -> pd.DataFrame:
    """Return the runs by static load and ratio, smallest first."""
    by = [name for name in ("static_load", "force") if name in findings.arrays["runs"]]
    runs: pd.DataFrame = findings.arrays["runs"]
    return runs.sort_values(by, kind="stable")


def title(row: pd.Series) -> str:
    """Name a run by its load and ratio, as the paper does: 'A4, 40 kN, 36 %'."""
    parts = [str(row["run"])]
    if pd.notna(row["static_load"]):
        parts.append(f"{row['static_load'] / 1e3:.4g} kN")
    parts.append(f"{100 * row['ratio']:.3g} %" if pd.notna(row["ratio"]) else f"{row['force'] / 1e3:.4g} kN of load")
    return ", ".join(parts)


def _of(findings: Findings, name: str, run: str) -> pd.DataFrame:
    table: pd.DataFrame = findings.arrays[name]
    return table[table["run"] == run]


def _load(findings: Findings) -> list[Figure]:
    marks: list[Mark] = []
    for number, (_, row) in enumerate(runs_in_order(findings).iterrows()):
        part = _of(findings, "samples", row["run"])
        part = part[part["steady"]]
        marks.append(Line(part["fx"].to_numpy(), part["fy"].to_numpy(), number, title(row)))
    return [
        Figure(
            "load",
            "Dynamic load",
            f"Is the load a vector of constant size that turns evenly? {answers.of_load(findings.arrays['runs'])} All turns at "
            "full load. Counterpart of the paper's Figure 4.",
            "vertical over horizontal dynamic load, one circle a run",
            [Panel(marks, FORCE_X, FORCE_Y, equal=True)],
        )
    ]


def _absolute(findings: Findings) -> list[Figure]:
    polygon = findings.arrays.get("polygon")
    panels = []
    runs = runs_in_order(findings)
    zero = "bearing centre" if polygon is not None else "zero of the probes"
    for bearing, members in runs.groupby(runs["bearing"].fillna(""), sort=False):
        marks: list[Mark] = []
        if polygon is not None:
            outline = polygon[polygon["bearing"] == bearing] if "bearing" in polygon else polygon
            marks.append(Outline(outline["x"].to_numpy(), outline["y"].to_numpy(), "reference", "clearance"))
        for number, (_, row) in enumerate(members.iterrows()):
            part = _of(findings, "samples", row["run"])
            marks.append(Line(part["dx"].to_numpy(), part["dy"].to_numpy(), number, title(row)))
        panels.append(Panel(marks, DISPLACEMENT_X, DISPLACEMENT_Y, str(bearing), equal=True))
        if polygon is not None:
            panels.append(
                Panel(marks[1:], DISPLACEMENT_X, DISPLACEMENT_Y, f"{bearing}, the orbits".strip(", "), equal=True)
            )
    clearance = (
        ", with the clearance polygon of the bump test"
        if polygon is not None
        else "; no bump test is used, so the clearance is not drawn and the zero is the probes'"
    )
    return [
        Figure(
            "orbits_absolute",
            f"Orbits from the {zero}",
            f"Where in the clearance does the stator move? {answers.of_place(findings.arrays['samples'], zero)} All samples, "
            f"still stretches and ramps included{clearance}. "
            f"Zero: {zero}. Counterpart of the paper's Figure 5.",
            f"vertical over horizontal displacement of the stator against the shaft, from the {zero}",
            panels,
            columns=2 if len(panels) > 1 else 1,
        )
    ]


def _relative(findings: Findings) -> list[Figure]:
    figures: list[Figure] = []
    runs = runs_in_order(findings)
    ideal = findings.arrays.get("model_orbits")
    if ideal is None:
        return []
    how = (
        "Steady turns from the static equilibrium of the selected model, drift taken out, and each model under a load of "
        "constant size about the equilibrium that its own fit found. "
    )
    for _, row in runs.iterrows():
        part = _of(findings, "samples", row["run"])
        part = part[part["steady"]]
        several = int((runs["group"] == row["group"]).sum()) > 1
        shared = "Models share their coefficients with the other ratios at this static load. " if several else ""
        how_to_read = f"{how}{shared}Counterpart of the paper's Figures 6, 7, 10 and 11."
        curves = ideal[ideal["run"] == row["run"]]
        panels = []
        for model in curves["model"].unique()[:_MOST_MODELS]:
            curve = curves[curves["model"] == model]
            first = curve.iloc[0]
            rms = f", {1e9 * first['rms']:.0f} nm rms" if np.isfinite(first["rms"]) else ""
            chosen = ", selected" if first["selected"] else ""
            marks: list[Mark] = [
                Points(part["x"].to_numpy(), part["y"].to_numpy(), "measured", "measured"),
                Line(curve["x"].to_numpy(), curve["y"].to_numpy(), "model", "model", closed=True),
            ]
            panels.append(Panel(marks, DISPLACEMENT_X, DISPLACEMENT_Y, f"{model}{rms}{chosen}", equal=True))
        figures.append(
            Figure(
                f"orbit_{row['run']}",
                f"Orbit of {title(row)}",
                f"Which law makes this orbit? {answers.of_orbit(curves)} "
                f"{'Drawn as in the figure before.' if figures else how_to_read}",
                f"measured orbit of {row['run']} and the orbits of the models, one panel a model",
                panels,
                columns=4 if len(panels) > _SHOWN_MODELS else 2,
                share_x=True,
                share_y=True,
            )
        )
    return figures


def _residual(findings: Findings) -> list[Figure]:
    panels = []
    largest = 0.0
    for _, row in runs_in_order(findings).iterrows():
        part = _of(findings, "samples", row["run"])
        if not np.isfinite(part["mx"]).any():
            continue
        steady = part[part["steady"]]
        x, y = (steady[a].to_numpy() - steady[b].to_numpy() for a, b in (("x", "mx"), ("y", "my")))
        largest = max(largest, float(np.sqrt(np.nanmean(x**2 + y**2) / 2)))
        panels.append(Panel([Points(x, y, "residual")], DISPLACEMENT_X, DISPLACEMENT_Y, title(row), equal=True))
    if not panels:
        return []
    return [
        Figure(
            "residual_orbits",
            "Residual orbits of the selected model",
            f"What does the selected model leave over? {answers.of_residual(largest, findings.arrays.get('models'))} Measured "
            "less model under the measured load; loops or lobes that come back every turn would be missing terms.",
            "residual displacement of each run, vertical over horizontal",
            panels,
            columns=min(len(panels), 4),
            share_x=True,
            share_y=True,
        )
    ]
