"""What the report of `mre.step` shows, drawn from parameters and arrays only (mre.md section 7)."""

from __future__ import annotations

from collections.abc import Sequence

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
    Rule,
    Section,
    Table,
    Value,
)
from pipeline.rigs.mre.current_levels import level_name
from pipeline.rigs.mre.step import captions

TIME, FORCE = Axis("time", "s"), Axis("axial force", "N")
_NAMES = ("delay", "time_constant_1", "time_constant_2", "t63", "t90")
_HEADINGS = {"delay": "L", "time_constant_1": "tau_1", "time_constant_2": "tau_2", "t63": "t_63", "t90": "t_90"}
_RUNS = 4


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters: the response with its model, and the times."""
    series, responses = findings.arrays["series"], findings.arrays["responses"]
    runs = list(series["run"].unique())
    several = len(runs) > 1
    blocks: list[Figure | Table] = []
    for run in runs[:_RUNS]:
        name = f" of run {run}" if several else ""
        blocks.append(_log(series[series["run"] == run], findings, str(run), name))
        blocks.append(_steps_alone(responses[responses["run"] == run], findings, str(run), name, several))
    return [
        Section("response", "Response to steps of the coil current", blocks),
        Section("times", "Delay and time constants", [_times(findings), _steps_table(findings)]),
    ]


def _log(part: pd.DataFrame, findings: Findings, run: str, name: str) -> Figure:
    t = part["time"].to_numpy()
    steps = findings.arrays["steps"]
    return Figure(
        f"log{name.replace(' ', '_')}",
        f"Force and current{name}",
        f"Does the model follow the force? {captions.followed(steps[steps['run'] == run])} A residual that bulges after a step is the model's fault; "
        "one that wanders is creep or drift.",
        "axial force over time with model; residual; measured coil current",
        [
            Panel(
                [
                    Line(t, part["force"].to_numpy(), "measured", "measured"),
                    Line(t, part["model"].to_numpy(), "model", "model"),
                ],
                TIME,
                FORCE,
                "force",
            ),
            Panel(
                [Line(t, part["residual"].to_numpy(), "residual"), Rule(y=0.0)],
                TIME,
                Axis("residual", "N"),
                "measured less model",
            ),
            Panel(
                [Line(t, part["current"].to_numpy(), "reference")], TIME, Axis("coil current", "A"), "measured current"
            ),
        ],
        share_x=True,
    )


def _steps_alone(part: pd.DataFrame, findings: Findings, run: str, name: str, several: bool) -> Figure:
    panels = []
    for direction, title in (("rise", "current switched on"), ("fall", "current switched off")):
        own = part[part["direction"] == direction]
        if own.empty:
            continue
        first = own[own["step"] == own["step"].iloc[0]]
        t = first["time"].to_numpy()
        marks: list[Mark] = [
            Line(t, first["force"].to_numpy(), "measured", "force"),
            Line(t, first["model"].to_numpy(), "model", "model"),
            Line(t, first["current"].to_numpy(), "reference", "current", dashed=True),
        ]
        for short in ("t63", "t90"):
            for p in findings.find(short, direction=direction, **({"run": run} if several else {})):
                if p.value is not None:
                    marks.append(Rule(x=p.value, label=_HEADINGS[short]))
        panels.append(Panel(marks, Axis("time from the onset", "s"), Axis("share of the change", "%"), title))
    return Figure(
        f"steps{name.replace(' ', '_')}",
        f"Switching on and off{name}",
        f"How fast does the pad answer? {captions.answered(findings, run)} Share of the change of the force (creep taken out) and of the measured current, from the onset of the current.",
        "share of the change of force, model and current over the time from the onset, one panel a direction",
        panels,
        columns=2,
    )


def _times(findings: Findings) -> Table:
    by_place: dict[tuple[str, str], dict[str, Parameter]] = {}
    for p in findings.parameters:
        if p.name in _NAMES:
            by_place.setdefault((str(p.at.get("run", "")), str(p.at["direction"])), {})[p.name] = p
    several = any(run for run, _ in by_place)
    rows: list[list[Cell]] = []
    for (run, direction), own in by_place.items():
        cells: list[Cell] = [run] if several else []
        cells += [direction, *(Value(own[n].value, own[n].std_error, own[n].ci95) for n in _NAMES)]
        rows.append(cells)
    for run in dict.fromkeys(run for run, _ in by_place):
        rise, fall = by_place.get((run, "rise"), {}), by_place.get((run, "fall"), {})
        cells = [run] if several else []
        cells.append("fall / rise")
        for n in _NAMES:
            a, b = (own[n].value if n in own else None for own in (rise, fall))
            cells.append(f"{b / a:.2f}" if a and b else "")
        rows.append(cells)
    first = [Column("run")] if several else []
    return Table(
        "times",
        "Times of rise and fall",
        f"How slow is the pad itself? {captions.slowed(findings)} L, tau_1 and tau_2 answer the measured current; t_63 and t_90 count from its onset and contain the coil. "
        "A filter of the force that is not told ('force_filter', 'force_lag') is part of L and tau_2. Empty cells are not determined: the parameters tell why.",
        [*first, Column("direction"), *(Column(_HEADINGS[n], "s") for n in _NAMES)],
        rows,
    )


def _steps_table(findings: Findings) -> Table:
    steps = findings.arrays["steps"]
    rows: list[list[Cell]] = [
        [
            str(r["run"]),
            str(r["direction"]),
            float(r["onset"]),
            level_name(float(r["before"]), 1e-3),
            level_name(float(r["after"]), 1e-3),
            float(r["held"]),
            float(r["change"]),
            float(r["gain"]),
        ]
        for r in steps.to_dict("records")
    ]
    return Table(
        "gains",
        "Steps",
        f"Do the steps have one gain? {captions.linear(steps)} Gains that differ show saturation or remanence: the force is taken as linear in the current within a step only.",
        [
            Column("run"),
            Column("direction"),
            Column("onset", "s"),
            Column("from", "A"),
            Column("to", "A"),
            Column("held for", "s"),
            Column("change of the force", "N"),
            Column("gain", "N/A"),
        ],
        rows,
    )
