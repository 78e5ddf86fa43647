"""Timeline of states with alarms re-derived and logged, ratios that raise them; the two units' difference (rap.md, section 7)."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Band,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Panel,
    Points,
    Role,
    Rule,
    Status,
    Table,
    Value,
)
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.therapy.outcome import captions
from pipeline.rigs.rap.therapy.outcome.frames import of_run, records, runs_of, time_axis

_RATIOS = {"access": "access line", "filter": "filter", "return": "return line", "membrane": "membrane"}
_STATES = ("OFF", "SETUP", "PRIMING", "READY", "THERAPY", "PAUSE", "ALARM", "TERMINATION")
_VERDICTS = {
    "match": Status("match", "ok"), "late": Status("late", "warning"), "missed": Status("not logged", "rejected"),
    "extra": Status("no cause seen", "warning"), "not logged": Status("no codes logged"),
}  # fmt: skip
_RATIO_MOST = 6.0
_SOURCES: tuple[tuple[str, Role, bool], ...] = (("re-derived", "model", False), ("logged", "measured", True))
_MOMENTS: tuple[tuple[str, Role, str], ...] = (("time", "model", "re-derived"), ("logged", "measured", "logged"))


def of_alarms(findings: Findings) -> list[Figure | Table]:
    """Return the chapter on events and alarms."""
    blocks: list[Figure | Table] = []
    for run in runs_of(findings.arrays["parts"]):
        timeline = _timeline(findings, run)
        blocks += [timeline] if timeline.panels else []
        if len(of_run(findings.arrays["ratios"], run)):
            blocks.append(_ratios(findings, run))
    return [*blocks, *_delays(findings), *_baselines(findings)]


def _timeline(findings: Findings, run: str) -> Figure:
    states, alarms = of_run(findings.arrays["states"], run), of_run(findings.arrays["alarms"], run)
    if states.empty and alarms.empty:
        return Figure(f"timeline_{run}", "", "", "", [])
    rows = records(states)
    axis = time_axis(states.rename(columns={"end": "time"})) if len(states) else Axis("time", "s")
    words = [*_STATES, *dict.fromkeys(row["state"] for row in rows if row["state"] not in _STATES)]
    marks: list[Mark] = []
    for source, role, dashed in _SOURCES:
        own = [row for row in rows if row["source"] == source]
        if own:
            x = np.array([t for row in own for t in (row["start"], row["end"])])
            y = np.array([float(words.index(row["state"])) for row in own for _ in range(2)])
            marks.append(Line(x, y, role, source, dashed=dashed))
    due = alarms["time"].to_numpy(dtype=float)
    due = due[np.isfinite(due)]
    if due.size:
        marks.append(Points(due, np.full(due.size, float(words.index("ALARM"))), "fault", "alarm due"))
    key = ", ".join(f"{place} {word}" for place, word in enumerate(words) if any(row["state"] == word for row in rows))
    marked: list[Mark] = []
    codes = list(dict.fromkeys(row["alarm"] for row in records(alarms)))
    for name, role, label in _MOMENTS:
        at = [(row[name], codes.index(row["alarm"])) for row in records(alarms) if np.isfinite(row[name])]
        if at:
            x, y = np.array(at, dtype=float).T
            marked.append(Points(x, y + (0.12 if name == "logged" else -0.12), role, label))
    legend = ", ".join(f"{place} {code}" for place, code in enumerate(codes))
    panels = [Panel(marks, axis, Axis("state", whole=True), f"states: {key}")] if marks else []
    if marked:
        panels.append(Panel(marked, axis, Axis("alarm", whole=True), "alarms, by the numbers below"))
    return Figure(
        f"timeline_{run}", f"Run {run}: states and alarms",
        f"Did the device do what it should, and when? {captions.alarms(alarms)} States as the log's events and pressures give them beside those the device wrote; alarms "
        "that were due beside the logged codes" + (f": {legend}." if codes else "."),
        f"states of the device and alarms of run {run} over time, re-derived and logged", panels, share_x=True,
    )  # fmt: skip


def _ratios(findings: Findings, run: str) -> Figure:
    own = of_run(findings.arrays["ratios"], run)
    axis, time = time_axis(own), own["time"].to_numpy()
    high, low = (float(findings.settings.get(name, usual)) for name, usual in (("alarm_high", 1.6), ("alarm_low", 0.5)))
    panels = []
    for name, words in _RATIOS.items():
        least, most = own[f"{name}_low"].to_numpy(dtype=float), own[f"{name}_high"].to_numpy(dtype=float)
        if not np.isfinite(least).any():
            continue
        least, most = (np.clip(values, -1.0, _RATIO_MOST) for values in (least, most))
        marks: list[Mark] = [
            Band(time, least, most, "measured"), Line(time, 0.5 * (least + most), "measured"), Rule(y=high, label=f"{high:g}"), Rule(y=low, label=f"{low:g}"),
        ]  # fmt: skip
        panels.append(Panel(marks, axis, Axis("over its baseline"), words))
    return Figure(
        f"ratios_{run}", f"Run {run}: resistances over their baselines",
        f"Which part of the circuit raises an alarm? {captions.ratios(own, _RATIOS, low, high)} 1 s means, smallest and largest of each stretch of time; an alarm is due above {high:g} or "
        f"below {low:g}. Values beyond {_RATIO_MOST:g} are drawn there. A gap: pump off, just started, or no ultrafiltration.",
        f"ratios of access, filter, return and membrane resistance to their baselines over time of run {run}", panels, columns=2, share_x=True,
    )  # fmt: skip


def _delays(findings: Findings) -> list[Table]:
    rows: list[list[Cell]] = [
        [
            row["run"], row["alarm"], int(row["index"]) or None, _number(row["time"]),
            _number(row["time"] - row["began"], 2), _number(row["logged"], 1), _number(row["delay"], 2), _VERDICTS[str(row["verdict"])],
            _number(row["removed"], 8), _stopped(row),
        ]
        for row in records(findings.arrays["alarms"])
    ]  # fmt: skip
    blocks = []
    if rows:
        blocks.append(
            Table(
                "alarms", "Alarms: re-derived beside logged",
                f"{captions.alarms(findings.arrays['alarms'])} When the alarm was due, how long after its cause was first seen, when the device wrote its code. Removed: what the ultrafiltrate pump took "
                "from the cause until it stopped or the cause was gone.",
                [Column("Run"), Column("Alarm"), Column("No."), Column("Due", "s"), Column("Due after", "s"),
                 Column("Logged", "s"), Column("Logged after", "s"), Column("Verdict"), Column("Removed", "mL"), Column("Pump")],
                rows,
            )
        )  # fmt: skip
    rates: list[list[Cell]] = [
        [row["run"], round(row["hours"], 2), int(row["count"]), _number(row["upper95"], 2)]
        for row in records(findings.arrays["alarm_rates"])
    ]
    if rates:
        blocks.append(
            Table(
                "alarm_rates", "Alarms that the device did not log",
                "Re-derived alarms without a logged code, in the hours that the pump ran; the bound is that of a Poisson rate, which also holds where none was seen.",
                [Column("Run"), Column("Hours"), Column("Alarms"), Column("Per hour, at most (95 %)")], rates,
            )
        )  # fmt: skip
    return blocks


def _stopped(row: dict[str, Any]) -> Cell:
    if not np.isfinite(float(row["time"])):
        return None
    return "stopped" if row["uf_stopped"] else "ran on"


def _number(value: float, digits: int | None = None) -> float | None:
    """Return a number as a cell, rounded to so many places; empty where there is none."""
    if not np.isfinite(value):
        return None
    return float(value) if digits is None else round(float(value), digits)


def _baselines(findings: Findings) -> list[Table]:
    rows: list[list[Cell]] = []
    for row in records(findings.arrays["baselines"]):
        membrane = row["ratio"] == "membrane"
        base = _number(row["baseline"])
        rows.append(
            [
                row["run"],
                _RATIOS[str(row["ratio"])],
                None if membrane else base,
                base if membrane else None,
                _number(row["noise"], 4),
            ]
        )
    if not rows:
        return []
    return [
        Table(
            "baselines", "Baselines that the alarms are judged by", "Taken from the first steady minutes of the run; scatter of the ratio's 1 s means beside.",
            [Column("Run"), Column("Part"), Column("Resistance", "Pa s/m^3"), Column("Kuf", "mL/h/mmHg"), Column("Scatter of the ratio", "%")], rows,
        )
    ]  # fmt: skip


def of_redundancy(findings: Findings) -> list[Figure | Table]:
    """Return the chapter on the two units' readings."""
    table = findings.arrays["redundancy"]
    limit = float(findings.settings.get("cusum_limit", 80.0))
    blocks: list[Figure | Table] = []
    for run in runs_of(table):
        own = of_run(table, run)
        axis = time_axis(own)
        panels = []
        for tap in dict.fromkeys(own["channel"]):
            rows = own[own["channel"] == tap]
            time, low, high = (rows[name].to_numpy() for name in ("time", "low", "high"))
            found = [row for row in records(of_run(findings.arrays["mismatches"], run)) if row["channel"] == tap]
            ends: list[Mark] = [Rule(x=float(row["time"]), role="fault", label=f"{row['kind']}") for row in found]
            panels.append(
                Panel([Band(time, low, high, "residual"), Line(time, 0.5 * (low + high), "residual"), Rule(y=0.0), *ends], axis,
                      Axis("protective less control", "Pa"), f"{TAP_NAMES.get(str(tap), str(tap))}: difference")
            )  # fmt: skip
            sums: list[Mark] = [
                Line(time, np.minimum(rows["up"].to_numpy(), 10 * limit), 0, "upwards"),
                Line(time, np.minimum(rows["down"].to_numpy(), 10 * limit), 1, "downwards"), Rule(y=limit, label=f"limit {limit:g} Pa"),
            ]  # fmt: skip
            panels.append(
                Panel(sums, axis, Axis("cumulative sum", "Pa"), f"{TAP_NAMES.get(str(tap), str(tap))}: cumulative sums")
            )
        blocks.append(
            Figure(
                f"redundancy_{run}", f"Run {run}: control and protective unit",
                f"Do the two units read the same? {captions.units(findings.arrays['mismatches'], run)} 1 s means of the difference, the skew between their samples taken out; two-sided cumulative sums "
                f"(drawn up to {10 * limit:g} Pa) find drifts that a threshold misses.",
                f"difference of the two units' pressures and cumulative sums of run {run} over time", panels, columns=2,
            )
        )  # fmt: skip
    return [*blocks, *_unit_tables(findings)]


def _unit_tables(findings: Findings) -> list[Table]:
    tables = []
    rows: list[list[Cell]] = [
        [
            row["run"], TAP_NAMES.get(str(row["channel"]), str(row["channel"])),
            Value(row["skew"], row["skew_sd"]) if np.isfinite(row["skew"]) and np.isfinite(row["skew_sd"]) else _number(row["skew"]),
            _number(row["noise"], 1), int(row["mismatches"]), int(row["raw"]), _number(row["raw_per_hour"], 2), int(row["kept"]), _number(row["kept_upper"], 2),
        ]
        for row in records(findings.arrays["units"])
    ]  # fmt: skip
    if rows:
        tables.append(
            Table(
                "units", "Skew of the two units and false alarms of the threshold",
                f"{captions.skews(findings.arrays['units'])} How much later the protective unit samples, and how often the threshold would be passed outside mismatches: on the raw difference, and "
                "with the skew taken out (95 % bound beside). A skew turns the pulsation into a difference.",
                [Column("Run"), Column("Tap"), Column("Skew", "s"), Column("Noise", "Pa"), Column("Mismatches"), Column("False, raw"),
                 Column("Raw, per hour"), Column("False, skew out"), Column("At most, per hour")],
                rows,
            )
        )  # fmt: skip
    found: list[list[Cell]] = [
        [
            row["run"], TAP_NAMES.get(str(row["channel"]), str(row["channel"])), int(row["index"]), row["kind"],
            f"{row['size']:.3g} {'Pa/s' if row['kind'] == 'drift' else 'Pa'}", _number(row["onset"]), _number(row["time"]), _number(row["delay"], 2),
            _number(row["by_threshold"]), _number(row["by_cusum"]),
        ]
        for row in records(findings.arrays["mismatches"])
    ]  # fmt: skip
    if found:
        tables.append(
            Table(
                "mismatches", "Mismatches", "Both schemes run together: the threshold is quick, the cumulative sum finds small drifts.",
                [Column("Run"), Column("Tap"), Column("No."), Column("Kind"), Column("Size"), Column("Onset", "s"), Column("Found", "s"),
                 Column("After", "s"), Column("By threshold", "s"), Column("By cumulative sum", "s")],
                found,
            )
        )  # fmt: skip
    return tables
