"""Temperature of the housing with its exponential and its error; energy of the battery over time (rap.md, section 7)."""

from __future__ import annotations

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Points, Rule, Table, Value
from pipeline.rigs.rap.therapy.outcome.frames import of_run, runs_of, time_axis
from pipeline.rigs.rap.therapy.outcome.paper import HOUR

_SOURCES = {"rap": "device", "bench": "bench"}


def of_temperature(findings: Findings) -> list[Figure | Table]:
    """Return the chapter on temperature."""
    table, errors = findings.arrays["temperature"], findings.arrays["temperature_error"]
    tolerance = float(findings.settings.get("temperature_tolerance", 0.05))
    blocks: list[Figure | Table] = []
    for run in runs_of(table):
        own, axis = of_run(table, run), time_axis(of_run(table, run))
        marks: list[Mark] = []
        for place, (source, word) in enumerate(_SOURCES.items()):
            rows = own[own["source"] == source]
            if rows.empty:
                continue
            time = rows["time"].to_numpy()
            marks.append(Points(time, rows["value"].to_numpy(), place, word))
            if np.isfinite(rows["model"].to_numpy()).any():
                marks.append(Line(time, rows["model"].to_numpy(), place, f"exponential, {word}"))
        panels = [Panel(marks, axis, Axis("air in the housing", "degC"), "both sensors")]
        error = of_run(errors, run)
        if len(error):
            time = error["time"].to_numpy()
            panels.append(Panel([Points(time, error["error"].to_numpy(), "residual"), Rule(y=0.0)], axis,
                                Axis("device less bench", "K"), "error"))  # fmt: skip
            share: list[Mark] = [
                Points(time, error["share"].to_numpy(), "residual"),
                Rule(y=tolerance, label=f"{100 * tolerance:g} % allowed"),
            ]
            panels.append(Panel(share, axis, Axis("error, of the bench in °C", "%"), "in the paper's way"))
        blocks.append(
            Figure(
                f"temperature_{run}", f"Run {run}: temperature of the housing",
                "How does the housing warm up, and how far off is the device's sensor? Degrees Celsius are no ratio scale: the "
                "percentage stands beside the error in kelvin only because the paper's limit is one.",
                f"temperature of the housing's air over time, device and bench, with fitted exponentials and the error of run {run}",
                panels, columns=2, share_x=True,
            )
        )  # fmt: skip
    numbers = _numbers(findings)
    return [*blocks, numbers] if numbers.rows else blocks


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
        "temperatures", "Exponential of each sensor", "T(t) = T∞ + (T₀ - T∞) exp(-t/τ), eq. 7. An empty cell is not determined.",
        [Column("Run"), Column("Sensor"), Column("T₀", "degC"), Column("T∞", "degC"), Column("τ", "min")], rows,
    )  # fmt: skip


def of_battery(findings: Findings) -> list[Figure | Table]:
    """Return the chapter on the battery."""
    table = findings.arrays["battery"]
    needed = float(findings.settings.get("therapy_duration", 5 * HOUR))
    blocks: list[Figure | Table] = []
    rows: list[list[Cell]] = []
    conditions = {run.run: run.conditions for run in findings.runs}
    for run in runs_of(table):
        own, axis = of_run(table, run), time_axis(of_run(table, run))
        time, energy = own["time"].to_numpy(), own["energy"].to_numpy()
        stated = [conditions.get(run, {}).get(name) for name in ("battery_energy", "battery_efficiency")]
        full, efficiency = (float(v) if isinstance(v, int | float) else None for v in stated)
        runtime = next((p for p in findings.find("runtime_projected", run=run)), None)
        marks: list[Mark] = [Line(time, energy, "measured", "used")]
        begin = float(time[0]) if time.size else 0.0
        if full is not None:
            usable = full * (efficiency or 1.0)
            marks.append(
                Rule(y=usable, label="full battery" if efficiency is None else f"full battery x {efficiency:g}")
            )
            if runtime is not None and runtime.value is not None:
                end = begin + runtime.value
                marks.append(
                    Line(np.array([time[-1], end]), np.array([energy[-1], usable]), "model", "projected", dashed=True)
                )
        marks.append(Rule(x=begin + needed, label=f"{needed / HOUR:g} h"))
        panels = [
            Panel(marks, axis, Axis("energy", "W h"), "energy"),
            Panel([Line(time, own["power"].to_numpy(), "measured")], axis, Axis("power", "W"), "power"),
        ]
        blocks.append(
            Figure(
                f"battery_{run}", f"Run {run}: energy of the battery",
                f"Does a full battery last {needed / HOUR:g} h? Energy used, carried on at the mean power to the battery's end.",
                f"energy used over time with its projection, and electric power, of run {run}", panels, columns=2,
            )
        )  # fmt: skip
        used = next((p for p in findings.find("energy_used", run=run)), None)
        rows.append([run, _cell(used), _cell(runtime), full, efficiency])
    if rows:
        blocks.append(
            Table(
                "battery", "Battery",
                "Energy used in the run and the time that the full battery lasts at the mean power. An empty cell is not determined or not stated.",
                [Column("Run"), Column("Used", "W h"), Column("Full battery lasts", "h"), Column("Battery", "W h"), Column("Efficiency")],
                rows,
            )
        )  # fmt: skip
    return blocks


def _cell(found: object) -> Cell:
    value = getattr(found, "value", None)
    return Value(value, getattr(found, "std_error", None), getattr(found, "ci95", None)) if value is not None else None
