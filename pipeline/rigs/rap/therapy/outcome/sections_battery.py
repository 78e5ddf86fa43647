"""Energy of the battery over time, its projection, power (rap.md, section 7, item 8)."""

from __future__ import annotations

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Rule, Table, Value
from pipeline.rigs.rap.therapy.outcome import captions
from pipeline.rigs.rap.therapy.outcome.frames import of_run, runs_of, time_axis
from pipeline.rigs.rap.therapy.outcome.paper import HOUR


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
                f"Does a full battery last {needed / HOUR:g} h? {captions.battery(runtime, needed)} Energy used, carried on at the mean power to the battery's end.",
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
