"""Ultrafiltrate in the tank: set, estimated, weighed; the error, the innovations, the pump's gain (rap.md, section 7, item 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings import Findings, Parameter
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
    Table,
    Value,
)
from pipeline.rigs.rap.therapy.outcome import captions
from pipeline.rigs.rap.therapy.outcome.frames import of_run, records, runs_of, time_axis

if TYPE_CHECKING:
    import pandas as pd

_LINES: tuple[tuple[str, str, Role], ...] = (
    ("set", "set", "reference"),
    ("scale", "scale", "measured"),
    ("device", "device's own", 2),
)
_ERRORS: tuple[tuple[str, str, Role], ...] = (("device", "device's own", 2), ("filter", "estimate", "model"))
_MOST_SPANS = 12
# An expected innovation that many times the usual one.
_UNKNOWN = 10.0


def of_volume(findings: Findings) -> list[Figure | Table]:
    """Return the chapter on the ultrafiltrate."""
    blocks: list[Figure | Table] = []
    for run in runs_of(findings.arrays["volume"]):
        blocks += [_course(findings, run), _filter(findings, run)]
    return [*blocks, *_numbers(findings), *_blind(findings)]


def _course(findings: Findings, run: str) -> Figure:
    own = of_run(findings.arrays["volume"], run)
    axis, time, volume = time_axis(own), own["time"].to_numpy(), Axis("volume", "mL")
    estimate, sd = own["estimate"].to_numpy(), own["sd"].to_numpy()
    marks: list[Mark] = [*_shaded(findings, run, estimate)]
    marks.append(Band(time, estimate - 2.0 * sd, estimate + 2.0 * sd, "model", "estimate ± 2 sd"))
    for name, label, role in _LINES:
        values = own[name].to_numpy()
        if np.isfinite(values).any():
            marks.append(Line(time, values, role, label, dashed=name == "set"))
    marks.append(Line(time, estimate, "model", "estimate"))
    panels = [Panel(marks, axis, volume, "volume in the tank")]
    error = of_run(findings.arrays["volume_error"], run)
    if len(error):
        panels.append(_error(error, axis))
    return Figure(
        f"volume_{run}", f"Run {run}: ultrafiltrate",
        f"Does the estimate from level and pump follow the scale? {captions.volume(findings, run)} Shaded: stretches without a usable level (blind bottom, lost echo, tilt), "
        "where the volume is dead reckoning from the pump's command, before the first level filled in backwards. The error is the estimate less the scale, with ± 2 sd.",
        f"set, estimated and weighed volume of run {run} over time and their difference", panels, columns=2, share_x=True,
    )  # fmt: skip


def _shaded(findings: Findings, run: str, values: np.ndarray) -> list[Mark]:
    """Return the stretches without a level as bands behind the curves, the longest of them."""
    spans = sorted(records(of_run(findings.arrays["blind"], run)), key=lambda row: row["start"] - row["end"])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    low = min(low, 0.0)
    marks: list[Mark] = []
    for place, row in enumerate(spans[:_MOST_SPANS]):
        if row["end"] - row["start"] >= 10.0:
            x = np.array([row["start"], row["end"]])
            marks.append(Band(x, np.full(2, low), np.full(2, high), "reference", "" if place else "no usable level"))
    return marks


def _error(error: pd.DataFrame, axis: Axis) -> Panel:
    marks: list[Mark] = []
    for source, label, role in _ERRORS:
        rows = error[error["source"] == source]
        if rows.empty:
            continue
        time, values, sd = (rows[name].to_numpy() for name in ("time", "error", "sd"))
        if np.isfinite(sd).any():
            marks.append(Band(time, values - 2.0 * sd, values + 2.0 * sd, "model", "estimate ± 2 sd"))
        marks.append(Line(time, values, role, label))
    return Panel([*marks, Rule(y=0.0)], axis, Axis("less the scale", "mL"), "error")


def _filter(findings: Findings, run: str) -> Figure:
    own = of_run(findings.arrays["innovations"], run)
    used, passed = own[own["kind"] == "used"], own[own["kind"] == "passed over"]
    axis = time_axis(own)
    time, sd = used["time"].to_numpy(), used["sd"].to_numpy()
    # The first level meets a volume that nobody knew: its innovation is not to be drawn.
    known = np.isfinite(sd)
    sd = np.where(sd < _UNKNOWN * np.median(sd[known]), sd, np.nan) if known.any() else sd
    low, high = (np.where(np.isfinite(sd), used[end].to_numpy(), np.nan) for end in ("low", "high"))
    three = np.concatenate([3.0 * sd, [np.nan], -3.0 * sd])
    marks: list[Mark] = [
        Band(time, low, high, "measured", "innovations used"),
        Line(np.concatenate([time, [np.nan], time]), three, "reference", "± 3 sd", dashed=True),
    ]  # fmt: skip
    if len(passed):
        # Wild echoes reach far beyond; they are drawn at the edge so that the others can be read.
        edge = 6.0 * float(np.nanmax(sd)) if np.isfinite(sd).any() else np.inf
        at = np.clip(passed["low"].to_numpy(), -edge, edge)
        marks.append(Points(passed["time"].to_numpy(), at, "fault", "passed over (beyond the edge: at it)"))
    volume = of_run(findings.arrays["volume"], run)
    at, gain, gain_sd = (volume[name].to_numpy() for name in ("time", "gain", "gain_sd"))
    gains: list[Mark] = [Band(at, gain - 2.0 * gain_sd, gain + 2.0 * gain_sd, "model", "± 2 sd"), Line(at, gain, "model", "gain"),
                         Rule(y=1.0)]  # fmt: skip
    return Figure(
        f"filter_{run}", f"Run {run}: what the filter does",
        f"Are the innovations (level less predicted level) as large as the filter expects? {captions.innovations(findings.arrays['account'], run)} Smallest and largest of each stretch of time. "
        "Right: delivered over commanded ultrafiltration.",
        f"innovations of the tank filter with three standard deviations and the pump's gain of run {run} over time",
        [Panel(marks, axis, Axis("level", "m"), "innovations"), Panel(gains, axis, Axis("pump gain"), "pump gain")], columns=2,
    )  # fmt: skip


def _numbers(findings: Findings) -> list[Table]:
    volumes: list[list[Cell]] = []
    loops: list[list[Cell]] = []
    for run in runs_of(findings.arrays["parts"]):
        found = [next(iter(findings.find(name, run=run)), None)
                 for name in ("uf_volume_final", "uf_pump_gain", "uf_volume_error_rms")]  # fmt: skip
        more = next(iter(records(of_run(findings.arrays["account"], run))), None)
        if any(found) and more is not None:
            V, gain, rms = map(value_of, found)
            volumes.append([run, V, *(_rounded(more[name], n) for name, n in _ACCOUNT.items()), rms])
            loops.append([run, gain, *(_rounded(more[name], n) for name, n in _LOOP.items())])
    if not volumes:
        return []
    return [
        Table(
            "volumes", "The account of the ultrafiltrate",
            "V: in the tank at the end. Removed: sum over all fillings of the tank. Error: estimate less scale, after the first echo.",
            [Column("Run"), Column("V", "mL"), Column("Removed", "mL"), Column("Final error", "mL"), Column("Final error", "%"), Column("Error, rms", "mL")],
            volumes,
        ),
        Table(
            "regulation", "The pump and its regulation",
            "Gain: delivered over commanded. Rate: slope of the scale over the set rate. Closed and open loop: delivered less set, as regulated and as "
            "the command alone would have given. NIS: mean normalised innovation squared, 1 where the filter's noise is right.",
            [Column("Run"), Column("Gain"), Column("Rate, scale over set"), Column("Closed loop", "%"), Column("Open loop", "%"), Column("NIS")],
            loops,
        ),
    ]  # fmt: skip


# What the account tells, and to how many decimals in SI.
_ACCOUNT = {"removed": 6, "final_error": 8, "final_share": 4}
_LOOP = {"rate_ratio": 4, "closed_loop": 4, "open_loop": 4, "nis": 2}


def _rounded(value: float, decimals: int) -> float | None:
    return round(float(value), decimals) + 0.0 if np.isfinite(value) else None


def value_of(found: Parameter | None) -> Cell:
    """Return a parameter as a cell; empty where it is not determined."""
    return Value(found.value, found.std_error, found.ci95) if found is not None and found.value is not None else None


def _blind(findings: Findings) -> list[Table]:
    rows: list[list[Cell]] = [
        [row["run"], row["start"], row["end"], (row["end"] - row["start"]) / 60.0, row["why"]]
        for row in records(findings.arrays["blind"])
        if row["end"] - row["start"] >= 60.0
    ]
    if not rows:
        return []
    return [
        Table(
            "blind", "Stretches without a level", "A minute and longer; the volume is dead reckoning there.",
            [Column("Run"), Column("From", "s"), Column("To", "s"), Column("Minutes"), Column("Why")], rows,
        )
    ]  # fmt: skip
