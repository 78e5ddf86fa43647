"""Tables and figures on the data of the drives: losses and gaps, what the bench handed over, the clocks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Cell,
    Column,
    Figure,
    Line,
    Panel,
    Status,
    Stems,
    Table,
    Text,
    Value,
)
from pipeline.rigs.tire.road import captions
from pipeline.rigs.tire.road.sections_tracks import TIME, of_run, rows_of

_FINE_LOSS = 0.05


def drives_table(findings: Findings) -> list[Table]:
    """Return what each log lost and what is left of it."""
    rows: list[list[Cell]] = [
        [
            str(row["run"]), round(row["duration"], 1), _finite(row["packet_loss"], 3), _finite(row["longest_gap"], 3), int(row["revolutions"]),
            int(row["passages_lost"]), _finite(row["bandwidth_low"], 1), _finite(row["bandwidth_high"], 1),
        ]
        for row in rows_of(findings.arrays["drives"])
    ]  # fmt: skip
    return [
        Table(
            "drives",
            "What the radio brought",
            f"{captions.lost(rows_of(findings.arrays['drives']))} A passage without a number was lost, or its waveform is not that of a ring. One number a revolution limits what is seen to "
            "half a revolution a second, at the slowest and at the fastest.",
            [Column("run"), Column("length", "s"), Column("packets lost", "%"), Column("longest gap", "s"), Column("passages"),
             Column("without a number"), Column("seen up to, slowest", "Hz"), Column("fastest", "Hz")],
            rows,
        )
    ]  # fmt: skip


def data(findings: Findings) -> list[Figure]:
    """Return losses over time."""
    panels = []
    for run in findings.arrays["drives"]["run"]:
        table = of_run(findings.arrays["gaps"], str(run))
        time = table["time"].to_numpy()
        width = float(np.median(np.diff(time))) if time.size > 1 else 1.0
        marks = [Stems(time, table["share"].to_numpy(), "fault", width=width)]
        panels.append(Panel(marks, TIME, Axis("samples lost", "%"), f"run {run}: samples lost"))
        longest = Line(time, table["longest"].to_numpy(), "measured")
        panels.append(Panel([longest], TIME, Axis("longest gap", "s"), f"run {run}: longest gap"))
    return [
        Figure(
            "losses",
            "Losses along the drive",
            f"Where did the radio fail? {captions.worst_stretch(findings.arrays['gaps'])} Lost samples stay missing: nothing is interpolated before the fit.",
            "share of lost samples and longest gap over time",
            panels,
            columns=2,
        )
    ]


def bench_table(findings: Findings) -> list[Table | Text]:
    """Return what of the bench is used, and whether loads are extrapolated."""
    drives = rows_of(findings.arrays["drives"])
    told = [
        f"Run {row['run']}: no load and no force: {row['reason']}"
        for row in drives
        if row["reason"] and not row["bench"]
    ]
    blocks: list[Table | Text] = [Text(told)] if told else []
    rows = [_bench_row(row) for row in drives]
    return [
        *blocks,
        Table(
            "bench",
            "Bench and drive",
            f"{captions.extrapolated(drives)} Speed is peripheral speed, rolling radius times rotation: slip is in it. Load and force rest on the ring, tread and sensor "
            "of the bench at the pressure of the drive; their common uncertainty moves all revolutions together.",
            [Column("run"), Column("bench"), Column("rolling radius", "m"), Column("pressure, bench", "Pa"),
             Column("pressure, drive", "Pa"), Column("loads, bench"), Column("loads, drive"), Column("extrapolated"),
             Column("common sd of load", "N"), Column("common sd of force", "N")],
            rows,
        ),
        *_common(findings),
        *_references(drives),
    ]  # fmt: skip


def _common(findings: Findings) -> list[Table]:
    """Return where the common uncertainty comes from."""
    rows: list[list[Cell]] = [
        [str(row["run"]), str(row["source"]), round(float(row["load"]), 1), round(float(row["force"]), 1)]
        for row in rows_of(findings.arrays["common_errors"])
    ]
    if not rows:
        return []
    return [
        Table(
            "common",
            "Where the common uncertainty comes from",
            f"{captions.largest_source(findings.arrays['common_errors'])} Standard uncertainties at the median load and rotation of the drive; they move all its revolutions together.",
            [Column("run"), Column("source"), Column("load, N"), Column("force, N")],
            rows,
        )
    ]


def _bench_row(row: dict[str, Any]) -> list[Cell]:
    radius = Value(row["radius"], row["radius_sd"]) if math.isfinite(row["radius"]) else None
    if not row["bench"]:
        return [str(row["run"]), "none", radius, *[None] * 7]
    share = float(row["extrapolated"])
    extrapolated = Status(f"yes, {100 * share:.0f} %", "warning") if share > 0.0 else Status("no", "ok")
    return [
        str(row["run"]), str(row["bench"]), radius, _finite(row["bench_pressure"]), _finite(row["pressure"]),
        f"{row['least_bench_load']:.0f} to {row['most_bench_load']:.0f} N", f"{row['lowest_load']:.0f} to {row['highest_load']:.0f} N",
        extrapolated, _finite(row["load_sd"], 1), _finite(row["force_sd"], 1),
    ]  # fmt: skip


def _references(drives: list[dict[str, Any]]) -> list[Table]:
    """Return how the drive compares with its reference channels."""
    rows: list[list[Cell]] = [
        [
            str(row["run"]), _finite(row["load_bias"], 1), _finite(row["force_bias"], 1), _finite(row["speed_rms"], 3),
            Value(row["offset"], row["offset_sd"]) if math.isfinite(row["offset_sd"]) else _finite(row["offset"], 6),
            Status("applied", "warning") if row["offset_applied"] is True or row["offset_applied"] == 1.0 else Status("not significant", "ok"),
        ]
        for row in drives
        if any(math.isfinite(row[name]) for name in ("load_bias", "force_bias", "speed_rms"))
    ]  # fmt: skip
    if not rows:
        return []
    return [
        Table(
            "references",
            "Against the reference channels",
            "Found less reference: mean differences of load and force, difference of peripheral and vehicle speed (slip is in it), and how far the clocks of "
            "transmitter and vehicle are apart.",
            [Column("run"), Column("load, mean difference, N"), Column("force, mean difference, N"),
             Column("speed, rms difference", "m/s"), Column("clock of the vehicle", "s"), Column("")],
            rows,
        )
    ]  # fmt: skip


def _finite(value: Any, decimals: int | None = None) -> float | None:
    """Return a number, rounded where it is told to so many decimals; None for none."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value) if decimals is None else round(float(value), decimals) + 0.0
