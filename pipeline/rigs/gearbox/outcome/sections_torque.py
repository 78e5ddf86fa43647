"""Torque map, efficiency and heat, energy balance, load inertia, friction over speed, trend over the runs."""

from __future__ import annotations

import numpy as np

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
    Table,
    Text,
    Value,
)
from pipeline.rigs.gearbox.outcome import captions
from pipeline.rigs.gearbox.outcome import sections_many as many
from pipeline.rigs.gearbox.outcome.paper import TORQUES
from pipeline.rigs.gearbox.outcome.sections_many import is_many
from pipeline.rigs.gearbox.outcome.sections_runs import STAGES, of_run, records, shown_runs

_IN, _OUT = Axis("input torque", "N*m"), Axis("output torque", "N*m")
_STATES = ("start-up peak", "FOS nominal", "brake peak", "SOS nominal")


def of_map(findings: Findings) -> list[Figure | Table | Text]:
    """Return the chapter on the torque map."""
    table = findings.arrays["map"]
    if table.empty:
        return []
    marks: list[Mark] = many.map_points(table, findings, _STATES) if is_many(findings) else []
    for k, state in enumerate(_STATES if not marks else ()):
        rows = table[table["state"] == state]
        if rows.empty:
            continue
        x, y = rows["torque_in"].to_numpy(), rows["torque_out"].to_numpy()
        dx, dy = (1.96 * np.nan_to_num(rows[name].to_numpy()) for name in ("in_sd", "out_sd"))
        marks.append(Points(x, y, k, state, y - dy, y + dy, left=x - dx, right=x + dx))
    printed = np.array([pair for speeds in TORQUES.values() for pair in speeds.values()])
    marks.append(Points(printed[:, 0], printed[:, 1], "reference", "paper"))
    reach = float(max(table["torque_in"].max(), printed[:, 0].max()))
    slope = findings.find("torque_transfer_slope")
    intercept = findings.find("torque_transfer_intercept")
    a = next((p.value for p in slope if not p.at), None)
    T_00 = next((p.value for p in intercept if not p.at), None)
    if a and T_00 is not None:
        x = np.array([max(T_00, 0.0), reach])
        marks.append(Line(x, a * (x - T_00), "model", f"brake rise, slope {a:.3f}"))
    fos = table[table["state"] == "FOS nominal"]
    if not fos.empty:
        t_in, t_out = float(fos["torque_in"].mean()), float(fos["torque_out"].mean())
        top = 1.05 * float(table["torque_out"].max())
        x = np.array([t_in - t_out, t_in - t_out + top])
        marks.append(Line(x, x - t_in + t_out, "reference", "slope 1, rigid box", dashed=True))
    figure = Figure(
        "torque_map",
        "Torque map",
        f"Does all the torque that goes in come out? {captions.transferred(next((p for p in slope if not p.at), None))} A rigid locked box with drag that depends on speed alone moves along slope "
        "1. A smaller slope is drag that grows with the load, or the gain of a torque sensor; this bench cannot tell which.",
        "output over input torque of all states and runs with the fitted line and a line of slope 1",
        [Panel(marks, _IN, _OUT)],
    )
    return [figure, *_slopes(findings)]


def _slopes(findings: Findings) -> list[Table]:
    transfers = findings.arrays["transfers"]
    if transfers.empty:
        return []
    words = {"startup": "start-up", "brake": "brake rise", "steady": "FOS to SOS", "loaded": "FOS under load"}
    if is_many(findings):
        return many.of_slopes(findings, words)
    phases = list(dict.fromkeys(transfers["phase"]))
    rows = []
    for run in dict.fromkeys(transfers["run"]):
        own = {row["phase"]: row for row in records(of_run(transfers, str(run)))}
        cells = [Value(own[p]["slope"], own[p]["slope_sd"]) if p in own else None for p in phases]
        brake = own.get("brake")
        rows.append([str(run), *cells, Value(brake["intercept"], brake["intercept_sd"]) if brake else None])
    heads = [Column(f"slope a, {words.get(phase, phase)}") for phase in phases]
    return [
        Table(
            "slopes", "Slope of output over input torque, by phase",
            f"{captions.slopes(transfers, words)} a: output over input torque, less the input torque T_00 at which nothing comes out. Equal slopes in all phases mean drag in proportion to load, or a sensor's gain.",
            [Column("run"), *heads, Column("T_00, brake rise", "N*m")], rows,
        )
    ]  # fmt: skip


def of_power(findings: Findings) -> list[Figure | Table | Text]:
    """Return the chapter on efficiency in FOS and on what becomes heat in SOS."""
    caption = (
        f"{captions.powers(findings)} While locked, input and output turn at one speed: output over input torque is a power efficiency. In SOS the output stands and no power "
        "comes out: the same ratio is one of a reaction, no efficiency, and all of the input torque times the input speed becomes heat."
    )
    if is_many(findings):
        return [many.of_efficiency(findings, caption, _POWER), *_energy(findings)]
    rows = []
    for run in findings.arrays["runs"]["run"]:
        found = [findings.find(name, run=str(run)) for name, _ in _POWER.values()]
        rows.append([str(run), *(Value(p[0].value, p[0].std_error, p[0].ci95) if p else None for p in found)])
    heads = [Column(heading, unit if unit != "1" else "") for heading, (_, unit) in _POWER.items()]
    table = Table(
        "efficiency", "Efficiency in FOS, torque ratio and heat in SOS", caption, [Column("run"), *heads], rows
    )
    return [table, *_energy(findings)]


# Heading -> parameter and unit.
_POWER = {
    "efficiency (FOS)": ("efficiency_fos", "%"),
    "torque ratio (SOS)": ("torque_ratio_sos", "1"),
    "power to heat (SOS)": ("power_dissipated_sos", "W"),
}


def _energy(findings: Findings) -> list[Table]:
    energy = findings.arrays["energy"]
    if energy.empty:
        return []
    shown = shown_runs(findings)
    rows = [
        [str(row["run"]), STAGES.get(str(row["stage"]), str(row["stage"])), round(row["duration"], 2), round(row["work_in"], 2), round(row["work_out"], 2) + 0.0,
         round(row["kinetic"], 2) if row["stage"] in ("startup", "rundown") else None, round(row["work_in"] - row["work_out"], 2)]
        for row in records(energy)
        if row["run"] in shown
    ]  # fmt: skip
    return [
        Table(
            "energy", "Energy balance by stage",
            f"{captions.burnt(energy[energy['run'].isin(shown)])} Work over each stage; brake and release are left out, as the input speed is not known there. What goes in and does not "
            "come out is drag to ground while locked (or a sensor's gain), and heat of the slipping gears in SOS.",
            [Column("run"), Column("stage"), Column("duration", "s"), Column("work in", "J"), Column("work out", "J"),
             Column("of it, to the flywheel's speed", "J"), Column("lost", "J")],
            rows,
        )
    ]  # fmt: skip


def of_inertia(findings: Findings) -> list[Figure | Table | Text]:
    """Return the chapter on start-up and load inertia."""
    load = findings.arrays["load"]
    if load.empty:
        return []
    blocks: list[Figure | Table | Text] = []
    time = Axis("time", "s")
    panels = []
    for run in shown_runs(findings):
        own = of_run(load, run)
        if own.empty:
            continue
        t = _broken(own["time"].to_numpy())
        measured, modelled = (_at(own, name) for name in ("measured", "predicted"))
        panels.append(
            Panel([Line(t, measured, "measured", "measured"), Line(t, modelled, "model", "J dω/dt + drag")], time, _OUT,
                  f"run {run}")
        )  # fmt: skip
        panels.append(Panel([Line(t, measured - modelled, "residual"), Rule(y=0.0)], time, Axis("residual", "N*m")))
    if panels:
        blocks.append(
            Figure(
                "load", "Output torque against inertia and drag",
                f"Do J dω/dt and drag explain the output torque while the brake is free? {captions.explained(load)} Means over windows of 0.8 s, weighted as in "
                "the fit; start-up with FOS, then release with FOS. The model is that of all runs together.",
                "measured and modelled output torque over time, and what is left", panels, columns=2,
            )
        )  # fmt: skip
    return [*blocks, *_trend(findings)]


def _at(own: object, name: str) -> np.ndarray:
    """Return a column with a break where windows are missing."""
    time, values = own["time"].to_numpy(), own[name].to_numpy()  # type: ignore[index]
    return np.insert(values.astype(float), np.flatnonzero(np.diff(time) > 0.5) + 1, np.nan)


def _broken(time: np.ndarray) -> np.ndarray:
    return np.insert(time.astype(float), np.flatnonzero(np.diff(time) > 0.5) + 1, np.nan)


_TREND = (
    ("inertia_load", "inertia of the load", "kg*m^2"),
    ("lock_torque", "lock torque", "N*m"),
    ("slip_torque", "slip torque", "N*m"),
    ("efficiency_fos", "efficiency in FOS", "%"),
)


def _trend(findings: Findings) -> list[Figure]:
    names = [str(run) for run in findings.arrays["runs"]["run"]]
    if len(names) < 2 or is_many(findings):
        return []
    panels = []
    for name, label, unit in _TREND:
        found = [(k, p) for k, run in enumerate(names, 1) for p in findings.find(name, run=run) if p.value is not None]
        if not found:
            continue
        x = np.array([float(k) for k, _ in found])
        y = np.array([p.value for _, p in found], dtype=float)
        low, high = (np.array([p.ci95[i] if p.ci95 else p.value for _, p in found], dtype=float) for i in (0, 1))
        marks: list[Mark] = [Points(x, y, "measured", "", low, high)]
        together = [p for p in findings.find(name) if not p.at and p.value is not None and p.ci95 is not None]
        for p in together:
            ends = np.array([0.5, len(names) + 0.5])
            marks.append(Rule(y=p.value, role="model", label="all runs"))
            if p.ci95:
                marks.insert(0, Band(ends, np.full(2, p.ci95[0]), np.full(2, p.ci95[1])))
        panels.append(Panel(marks, Axis("run in the order of the campaign", whole=True), Axis(label, unit), label))
    return [
        Figure(
            "trend", "Runs side by side",
            f"Do runs of one speed repeat, and does anything drift over the campaign? {captions.repeats(findings, [(name, label) for name, label, _ in _TREND])} 95 % intervals; runs in the order "
            f"{', '.join(names)}. Lock and slip torque follow the speed as well.",
            "parameters of each run with intervals over the run's number", panels, columns=2,
        )
    ]  # fmt: skip


_DRAGS = {"drag_locked": "drag to ground", "slip": "slip torque", "load": "drag of the load"}


def of_friction(findings: Findings) -> list[Figure | Table | Text]:
    """Return the chapter on drag and slip torque over speed."""
    points, curves = findings.arrays["friction"], findings.arrays["curves"]
    panels = []
    for kind, title, axis in (
        ("drag_locked", "drag of the locked gearbox", Axis("speed in FOS", "rad/s")),
        ("slip", "slip torque", Axis("slip speed in SOS", "rad/s")),
        ("load", "drag of the load", Axis("output speed", "rad/s")),
    ):
        own, curve = points[points["kind"] == kind], curves[curves["kind"] == kind]
        if is_many(findings):
            panel = many.friction_panel(own, curve, findings, axis, title)
            panels += [panel] if panel else []
            continue
        marks: list[Mark] = []
        if not curve.empty:
            x = curve["x"].to_numpy()
            marks += [
                Band(x, curve["low"].to_numpy(), curve["high"].to_numpy(), "model", "95 %"),
                Line(x, curve["y"].to_numpy(), "model", str(curve["law"].iloc[0])),
            ]
        if not own.empty:
            y, half = own["value"].to_numpy(), 1.96 * own["sd"].to_numpy()
            marks.append(Points(own["x"].to_numpy(), y, "measured", "runs", y - half, y + half))
        if marks:
            panels.append(Panel(marks, axis, Axis("torque", "N*m"), title))
    if not panels:
        return []
    return [
        Figure(
            "friction", "Friction over speed",
            f"How do drag to ground, slip torque and drag of the load depend on speed? {captions.over_speed(curves, _DRAGS)} Points are runs, bands the 95 % interval of the "
            "curve. The errors of all points share that of the slope a.",
            "drag, slip torque and load drag over speed with fitted curves", panels, columns=2,
        )
    ]  # fmt: skip
