"""Figures of the drive over time: speed, load, force with their bands, events, innovations; the references over them."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Band, Cell, Column, Figure, Line, Mark, Panel, Points, Rule, Table, Value
from pipeline.rigs.tire.road import captions
from pipeline.rigs.tire.road.captions import GATE, LIMIT

if TYPE_CHECKING:
    import pandas as pd

TIME = Axis("time", "s")
SPEED, LOAD, FORCE = Axis("peripheral speed", "km/h"), Axis("vertical load Fz", "N"), Axis("longitudinal force Fx", "N")
# Half the revolutions of a second limit what is seen; a gap of more revolutions than that breaks a curve.
_BREAK = 4.0
_KINDS = {"vertical": ("vertical event", 4), "longitudinal": ("longitudinal event", 6)}
_EVENTS_DRAWN = 300
# Beyond so many points only the lowest and the highest of each stretch are drawn: the page stays small.
_MOST_POINTS = 6000
_LEAST_NIS = 0.01
_WALKS = {"rotation": "rad/s^2.5", "load": "N/s^1.5", "force": "N/s^1.5"}


def of_run(table: pd.DataFrame, run: str) -> pd.DataFrame:
    """Return the rows of one run."""
    return table[table["run"] == run]


def rows_of(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows as dictionaries."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def extremes(values: np.ndarray, most: int = _MOST_POINTS) -> np.ndarray:
    """Return the places of the lowest and the highest of each stretch, rising; all of them where there are few."""
    if values.size <= most:
        return np.arange(values.size)
    starts = np.linspace(0, values.size, most // 2 + 1).astype(int)
    places = [
        begin + np.array([np.argmin(values[begin:end]), np.argmax(values[begin:end])])
        for begin, end in pairwise(starts)
    ]
    return np.unique(np.concatenate(places))


def tracks(findings: Findings, run: str) -> list[Figure]:
    """Return the tracks of one drive, and the innovations of their filters."""
    revolutions = of_run(findings.arrays["revolutions"], run)
    evidence = of_run(findings.arrays["evidence"], run)
    time = revolutions["time"].to_numpy()
    gaps = _gaps(time)
    panels = [
        _panel(findings, run, "speed", SPEED, evidence["reference_speed"].to_numpy(), gaps),
    ]
    has_forces = bool(np.isfinite(revolutions["vertical_load_filtered"]).any())
    if has_forces:
        panels.append(_panel(findings, run, "vertical_load", LOAD, evidence["reference_load"].to_numpy(), gaps))
        if np.isfinite(revolutions["longitudinal_force_filtered"]).any():
            panels.append(
                _panel(findings, run, "longitudinal_force", FORCE, evidence["reference_force"].to_numpy(), gaps)
            )
    drive = rows_of(of_run(findings.arrays["drives"], run))[0]
    rate = (
        f"One number a revolution: what changes faster than {drive['bandwidth_low']:.1f} Hz (slowest) to "
        f"{drive['bandwidth_high']:.1f} Hz (fastest part of the drive) is not seen."
    )
    common = (
        f" The bands are ±2 standard deviations, what the bench leaves uncertain ({drive['load_sd']:.0f} N of load, "
        f"{drive['force_sd']:.0f} N of force, common to all revolutions) in them."
        if has_forces
        else ""
    )
    found = [
        Figure(
            f"tracks_{run}",
            f"Run {run}: speed, load and longitudinal force of every revolution",
            f"How was the tire loaded along the drive? {captions.loaded(revolutions, findings, run)} Dots: each revolution for itself; line and band: filtered.{common} {rate}{_thinned(time)}",
            f"peripheral speed, vertical load and longitudinal force of run {run} over time with bands and events",
            panels,
            share_x=True,
        )
    ]
    innovations = _innovations(run, time, evidence, drive)
    return [*found, *innovations]


def _panel(findings: Findings, run: str, name: str, axis: Axis, reference: np.ndarray, gaps: np.ndarray) -> Panel:
    table = of_run(findings.arrays["revolutions"], run)
    time, raw = table["time"].to_numpy(), table[name].to_numpy()
    value, se = table[f"{name}_filtered"].to_numpy(), table[f"{name}_se_filtered"].to_numpy()
    low, high = value - 2.0 * se, value + 2.0 * se
    marks: list[Mark] = []
    if name != "speed":
        everything = np.concatenate([raw[np.isfinite(raw)], low[np.isfinite(low)], high[np.isfinite(high)]])
        marks += _event_bars(findings, run, float(everything.min()), float(everything.max()))
    x, lower = _broken(time, low, gaps)
    marks.append(Band(x, lower, _broken(time, high, gaps)[1], "model", "±2 standard deviations"))
    if np.isfinite(reference).any():
        marks.append(Line(*_broken(time, reference, gaps), "reference", "reference channel"))
    known = np.isfinite(raw)
    shown = np.flatnonzero(known)[extremes(raw[known])]
    words = "each revolution" if shown.size == known.sum() else "lowest and highest of each stretch"
    marks.append(Points(time[shown], raw[shown], "measured", words))
    marks.append(Line(*_broken(time, value, gaps), "model", "filtered"))
    return Panel(marks, TIME, axis, axis.label)


def _event_bars(findings: Findings, run: str, low: float, high: float) -> list[Mark]:
    """Return a tinted bar for each event, named once a kind."""
    events = of_run(findings.arrays["events"], run)
    marks: list[Mark] = []
    named: set[str] = set()
    for row in rows_of(events)[:_EVENTS_DRAWN]:
        kind = str(row["kind"])
        words, role = _KINDS[kind]
        x = np.array([row["first"], row["last"]], dtype=float)
        marks.append(Band(x, np.full(2, low), np.full(2, high), role, "" if kind in named else words))
        named.add(kind)
    return marks


def _gaps(time: np.ndarray) -> np.ndarray:
    """Return behind which revolutions there is none for long, so that no line is drawn over it."""
    step = np.diff(time)
    return np.flatnonzero(step > _BREAK * np.median(step)) + 1 if step.size else np.zeros(0, dtype=int)


def _broken(time: np.ndarray, values: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if not gaps.size:
        return time, values
    return np.insert(time, gaps, time[gaps - 1]), np.insert(values, gaps, np.nan)


def _innovations(run: str, time: np.ndarray, evidence: pd.DataFrame, drive: dict[str, Any]) -> list[Figure]:
    panels, seen, means = [], {}, {}
    for name, words in (("rotation", "rotation"), ("load", "vertical load"), ("force", "longitudinal force")):
        nis = evidence[f"nis_{name}"].to_numpy()
        known = np.isfinite(nis)
        if not known.any():
            continue
        seen[words], means[words] = nis[known], drive[f"nis_{name}"]
        kept = extremes(nis[known])
        marks: list[Mark] = [
            Points(time[known][kept], np.maximum(nis[known][kept], _LEAST_NIS), "residual"),
            Rule(y=LIMIT, label="95 %"),
            Rule(y=GATE, role="fault", label="gate, 0.1 %"),
        ]
        title = f"{words}: mean {drive[f'nis_{name}']:.2f}, q = {_walk(drive[f'q_{name}'])} {_WALKS[name]}"
        panels.append(Panel(marks, TIME, Axis("NIS", "1", "log"), title))
    if not panels:
        return []
    return [
        Figure(
            f"nis_{run}",
            f"Run {run}: innovations of the filters",
            f"Are the filters consistent? {captions.consistent(seen, means)} Normalised innovation squared (NIS) of each revolution, drawn from "
            f"{_LEAST_NIS} on; beyond {GATE} a revolution is left out of the track.{_thinned(time)}",
            f"normalised innovation squared of the three filters of run {run} over time",
            panels,
            share_x=True,
        )
    ]


def _walk(q: float) -> str:
    """Write the intensity of a random walk with three digits."""
    return f"{q:.0f}" if q >= 100.0 else f"{q:.3g}"


def _thinned(time: np.ndarray) -> str:
    return " Of each stretch the lowest and the highest are drawn." if time.size > _MOST_POINTS else ""


def event_table(findings: Findings, run: str) -> list[Table]:
    """Return the events of a drive."""
    events = of_run(findings.arrays["events"], run)
    if events.empty:
        return []
    rows: list[list[Cell]] = [
        [
            int(row["event"]), str(row["kind"]), Value(row["time"], row["time_se"]),
            round(row["last"] - row["first"], 2), round(row["change"]), int(row["revolutions"]),
            "reaches an end or a gap" if row["cut"] else "",
        ]
        for row in rows_of(events)
    ]  # fmt: skip
    return [
        Table(
            f"events_{run}",
            f"Run {run}: events",
            f"{captions.events(events)} Where the load leaves its running median, or the longitudinal force that of steady rolling, for two revolutions or more. A steering "
            "correction and a bump cannot be told apart by one tire: both are vertical.",
            [Column("event"), Column("kind"), Column("centre", "s"), Column("length", "s"), Column("largest change", "N"),
             Column("revolutions"), Column("")],
            rows,
        )
    ]  # fmt: skip
