"""What the report of `tpjb.dynamic` shows, drawn from parameters and arrays only (tpjb.md section 7, T2)."""

from __future__ import annotations

from collections.abc import Sequence

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
    Section,
    Table,
    Text,
    Value,
)
from pipeline.rigs.tpjb.dynamic import answers
from pipeline.rigs.tpjb.dynamic.sections_evidence import evidence

_FREQUENCY = Axis("frequency", "Hz")
_AXES = ("xx", "xy", "yx", "yy")
_WHAT_BARS_ARE = "Bars are of type A; what gains add, which move all points alike, is in the numbers told here. "
_HOW_DRAWN = (
    "Each tone with its 95 % interval (type A), constant, line and parabola, of which the lowest that chi-square lets pass is "
    "taken, and the synchronous value with two standard errors of type A where the shaft's frequency is marked; gains, which "
    "move all points alike, are not drawn. "
)
_WHAT = {"k": ("stiffness", "N/m"), "c": ("damping", "N s/m")}


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    arrays = findings.arrays
    chapters = []
    if "coefficients" in arrays:
        points = list(arrays["coefficients"]["point"].unique())
        for number, point in enumerate(points):
            chapters.append(
                Section(f"coefficients_{number}", f"Stiffness and damping, {point}", _of_point(findings, point, number))
            )
        if len(points) > 1:
            chapters.append(Section("loads", "All operating points", [_against_load(arrays)]))
    chapters.append(Section("evidence", "How well the excitation tells them", evidence(findings)))
    return [chapter for chapter in chapters if chapter.blocks]


def _of_point(findings: Findings, point: str, number: int) -> list[Figure | Table | Text]:
    tables = {name: table[table["point"] == point] for name, table in findings.arrays.items() if "point" in table}
    blocks: list[Figure | Table | Text] = [_figure(tables, point, letter, number) for letter in "kc"]
    if "synchronous" in tables and len(tables["synchronous"]):
        blocks += [_synchronous(tables["synchronous"], number, letter) for letter in "kc"]
    blocks.append(_tone_table(tables["coefficients"], number))
    if "added_mass" in tables and len(tables["added_mass"]):
        stator = float(tables["inertia"]["mass"].iloc[0]) if "inertia" in tables and len(tables["inertia"]) else None
        blocks.append(_added_mass(tables["added_mass"], number, stator))
    return blocks


def _figure(tables: dict[str, pd.DataFrame], point: str, letter: str, number: int) -> Figure:
    what, unit = _WHAT[letter]
    panels = []
    for axes in _AXES:
        name = letter + axes
        part = tables["coefficients"][tables["coefficients"]["name"] == name]
        marks: list[Mark] = [
            Points(
                part["frequency"].to_numpy(),
                part["value"].to_numpy(),
                "measured",
                "measured, 95 % (type A)",
                *_limits(part),
            )
        ]
        taken = ""
        if "laws" in tables:
            laws = tables["laws"][tables["laws"]["name"] == name]
            marks += _laws(laws)
            taken = "".join(f", degree {degree}" for degree in laws.loc[laws["taken"].astype(bool), "degree"].unique())
        if "synchronous" in tables:
            here = tables["synchronous"][tables["synchronous"]["name"] == name]
            marks += _at_shaft(here)
        panels.append(Panel(marks, _FREQUENCY, Axis(f"{letter}_{axes}", unit), f"{letter}_{axes}{taken}"))
    how = _WHAT_BARS_ARE if letter == "c" or number else _HOW_DRAWN
    return Figure(
        f"{what}_{number}",
        f"{what.capitalize()} over frequency",
        f"Does {what} change with frequency, and what is it at shaft speed? {answers.of_frequency(tables, letter)} {how}{point}.",
        f"four panels, {what} xx, xy, yx, yy against frequency with error bars and fitted curves",
        panels,
        columns=2,
        share_x=True,
    )


def _limits(part: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    return part["low"].to_numpy(float), part["high"].to_numpy(float)


def _laws(table: pd.DataFrame) -> list[Mark]:
    lines: list[Mark] = []
    for degree in sorted(table["degree"].unique()):
        part = table[table["degree"] == degree]
        taken = bool(part["taken"].iloc[0])
        x, y = part["frequency"].to_numpy(), part["value"].to_numpy()
        if taken:
            lines.append(Line(x, y, "model", "law taken"))
        else:
            lines.append(Line(x, y, "reference", "other degrees", dashed=True))
    return lines


def _at_shaft(here: pd.DataFrame) -> list[Mark]:
    if here.empty:
        return []
    row = here.iloc[0]
    marks: list[Mark] = [Rule(x=float(row["shaft"]), label="shaft")]
    if pd.notna(row["value"]):
        x, y = np.array([row["shaft"]], dtype=float), np.array([row["value"]], dtype=float)
        half = 2 * np.array([row["std_error"]], dtype=float)
        marks.append(Points(x, y, 3, "synchronous", y - half, y + half))
    return marks


def _value(row: pd.Series) -> Value:
    if pd.isna(row["value"]):
        return Value(None, note="not told")
    return Value(float(row["value"]), float(row["std_error"]), (float(row["low"]), float(row["high"])))


def _synchronous(table: pd.DataFrame, number: int, letter: str) -> Table:
    what, unit = _WHAT[letter]
    rows: list[list[Cell]] = []
    for _, row in table[table["name"].str.startswith(letter)].iterrows():
        told = pd.notna(row["value"]) and float(row["value"]) != 0.0

        def share(column: str, row: pd.Series = row, told: bool = told) -> Cell:
            part = abs(float(row[column]) / float(row["value"])) if told and pd.notna(row[column]) else None
            return None if part is None else "< 0.001 %" if part < 1e-5 else round(part, 5)

        judged = f"{row['chi2']:.3g}/{int(row['dof'])}" + ("" if row["passes"] else " rejected")
        shares = [share(column) for column in ("std_error", "type_b_gain", "type_b_inertia")]
        rows.append([str(row["name"]), _value(row), *shares, int(row["degree"]), judged])
    lag = _lag(table) if letter == "c" else ""
    return Table(
        f"synchronous_{what}_{number}",
        f"Synchronous {what}",
        f"What does the error come from? {answers.of_parts(table, letter)} Interpolated to the shaft's frequency; the interval "
        "holds all three. Type A is the scatter of the blocks; type B by gains, as "
        "stated, scales all coefficients alike; type B by inertia is what the error of the stator's mass and stiffness does."
        f"{lag}",
        [
            Column("coefficient"),
            Column("value", unit),
            Column("type A", "%"),
            Column("type B, gains", "%"),
            Column("type B, inertia", "%"),
            Column("degree"),
            Column("chi-square/dof"),
        ],
        rows,
    )


def _lag(table: pd.DataFrame) -> str:
    stiffness = table.set_index("name")["value"].astype(float)
    told = [axes for axes in ("xx", "yy") if np.isfinite(stiffness["k" + axes])]
    late = ", ".join(f"c{axes} by {1e-9 * stiffness['k' + axes]:.2g} kN s/m" for axes in told)
    return f" Each microsecond that the displacement comes late would raise {late}." if told else ""


def _tone_table(table: pd.DataFrame, number: int) -> Table:
    names = [letter + axes for letter in "kc" for axes in _AXES]
    rows: list[list[Cell]] = []
    for frequency in sorted(table["frequency"].unique()):
        part = table[table["frequency"] == frequency]
        cells = {row["name"]: _value(row) for _, row in part.iterrows()}
        rows.append([float(frequency), *(cells[name] for name in names)])
    units = {"k": "N/m", "c": "N s/m"}
    return Table(
        f"tones_{number}",
        "Coefficients at each tone",
        f"What does each tone tell by itself? {answers.of_tones(table)} Real part of H, and imaginary part over ω; type A.",
        [Column("frequency", "Hz"), *(Column(name, units[name[0]]) for name in names)],
        rows,
    )


def _added_mass(table: pd.DataFrame, number: int, stator: float | None) -> Table:
    rows: list[list[Cell]] = [
        [str(r["axes"]), Value(float(r["stiffness"])), Value(float(r["mass"]), float(r["std_error"]))]
        for _, r in table.iterrows()
    ]
    return Table(
        f"added_mass_{number}",
        "The same with an added mass (KCM)",
        f"Is a mass left in it? {answers.of_added_mass(table, stator)} Re H = K − ω² M. An M of about plus or minus the stator's mass would say that its inertia was not, or twice, taken off; equal "
        "M/C in all directions would say that the displacement is late by that time.",
        [Column("entry"), Column("K", "N/m"), Column("M", "kg")],
        rows,
    )


def _against_load(arrays: dict[str, pd.DataFrame]) -> Figure:
    table = arrays["synchronous"] if "synchronous" in arrays else arrays["coefficients"].iloc[:0]
    points = list(table["point"].unique())
    panels = []
    for letter in "kc":
        marks: list[Mark] = []
        for number, axes in enumerate(_AXES):
            part = table[table["name"] == letter + axes]
            x = np.array([points.index(p) for p in part["point"]], dtype=float)
            marks.append(
                Points(
                    x + 0.06 * (number - 1.5), part["value"].to_numpy(float), number, f"{letter}_{axes}", *_limits(part)
                )
            )
        panels.append(
            Panel(
                marks,
                Axis("operating point, in the order of the chapters", whole=True),
                Axis(_WHAT[letter][0], _WHAT[letter][1]),
            )
        )
    listed = "; ".join(f"{i}: {p}" for i, p in enumerate(points))
    return Figure(
        "loads",
        "Synchronous coefficients of all operating points",
        f"How do the coefficients change from one operating point to the next? {answers.of_loads(table)} {listed}.",
        "synchronous stiffness and damping by operating point",
        panels,
        columns=2,
    )
