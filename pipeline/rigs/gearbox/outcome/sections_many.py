"""A campaign of many runs in the report: trends, odd runs, tables by speed; single runs are those that stand for the others.

Every run's numbers stand in the findings and their arrays. What is drawn of single runs is in `sections_runs` and its like.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.errors import counted, listing
from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Band, Cell, Column, Figure, Line, Mark, Panel, Points, Table, Value
from pipeline.rigs.gearbox.many.watched import words_of
from pipeline.rigs.gearbox.outcome.paper import RPM, SPEEDS, TORQUES
from pipeline.rigs.number_over_runs import OverRuns, over_runs
from pipeline.rigs.over_runs import distribution_panel, odd_table, trend_figure

if TYPE_CHECKING:
    import pandas as pd

# A run is held against the paper where its speed is that close to one of the paper's.
NEAR = 0.03
_ALL = "Every run stands in arrays/{}.parquet."
_LEFT_OUT = "Runs that are unlike the others are left out."


def is_many(findings: Findings) -> bool:
    """Tell whether the report tells trends instead of every run."""
    return "watched" in findings.arrays and not findings.arrays["watched"].empty


def of_campaign(findings: Findings) -> list[Figure | Table]:
    """Return the chapter on what happens over the campaign."""
    numbers = watched(findings)
    figure = trend_figure(
        numbers,
        "over_campaign",
        "Numbers of the runs over the campaign",
        "Does the gearbox wear or warm up, was a day unlike the others, which runs are odd?"
        + (" Each run beside the level of its speed." if numbers[0].grouped else ""),
        columns=2,
    )
    spread = Figure(
        "scatter",
        "Scatter of the runs",
        "How well do runs repeat? Distance of each run from what is expected of it at its speed and place; what is far off is counted "
        "in the outermost bars.",
        "histograms of the deviation of runs from what is expected of them",
        [distribution_panel(number, number.what[:1].upper() + number.what[1:]) for number in numbers],
        columns=2,
    )
    table = odd_table(numbers)
    return [figure, *([table] if table else []), spread]


def watched(findings: Findings) -> list[OverRuns]:
    """Return the watched numbers over the runs, as identification saw them."""
    table = findings.arrays["watched"]
    parts = [part for _, part in table.groupby("number", sort=False)]
    return [
        over_runs(
            str(part["number"].iloc[0]), str(part["unit"].iloc[0]), [str(run) for run in part["run"]], part["value"].to_numpy(),
            part["error"].to_numpy(), groups=[words_of(float(speed)) for speed in part["group"]],
            begins=[None if np.isnan(moment) else float(moment) for moment in part["begins"]], among=len(parts),
        )
        for part in parts
    ]  # fmt: skip


def by_speed(findings: Findings) -> dict[float, list[str]]:
    """Return the runs of each speed, rad/s, that are like the others; all of a speed where none is."""
    runs = findings.arrays["runs"]
    found: dict[float, list[str]] = {}
    for speed, part in runs[np.isfinite(runs["group"])].groupby("group"):
        alike = part[part["unlike"] == ""]
        found[float(speed)] = [str(run) for run in (alike if len(alike) else part)["run"]]
    return found


def _spread(values: np.ndarray) -> tuple[Value | None, float | None, float | None]:
    """Return mean with the scatter between the runs, least and most; None for none."""
    known = values[np.isfinite(values)]
    if not known.size:
        return None, None, None
    scatter = float(known.std(ddof=1)) if known.size > 1 else None
    return Value(float(known.mean()), scatter), float(known.min()), float(known.max())


def _rpm(speed: float) -> str:
    return f"{speed / RPM:.4g} rpm"


def of_values(
    findings: Findings, quantities: dict[str, str], states: dict[tuple[str, str], str]
) -> list[Figure | Table]:
    """Return the tables of nominal and peak torques by speed."""
    blocks: list[Figure | Table] = []
    for quantity, words in quantities.items():
        rows: list[list[Cell]] = []
        for speed, runs in by_speed(findings).items():
            rpm = next((rpm for rpm in SPEEDS if abs(speed / RPM / rpm - 1.0) < NEAR), None)
            for (stage, kind), state in states.items():
                table = findings.arrays["peaks" if kind == "peak" else "levels"]
                own = table[(table["quantity"] == quantity) & (table["stage"] == stage) & table["run"].isin(runs)]
                mean, least, most = _spread(own["value"].to_numpy(dtype=float))
                printed = TORQUES[state][rpm][quantity == "torque_out"] if rpm and state in TORQUES else None
                if mean is not None:
                    rows.append([_rpm(speed), state, len(own), mean, least, most, printed])
        if rows:
            blocks.append(
                Table(
                    f"values_{quantity}", f"Nominal and peak {words}",
                    f"Mean over the runs of a speed ± scatter between them (one standard deviation). {_LEFT_OUT} Nominal: mean over whole "
                    "turns of the settled stage. Peak: maximum after a zero-phase low-pass at 20 Hz. The paper's bench is another one: its "
                    f"values stand beside, they are no reference. {_ALL.format('levels')[:-1]} and arrays/peaks.parquet.",
                    [Column("speed"), Column("state"), Column("runs"), Column("value", "N*m"), Column("least", "N*m"), Column("most", "N*m"),
                     Column("paper", "N*m")],
                    rows,
                )
            )  # fmt: skip
    return blocks


def of_events(findings: Findings, events: dict[str, str]) -> Table:
    """Return the table of events by speed."""
    table = findings.arrays["events"]
    by_run = table.pivot_table(index="run", columns="event", values="time", aggfunc="first") if len(table) else table
    return _table_by_speed(
        findings, "events", "Events",
        "When things happened, on the clock of the torques: mean over the runs of a speed ± scatter between them (one standard deviation). "
        f"{_LEFT_OUT} {_ALL.format('events')}",
        {words: ("s", _column(by_run, event)) for event, words in events.items()},
    )  # fmt: skip


def of_exchange(findings: Findings) -> list[Table]:
    """Return how the lock broke and closed again, by speed."""
    table, peaks = findings.arrays["events"], findings.arrays["peaks"]
    if not (table["event"] == "unlock").any():
        return []
    time = table.pivot_table(index="run", columns="event", values="time", aggfunc="first")
    shook = table.pivot_table(index="run", columns="event", values="disturbance", aggfunc="first")
    peak = peaks[(peaks["quantity"] == "torque_in") & (peaks["stage"] == "brake")].set_index("run")["value"]

    def between(first: str, last: str) -> Callable[[Sequence[str]], np.ndarray]:
        return lambda runs: _column(time, last)(runs) - _column(time, first)(runs)

    return [
        _table_by_speed(
            findings, "exchange", "Unlocking and locking again",
            "Torque that broke the lock, times to stop and to lock again, and how much the event shakes the bearing (mean square of the "
            "vibration within 0.1 s of it over that of FOS): mean over the runs of a speed ± scatter between them (one standard deviation). "
            f"{_LEFT_OUT}",
            {
                "input torque at unlock": ("N*m", lambda runs: peak.reindex(runs).to_numpy(dtype=float)),
                "unlock to stop": ("s", between("unlock", "sos_start")),
                "start to relock": ("s", between("sos_end", "relock")),
                "shake at unlock": ("1", _column(shook, "unlock")),
                "shake at relock": ("1", _column(shook, "relock")),
            },
        )
    ]  # fmt: skip


def of_slopes(findings: Findings, words: dict[str, str]) -> list[Table]:
    """Return the slopes of the torque map by speed and phase."""
    table = findings.arrays["transfers"]
    if table.empty:
        return []
    slope = table.pivot_table(index="run", columns="phase", values="slope", aggfunc="first")
    intercept = table.pivot_table(index="run", columns="phase", values="intercept", aggfunc="first", dropna=False)
    columns = {
        f"slope a, {words.get(phase, phase)}": ("1", _column(slope, phase)) for phase in dict.fromkeys(table["phase"])
    }
    columns["T_00, brake rise"] = ("N*m", _column(intercept, "brake"))
    return [
        _table_by_speed(
            findings, "slopes", "Slope of output over input torque, by phase",
            "T_out = a (T_in - T_00), mean over the runs of a speed ± scatter between them (one standard deviation). Equal slopes in all "
            f"phases mean drag in proportion to load, or a sensor's gain. {_LEFT_OUT} {_ALL.format('transfers')}", columns,
        )
    ]  # fmt: skip


def of_efficiency(findings: Findings, caption: str, columns: dict[str, tuple[str, str]]) -> Table:
    """Return a table by speed of parameters that each run has; `columns` heading -> parameter and unit."""
    known: dict[str, dict[str, float]] = {name: {} for name, _ in columns.values()}
    for p in findings.parameters:
        if p.name in known and p.value is not None and "run" in p.at:
            known[p.name][str(p.at["run"])] = p.value

    def told(name: str) -> Callable[[Sequence[str]], np.ndarray]:
        return lambda runs: np.array([known[name].get(run, np.nan) for run in runs])

    return _table_by_speed(
        findings, "efficiency", "Efficiency in FOS, torque ratio and heat in SOS",
        f"{caption} Mean over the runs of a speed ± scatter between them (one standard deviation). {_LEFT_OUT}",
        {heading: (unit, told(name)) for heading, (name, unit) in columns.items()},
    )  # fmt: skip


def of_clocks(findings: Findings) -> list[Table]:
    """Return how the clocks of the boards differ, by board."""
    clocks = findings.arrays["clocks"]
    rows: list[list[Cell]] = []
    for board, part in clocks.groupby("board", sort=False):
        applied = part["applied"].to_numpy(dtype=bool)
        mean, least, most = _spread(part["shift"].to_numpy(dtype=float))
        rows.append([str(board), len(part), int(applied.sum()), mean, least, most])
    if not rows:
        return []
    return [
        Table(
            "clocks", "Clocks of the boards",
            "Shift of each board against the torques, from what both see; applied where significant. Mean over the runs ± scatter between "
            f"them (one standard deviation). {_ALL.format('clocks')}",
            [Column("board"), Column("runs"), Column("applied in"), Column("shift", "s"), Column("least", "s"), Column("most", "s")], rows,
        )
    ]  # fmt: skip


def friction_panel(
    points: pd.DataFrame, curve: pd.DataFrame, findings: Findings, axis: Axis, title: str
) -> Panel | None:
    """Return drag or slip torque over speed: the runs as dots, those unlike the others apart; None where all have one speed."""
    if points.empty or np.ptp(points["x"]) < NEAR * points["x"].max():
        return None
    runs = findings.arrays["runs"].set_index("run")["unlike"]
    odd = points["run"].map(runs).fillna("") != ""
    marks: list[Mark] = []
    if not curve.empty:
        x = curve["x"].to_numpy()
        marks += [
            Band(x, curve["low"].to_numpy(), curve["high"].to_numpy(), "model", "95 %"),
            Line(x, curve["y"].to_numpy(), "model", str(curve["law"].iloc[0])),
        ]
    usual, unlike = points[~odd], points[odd]
    if len(usual):
        marks.append(Points(usual["x"].to_numpy(), usual["value"].to_numpy(), "measured", "runs"))
    if len(unlike):
        marks.append(Points(unlike["x"].to_numpy(), unlike["value"].to_numpy(), "fault", "unlike the others"))
    return Panel(marks, axis, Axis("torque", "N*m"), title)


def map_points(table: pd.DataFrame, findings: Findings, states: Sequence[str]) -> list[Mark]:
    """Return the torque map's points without bars; runs unlike the others apart."""
    runs = findings.arrays["runs"].set_index("run")["unlike"]
    odd = table["run"].map(runs).fillna("") != ""
    marks: list[Mark] = []
    for k, state in enumerate(states):
        part = table[(table["state"] == state) & ~odd]
        if len(part):
            marks.append(Points(part["torque_in"].to_numpy(), part["torque_out"].to_numpy(), k, state))
    if odd.any():
        marks.append(
            Points(
                table[odd]["torque_in"].to_numpy(), table[odd]["torque_out"].to_numpy(), "fault", "unlike the others"
            )
        )
    return marks


def _column(table: pd.DataFrame, name: str) -> Callable[[Sequence[str]], np.ndarray]:
    """Return the function that takes runs to their numbers, NaN where there is none."""

    def of(runs: Sequence[str]) -> np.ndarray:
        if name not in table.columns:
            return np.full(len(runs), np.nan)
        return np.asarray(table[name].reindex(list(runs)), dtype=float)

    return of


def _table_by_speed(
    findings: Findings,
    name: str,
    title: str,
    caption: str,
    columns: dict[str, tuple[str, Callable[[Sequence[str]], np.ndarray]]],
) -> Table:
    rows: list[list[Cell]] = [
        [_rpm(speed), len(runs), *(_spread(of(runs))[0] for _, of in columns.values())]
        for speed, runs in by_speed(findings).items()
    ]
    heads = [Column(heading, unit) for heading, (unit, _) in columns.items()]
    return Table(name, title, caption, [Column("speed"), Column("runs"), *heads], rows)


def told_shown(findings: Findings) -> str:
    """Say which runs are drawn and why."""
    runs = findings.arrays["runs"]
    typical = runs[runs["drawn"] == "typical"]["run"]
    return (
        f"Of {counted(len(runs), 'run')} these stand for the others wherever single runs are drawn: {listing(str(run) for run in typical)}. "
        "They are the ones at the paper's speeds, or else at the lowest and the highest, whose numbers are nearest to what is expected of them."
    )
