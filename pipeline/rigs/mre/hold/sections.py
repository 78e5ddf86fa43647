"""What the report of `mre.hold` shows, drawn from parameters and arrays only (mre.md section 7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Band,
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
from pipeline.rigs.mre.hold import captions
from pipeline.rigs.mre.micromechanics.sections import sections as micromechanics

CURRENT, FORCE, TIME = Axis("coil current", "A"), Axis("axial force", "N"), Axis("time", "s")
# Direction, label and colour of a sweep; the second colour of a series is that of the model.
_WAYS = ((1, "current rising", 0), (-1, "current falling", 2))
_RUNS = 6
_APART = 0.08  # A between the sweeps in a panel of residuals


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    chapters = [
        Section("force", "Force against coil current", _force(findings)),
        Section("field", "Field map and pull of the poles", _field(findings)),
    ]
    return [*(chapter for chapter in chapters if chapter.blocks), *micromechanics(findings)]


def _force(findings: Findings) -> list[Figure | Table | Text]:
    if "holds" not in findings.arrays:
        return []
    holds, curves, states = (findings.arrays[name] for name in ("holds", "curves", "state"))
    blocks: list[Figure | Table | Text] = []
    for state in states.head(_RUNS).to_dict("records"):
        run = state["run"]
        own, curve = holds[holds["run"] == run], curves[curves["run"] == run]
        name = f" of run {run}" if len(states) > 1 else ""
        blocks.append(_law_figure(findings, state, own, curve, name))
        blocks.append(_time_figure(findings, str(run), own, name))
        blocks.append(_increment_table(findings, str(run), own, name))
    return blocks


def _law_figure(
    findings: Findings, state: dict[str, object], own: pd.DataFrame, curve: pd.DataFrame, name: str
) -> Figure:
    marks: list[Mark] = [
        Band(curve["current"].to_numpy(), curve["low"].to_numpy(), curve["high"].to_numpy(), "model"),
        Line(curve["current"].to_numpy(), curve["increment"].to_numpy(), "model", "law"),
    ]
    rest: list[Mark] = [Rule(y=0.0)]
    for sign, label, colour in _WAYS:
        part = own[own["direction"] == sign]
        if len(part):
            x, y, half = (part[c].to_numpy() for c in ("current", "increment", "increment_half"))
            marks.append(Points(x, y, colour, label, y - half, y + half))
            off = (part["high"] - part["low"]).to_numpy() / 2
            rest.append(
                Points(
                    x + _APART * (sign < 0),
                    part["residual"].to_numpy(),
                    colour,
                    label,
                    part["residual"].to_numpy() - off,
                    part["residual"].to_numpy() + off,
                )
            )
    if state["state"] == "seen":
        marks.append(Rule(x=float(str(state["I_s"])), label="I_s"))
    return Figure(
        f"law{name.replace(' ', '_')}",
        f"Increment of the force{name}",
        f"Does the force saturate? {captions.saturates(findings, state)} Means of the holds over F_0, relaxation taken out with the fitted r, and the law with its 95 % band; beside it what the law leaves (the sweeps set apart for reading).",
        "relative increment of the axial force over coil current, both sweep directions and the fitted law; residuals",
        [
            Panel(marks, CURRENT, Axis("increment of the force", "%"), "increment"),
            Panel(rest, CURRENT, Axis("residual", "N"), "measured less law"),
        ],
        columns=2,
    )


def _time_figure(findings: Findings, run: str, own: pd.DataFrame, name: str) -> Figure:
    series = findings.arrays["series"]
    part = series[series["run"] == run]
    t = part["time"].to_numpy()
    return Figure(
        f"time{name.replace(' ', '_')}",
        f"Force over time{name}",
        f"Is what differs between the sweeps relaxation? {captions.relaxes(findings, run, own)} Samples and the law where the hold counts; below, what the law leaves of each hold in the order of time: a trend or a "
        "sawtooth would be drift, heating or hysteresis.",
        "axial force over time with the law; residuals of the holds over time",
        [
            Panel(
                [
                    Line(t, part["force"].to_numpy(), "measured", "measured"),
                    Line(t, part["model"].to_numpy(), "model", "law"),
                ],
                TIME,
                FORCE,
                "force",
            ),
            Panel(
                [
                    Rule(y=0.0),
                    *(
                        Points(
                            own[own["direction"] == s]["time"].to_numpy(),
                            own[own["direction"] == s]["residual"].to_numpy(),
                            n,
                            label,
                        )
                        for s, label, n in _WAYS
                        if (own["direction"] == s).any()
                    ),
                ],
                TIME,
                Axis("residual", "N"),
                "measured less law",
            ),
        ],
        share_x=True,
    )


def _increment_table(findings: Findings, run: str, own: pd.DataFrame, name: str) -> Table:
    rows = []
    for p in captions.of_run(findings, "force_increment", run):
        current = float(p.at["coil_current"])
        cells: list[float | Value | None] = [current, Value(p.value, p.std_error, p.ci95)]
        for sign, *_ in _WAYS:
            near = own[(own["direction"] == sign) & ((own["current"] - current).abs() < 0.03)]
            cells.append(float(near["force"].mean()) if len(near) else None)
        rows.append(cells)
    return Table(
        f"increments{name.replace(' ', '_')}",
        f"Increments{name}",
        f"By how much does the field raise the force? {captions.raised(findings, run)} Force at a current over that at 0 A, less 1, at one time; and the mean force "
        "measured on either sweep, relaxation included.",
        [
            Column("coil current", "A"),
            Column("increment", "%"),
            Column("force, rising", "N"),
            Column("force, falling", "N"),
        ],
        rows,
    )


def _field(findings: Findings) -> list[Figure | Table | Text]:
    blocks: list[Figure | Table | Text] = []
    if "field" in findings.arrays:
        points, curves = findings.arrays["field"], findings.arrays["field_curves"]
        for run in list(points["run"].unique())[:_RUNS]:
            own, lines = points[points["run"] == run], curves[curves["run"] == run]
            blocks.append(_field_figure(findings, str(run), own, lines, len(points["run"].unique()) > 1))
    if "pull" in findings.arrays:
        blocks.append(_pull_figure(findings))
    return blocks


def _field_figure(findings: Findings, run: str, own: pd.DataFrame, lines: pd.DataFrame, several: bool) -> Figure:
    marks: list[Mark] = []
    rest: list[Mark] = [Rule(y=0.0)]
    for sign, label, colour in _WAYS:
        part, line = own[own["direction"] == sign], lines[lines["direction"] == sign]
        if len(part):
            x, y = part["current"].to_numpy(), part["flux_density"].to_numpy()
            marks.append(Line(line["current"].to_numpy(), line["flux_density"].to_numpy(), colour))
            marks.append(Points(x, y, colour, label, part["low"].to_numpy(), part["high"].to_numpy()))
            half = (part["high"] - part["low"]).to_numpy() / 2
            left = part["residual"].to_numpy()
            rest.append(Points(x + _APART * (sign < 0), left, colour, label, left - half, left + half))
    return Figure(
        f"flux{f'_{run}' if several else ''}",
        f"Flux density{f' of run {run}' if several else ''}",
        f"Where does the field saturate, and what remains of it? {captions.magnetised(findings, run)} Means of the holds and the law on either sweep; beside it what the law leaves (the sweeps set apart for reading).",
        "flux density over coil current, both sweep directions, with the law; residuals",
        [
            Panel(marks, CURRENT, Axis("flux density", "T"), "field map"),
            Panel(rest, CURRENT, Axis("residual", "T"), "measured less law"),
        ],
        columns=2,
    )


def _pull_figure(findings: Findings) -> Figure:
    table = findings.arrays["pull"]
    marks: list[Mark] = []
    bound, blank = table[table["kind"] == "bound"], table[table["kind"] != "bound"]
    if len(bound):
        marks.append(
            Line(bound["current"].to_numpy(), bound["pull"].to_numpy(), "reference", "B² A/(2 μ_0)", dashed=True)
        )
    for (_, _, colour), (kind, own) in zip(_WAYS, blank.groupby("kind", sort=False), strict=False):
        y, half = own["pull"].to_numpy(), own["half"].to_numpy()
        marks.append(Points(own["current"].to_numpy(), y, colour, str(kind), y - half, y + half))
    rise = None
    if "curves" in findings.arrays:
        state = findings.arrays["state"].iloc[0]
        curve = findings.arrays["curves"]
        curve = curve[curve["run"] == state["run"]]
        if any(p.value is not None for p in captions.of_run(findings, "force_initial", str(state["run"]))):
            rise = float(curve["current"].iloc[-1]), float(curve["increment"].iloc[-1] * state["F0"])
        marks.append(
            Line(
                curve["current"].to_numpy(),
                curve["increment"].to_numpy() * state["F0"],
                "model",
                "rise of the pad's force" if len(blank) else "rise of the force",
            )
        )
    finite = np.isfinite(table["pull"].to_numpy()).all()
    return Figure(
        "pull",
        "Pull of the poles",
        f"Is it the pad or the magnet that presses? {captions.pressed(table, rise)}",
        "pull of the poles over coil current beside the rise of the force",
        [Panel(marks if finite else [], CURRENT, Axis("force", "N"))],
    )
