"""Spectra of orbit and load and the filtered orbits: the counterparts of the paper's Figures 8 and 9."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Column, Figure, Line, Mark, Panel, Points, Stems, Table, Value
from pipeline.rigs.tpjb.rotating import answers
from pipeline.rigs.tpjb.rotating.sections_orbits import DISPLACEMENT_X, DISPLACEMENT_Y, runs_in_order, title

_ORDER = Axis("frequency over that of the load")
_SIGNALS = {
    "x": Axis("horizontal displacement", "m", "log"),
    "y": Axis("vertical displacement", "m", "log"),
    "load": Axis("dynamic load", "N", "log"),
}
_MOST_RUNS = 12
_LEAST_LOW = 0.03  # of the upper limit


def of_spectra(findings: Findings) -> list[Figure | Table]:
    """Return spectra, full spectra, filtered orbits and the table of harmonics; nothing where they were refused."""
    if "harmonics" not in findings.arrays:
        return []
    return [*_spectra(findings), _full(findings), *_filtered(findings), _table(findings)]


def _with_harmonics(findings: Findings) -> pd.DataFrame:
    runs = runs_in_order(findings)
    known = set(findings.arrays["harmonics"]["run"])
    return runs[runs["run"].isin(known)].tail(_MOST_RUNS)


def _spectra(findings: Findings) -> list[Figure]:
    spectra, harmonics = findings.arrays["spectra"], findings.arrays["axis_harmonics"]
    figures = []
    for _, row in _with_harmonics(findings).iterrows():
        mine, marked = spectra[spectra["run"] == row["run"]], harmonics[harmonics["run"] == row["run"]]
        panels = []
        for signal, axis in _SIGNALS.items():
            part, peaks = mine[mine["signal"] == signal], marked[marked["signal"] == signal]
            high = peaks["amplitude"].to_numpy() + 1.96 * peaks["sigma"].to_numpy()
            low = peaks["amplitude"].to_numpy() - 1.96 * peaks["sigma"].to_numpy()
            low = np.where(low > _LEAST_LOW * high, low, np.nan)  # no number above 0: the bar goes to the axis
            sure = peaks["amplitude"].to_numpy() > 3 * peaks["sigma"].to_numpy()
            marks: list[Mark] = [
                Line(part["order"].to_numpy(), part["amplitude"].to_numpy(), "reference", "spectrum"),
                Points(
                    peaks["order"].to_numpy(float), peaks["amplitude"].to_numpy(), "measured", "harmonics", low, high,
                    texts=[f"{order}X" if told else "" for order, told in zip(peaks["order"], sure, strict=True)],
                ),
            ]  # fmt: skip
            panels.append(Panel(marks, _ORDER, axis, axis.label))
        figures.append(
            Figure(
                f"spectrum_{row['run']}",
                f"Spectra of {title(row)}",
                f"Has the orbit harmonics that the load has not? {answers.of_harmonics(row)} Whole turns at full load; "
                "harmonics that stand out of the noise are named. Counterpart of the paper's Figure 8.",
                "amplitude over order, one panel each for x, y and the load",
                panels,
                columns=3,
                share_x=True,
            )
        )
    return figures


def _full(findings: Findings) -> Figure:
    table = findings.arrays["harmonics"]
    panels = []
    for _, row in _with_harmonics(findings).iterrows():
        part = table[table["run"] == row["run"]]
        k = part["k"].to_numpy(float)
        first = float(np.sqrt((part.loc[part["k"].abs() == 1, "motion"] ** 2).sum()))
        load = float(np.sqrt((part.loc[part["k"].abs() == 1, "load"] ** 2).sum()))
        marks: list[Mark] = [
            Stems(k - 0.1, part["motion"].to_numpy() / first, "measured", "orbit"),
            Stems(k + 0.1, part["load"].to_numpy() / load, "reference", "load"),
            Line(k, 3.0 * part["motion_sigma"].to_numpy() / first, "residual", "3 sigma of the orbit", dashed=True),
        ]
        panels.append(
            Panel(marks, Axis("order, forward above 0", whole=True), Axis("share of the 1X", "%", "log"), title(row))
        )
    return Figure(
        "full_spectrum",
        "Full spectrum",
        f"Which way do the harmonics turn? {answers.of_direction(table, _with_harmonics(findings))} Size of the complex "
        "harmonics of x + iy over the 1X. Forward 2X makes an orbit egg-shaped, backward 2X "
        "gives it three lobes; both alike make the 2X orbit a straight line.",
        "bars of the complex orbit harmonics from -6 to 6, one panel a run",
        panels,
        columns=2,
        share_y=False,
    )


def _filtered(findings: Findings) -> list[Figure]:
    filtered, samples = findings.arrays["filtered"], findings.arrays["samples"]
    figures = []
    for _, row in _with_harmonics(findings).iterrows():
        curves = filtered[filtered["run"] == row["run"]]
        raw = samples[(samples["run"] == row["run"]) & samples["steady"]]
        marks: list[Mark] = [Line(raw["x"].to_numpy(), raw["y"].to_numpy(), "measured", "measured turns")]
        panels = [Panel(marks, DISPLACEMENT_X, DISPLACEMENT_Y, "raw turns", equal=True)]
        for order in sorted(curves["order"].unique()):
            part = curves[curves["order"] == order]
            line = Line(part["x"].to_numpy(), part["y"].to_numpy(), "model", f"{order}X", closed=True)
            panels.append(Panel([line], DISPLACEMENT_X, DISPLACEMENT_Y, f"{order}X", equal=True))
        figures.append(
            Figure(
                f"filtered_{row['run']}",
                f"Filtered orbits of {title(row)}",
                f"What are the parts of the orbit? {answers.of_filtered(row)} Counterpart of the paper's Figure 9.",
                "raw turns and the 1X, 2X and 3X orbits",
                panels,
                columns=4,
            )
        )
    return figures


def _table(findings: Findings) -> Table:
    rows = []
    for _, row in _with_harmonics(findings).iterrows():
        cells: list[str | float | Value | None] = [title(row)]
        for name in ("orbit_harmonic_x", "orbit_harmonic_y"):
            for order in (1, 2, 3):
                found = findings.find(name, run=str(row["run"]), order=float(order))
                cells.append(Value(found[0].value, found[0].std_error, found[0].ci95) if found else None)
        cells.append(f"{100 * row['second_load']:.2g} %")
        rows.append(cells)
    return Table(
        "harmonics",
        "Harmonics of the orbit",
        f"How large are the harmonics? {_largest(rows)} Amplitudes of the displacement along x and y, with 95 % intervals from "
        "the spectrum beside each line; the last column is the second harmonic of the load.",
        [
            Column("run"),
            *(Column(f"{axis} {order}X", "m") for axis in ("x", "y") for order in (1, 2, 3)),
            Column("load 2X/1X"),
        ],
        rows,
    )


def _largest(rows: Sequence[Sequence[object]]) -> str:
    """Return the largest 2X of all runs and axes."""
    told = [
        (cell.value, f"{axis} of {row[0]}")
        for row in rows
        for cell, axis in ((row[2], "x"), (row[5], "y"))
        if isinstance(cell, Value) and cell.value is not None
    ]
    size, where = max(told, default=(0.0, ""))
    return f"The largest 2X is {1e6 * size:.3g} um, in {where}." if told else "No 2X was told."
