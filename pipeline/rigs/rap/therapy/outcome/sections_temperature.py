"""Temperature of the housing with its exponential, and the device's error, the runs side by side (rap.md, section 7, item 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Points, Rule, Table, Value
from pipeline.rigs.rap.therapy.outcome import captions
from pipeline.rigs.rap.therapy.outcome.frames import of_run, runs_of, time_axis

if TYPE_CHECKING:
    import pandas as pd

_SOURCES = {"rap": "device", "bench": "bench"}
_ZERO_CELSIUS = 273.15
_SIDE_BY_SIDE = 3


def of_temperature(findings: Findings) -> list[Figure | Table]:
    """Return the chapter on temperature."""
    table, errors = findings.arrays["temperature"], findings.arrays["temperature_error"]
    tolerance = float(findings.settings.get("temperature_tolerance", 0.05))
    runs = runs_of(table)
    courses = [_course(run, of_run(table, run)) for run in runs]
    error = [_error(run, of_run(errors, run), of_run(table, run), tolerance) for run in runs_of(errors)]
    asked, warmed = "How does the housing warm up", captions.warming(findings, runs)
    said = (
        f"How far off is the device's sensor? {captions.temperature_errors(findings, runs)} The paper allows {100 * tolerance:g} % of the bench's degrees Celsius, drawn in kelvin, for "
        "degrees Celsius are no ratio scale."
    )
    blocks: list[Figure | Table] = []
    if len(runs) == 1:
        alt = "temperature of the housing's air over time, device and bench, with fitted exponentials, and the device's error"
        blocks.append(
            Figure(
                "temperature",
                "Temperature of the housing",
                f"{asked}? {warmed} {said}",
                alt,
                [*courses, *error],
                columns=2,
            )
        )
    elif runs:
        columns = min(len(runs), _SIDE_BY_SIDE)
        alt = "temperature of the housing's air over time, device and bench, with fitted exponentials, one panel a run"
        blocks.append(
            Figure(
                "temperature",
                "Temperature of the housing",
                f"{asked} in each run? {warmed}",
                alt,
                courses,
                columns=columns,
            )
        )
        if error:
            alt = "device's temperature less the bench's over time with what is allowed, one panel a run"
            blocks.append(
                Figure("temperature_error", "Error of the device's temperature", said, alt, error, columns=columns)
            )
    numbers = _numbers(findings)
    return [*blocks, numbers] if numbers.rows else blocks


def _course(run: str, own: pd.DataFrame) -> Panel:
    marks: list[Mark] = []
    for place, (source, word) in enumerate(_SOURCES.items()):
        rows = own[own["source"] == source]
        if rows.empty:
            continue
        time, model = rows["time"].to_numpy(), rows["model"].to_numpy()
        marks.append(Points(time, rows["value"].to_numpy(), place, word))
        if np.isfinite(model).any():
            marks.append(Line(time, model, place, f"exponential, {word}"))
    return Panel(marks, time_axis(own), Axis("air in the housing", "degC"), f"run {run}")


def _error(run: str, own: pd.DataFrame, both: pd.DataFrame, tolerance: float) -> Panel:
    """Return the error in kelvin with the allowed share of the bench's degrees Celsius, on the sides where errors lie."""
    time, error = own["time"].to_numpy(), own["error"].to_numpy()
    bench = both[both["source"] == "bench"]
    marks: list[Mark] = [Points(time, error, "residual", "device less bench"), Rule(y=0.0)]
    if len(bench):
        allowed = tolerance * (np.interp(time, bench["time"].to_numpy(), bench["value"].to_numpy()) - _ZERO_CELSIUS)
        for side in (1.0, -1.0):
            if (side * error).max() > 0.0:
                marks.append(
                    Line(time, side * allowed, "reference", f"{100 * tolerance:g} % of the bench in °C", dashed=True)
                )
    return Panel(marks, time_axis(own), Axis("device less bench", "K"), f"run {run}: error")


def _numbers(findings: Findings) -> Table:
    rows: list[list[Cell]] = []
    for run in runs_of(findings.arrays["parts"]):
        for source, word in _SOURCES.items():
            found = [next(iter(findings.find(name, run=run, source=source)), None)
                     for name in ("temperature_initial", "temperature_final", "time_constant")]  # fmt: skip
            if any(one is not None and one.value is not None for one in found):
                rows.append([run, word, *(Value(one.value, one.std_error, one.ci95) if one and one.value is not None else None
                                          for one in found)])  # fmt: skip
    return Table(
        "temperatures", "Exponential of each sensor", "T(t) = T∞ + (T₀ - T∞) exp(-t/τ), eq. (7). An empty cell is not determined.",
        [Column("Run"), Column("Sensor"), Column("T₀", "degC"), Column("T∞", "degC"), Column("τ", "min")], rows,
    )  # fmt: skip
