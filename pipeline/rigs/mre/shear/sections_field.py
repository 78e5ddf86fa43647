"""What the field adds: k_MR and s_MR over the current, stiffness against preload (mre.md section 7)."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Column, Figure, Line, Mark, Panel, Points, Table, Value
from pipeline.rigs.mre.shear.captions import added, gained, level_text


def of_field(findings: Findings) -> list[Figure | Table]:
    """Return what there is to show of the field."""
    blocks: list[Figure | Table] = []
    panels = []
    laws = findings.arrays.get("field_laws")
    numbers: list[str] = []
    answers: list[str] = []
    for name, y, size, unit in (
        ("k_mr", Axis("k_MR", "N/m"), 1e3, "kN/m"),
        ("s_mr", Axis("s_MR", "N s/m"), 1.0, "N s/m"),
    ):
        found = [p for p in findings.parameters if p.name == name and p.value is not None and "coil_current" in p.at]
        if found:
            numbers.append(added(found, y.label, size, unit))
            at = np.array([float(p.at["coil_current"]) for p in found])
            value = np.array([p.value for p in found], dtype=float)
            low, high = np.array([p.ci95 or (np.nan, np.nan) for p in found], dtype=float).T
            marks: list[Mark] = [
                Points(np.r_[0.0, at], np.r_[0.0, value], "measured", "identified", np.r_[0.0, low], np.r_[0.0, high])
            ]
            law = laws[laws["name"] == name] if laws is not None else None
            if law is not None and len(law):
                slope = float(law["slope"].iloc[0])
                marks.append(Line(np.r_[0.0, at.max()], np.r_[0.0, slope * at.max()], "reference", "straight", True))
                answers.append(f"{y.label}: {law['verdict'].iloc[0]}")
            panels.append(Panel(marks, Axis("coil current", "A"), y, y.label))
    if panels:
        blocks.append(
            Figure(
                "field",
                "Stiffness and damping added by the field",
                " ".join(
                    [
                        f"What does the field add? {', '.join(numbers)}; zero at 0 A by definition.",
                        *(f"{answer}." for answer in answers),
                    ]
                ),
                "k_MR and s_MR over coil current",
                panels,
                columns=2,
            )
        )
    states = findings.arrays.get("preload_states")
    if states is not None:
        blocks.append(_preload_table(findings, states))
    return blocks


def _preload_table(findings: Findings, states: pd.DataFrame) -> Table:
    effects = {(p.name, p.at.get("preload"), round(float(p.at.get("coil_current", 0)), 1)): p for p in findings.parameters
               if p.name.startswith("mr_effect")}  # fmt: skip
    rows = []
    for row in states.to_dict("records"):
        cells: list[str | float | Value | None] = [
            row["preload"],
            level_text(row["current"]),
            row["force_amplitude"],
            row["amplitude"],
        ]
        cells.append(Value(row["secant"], row["secant_error"]))
        cells.append(Value(row["secant_equal"], row["secant_equal_error"]) if pd.notna(row["secant_equal"]) else None)
        for name in ("mr_effect_force", "mr_effect_amplitude"):
            effect = effects.get((name, row["preload"], round(row["current"], 1)))
            cells.append(Value(effect.value, effect.std_error, effect.ci95) if effect else None)
        rows.append(cells)
    return Table(
        "preload",
        "Stiffness against preload",
        f"By how much does the field stiffen the pads? {gained(findings)} At equal force the amplitude shrinks as the pads stiffen, and a smaller loop is stiffer: "
        "only the comparison at equal amplitude is the field's own.",
        [
            Column("preload", "N"),
            Column("current"),
            Column("force", "N"),
            Column("amplitude", "m"),
            Column("K_sec", "N/m"),
            Column("K_sec at equal amplitude", "N/m"),
            Column("increment, equal force", "%"),
            Column("increment, equal amplitude", "%"),
        ],
        rows,
    )
