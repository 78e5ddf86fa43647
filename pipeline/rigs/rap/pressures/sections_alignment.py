"""How the clocks stand to each other: overlay of the pressures, correlation peak, lag over time (rap.md, section 7, item 1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

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
    Rule,
    Table,
    Text,
    Value,
)
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.pressures import captions

if TYPE_CHECKING:
    import pandas as pd

Blocks = list[Figure | Table | Text]
_TIME = Axis("time, bench's clock", "s")


def of_overlay(findings: Findings) -> Blocks:
    """Return 10 s of each pressure, device and aligned bench, with what is left between them."""
    blocks: Blocks = []
    for run, rows in by_run(findings.arrays["overlay"]):
        panels: list[Panel] = []
        for tap in dict.fromkeys(rows["channel"]):
            one = rows[rows["channel"] == tap]
            time = one["time"].to_numpy()
            panels += [
                Panel(
                    [
                        Line(time, one["bench"].to_numpy(), "reference", "bench, aligned, device's bandwidth"),
                        Line(time, one["corrected"].to_numpy(), "measured", "device, gain and offset taken off", dashed=True),
                    ],
                    _TIME, Axis(TAP_NAMES[tap], "mmHg"), TAP_NAMES[tap],
                ),
                Panel(
                    [Rule(y=0.0), Line(time, one["residual"].to_numpy(), "residual", "device less bench")],
                    _TIME, Axis("device - bench", "Pa"), f"{TAP_NAMES[tap]}, what is left",
                ),
            ]  # fmt: skip
        blocks.append(
            Figure(
                f"overlay_{run}", f"Ten seconds of each pressure{of_run(findings, run)}",
                "Do both see the same pressure once clock and bandwidth are equal? "
                f"{captions.overlay(rows, findings.arrays['checks'][findings.arrays['checks']['run'] == run])} Left device and bench, right their difference: it should be noise "
                "without a line of the pump. The bench went through the device's pole; the device's gain and offset (Deming) are taken off.",
                "device and bench pressures over ten seconds, tap by tap, and their differences", panels, columns=2,
            )
        )  # fmt: skip
    return blocks


def of_clock(findings: Findings) -> Blocks:
    """Return the correlation over the lag with its margin, and the lag over the run with the drift line."""
    blocks: Blocks = []
    for run, rows in by_run(findings.arrays["correlation"]):
        clock = findings.arrays["clock"]
        one = clock[clock["run"] == run].iloc[0]
        panels = [_correlation(rows, one)]
        track = findings.arrays["lag_track"]
        track = track[track["run"] == run]
        if len(track):
            panels.append(_track(track, one))
        blocks.append(
            Figure(
                f"clock_{run}", f"Lag of the device's clock{of_run(findings, run)}",
                f"Is the lag that and no other one? {one['told']}{captions.clock(findings, run)} Left: correlation of how the slow parts change (starts, stops, steps; the pump's lines are "
                "filtered off), which a periodic signal cannot decide. Right: the lag in each window from the phases of the pump's lines, with the line of the "
                "clock's rate.",
                "correlation over lag with the second-highest peak, and lag over time with a drift line", panels, columns=2,
            )
        )  # fmt: skip
    return blocks


def _correlation(rows: pd.DataFrame, one: pd.Series) -> Panel:
    lag, value = rows["lag"].to_numpy(), rows["correlation"].to_numpy()
    marks: list[Mark] = [Line(lag, value, "measured", "correlation")]
    if np.isfinite(one["coarse_lag"]):
        marks.append(
            Points(
                np.array([one["coarse_lag"]]),
                np.array([one["peak"]]),
                "model",
                f"highest: {one['coarse_lag']:.2f} s, {one['peak']:.3f}",
            )
        )
        marks.append(Rule(y=0.9 * one["peak"], role="fault", label="ambiguous from here"))
    if np.isfinite(one["second_lag"]) and np.isfinite(one["second"]):
        label = f"second: {one['second_lag']:.2f} s, {one['second']:.3f}"
        marks.append(Points(np.array([one["second_lag"]]), np.array([one["second"]]), "residual", label))
    return Panel(marks, Axis("lag", "s"), Axis("correlation"), "correlation of the steps")


def _track(track: pd.DataFrame, one: pd.Series) -> Panel:
    time, lag = track["time"].to_numpy(), track["lag"].to_numpy() - one["lag"]
    half = 1.96 * track["sd"].to_numpy()
    used = track["used"].to_numpy(dtype=bool)
    ends = np.array([np.nanmin(time), np.nanmax(time)])
    drift = one["rate"] * (ends - one["reference"])
    error = 1.96 * np.sqrt(one["lag_sd"] ** 2 + (one["rate_sd"] * (ends - one["reference"])) ** 2)
    marks: list[Mark] = []
    if np.isfinite(error).all():
        marks.append(Band(ends, drift - error, drift + error, "model", "95 %"))
    marks.append(Line(ends, drift, "model", f"{1e6 * one['rate']:+.1f} ppm"))
    shown: Sequence[tuple[np.ndarray, str, str]] = ((used, "measured", "windows"), (~used, "fault", "not used"))
    for mask, role, label in shown:
        if mask.any():
            points = Points(
                time[mask],
                lag[mask],
                "measured" if role == "measured" else "fault",
                label,
                (lag - half)[mask],
                (lag + half)[mask],
            )
            marks.append(points)
    return Panel(marks, _TIME, Axis(f"lag less {one['lag']:.4f} s", "s"), "lag over the run")


def of_poles(findings: Findings) -> Blocks:
    """Return device over bench at the pump's lines with eq. (2), by tap."""
    blocks: Blocks = []
    for run, rows in by_run(findings.arrays["lines"]):
        panels = []
        for tap in dict.fromkeys(rows["channel"]):
            one = rows[(rows["channel"] == tap)].sort_values("frequency")
            panels.append(_gains(one, str(tap)))
        blocks.append(
            Figure(
                f"lines_{run}", f"Device over bench at the pump's lines{of_run(findings, run)}",
                f"Is a gain and a pole all that the device adds? {captions.lines(rows)} Size of the ratio at each harmonic and speed, with eq. (2) as fitted: gain and pole of the device, "
                "pole of the bench. A tap that falls off the line has air, a loose dome or another sensor.",
                "size of device over bench against frequency, tap by tap", panels, columns=2,
            )
        )  # fmt: skip
    return blocks


def _gains(one: pd.DataFrame, tap: str) -> Panel:
    frequency, size, half = one["frequency"].to_numpy(), one["ratio"].to_numpy(), 1.96 * one["sd"].to_numpy()
    marks: list[Mark] = [Line(frequency, one["model"].to_numpy(), "model", "eq. (2)")]
    for order in sorted(set(one["harmonic"])):
        rows = (one["harmonic"] == order).to_numpy()
        marks.append(
            Points(
                frequency[rows], size[rows], int(order) - 1, f"k = {order:g}", (size - half)[rows], (size + half)[rows]
            )
        )
    return Panel(marks, Axis("frequency", "Hz"), Axis("|H|"), TAP_NAMES.get(tap, tap))


def by_run(table: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Return the rows of each run."""
    return [(str(run), rows) for run, rows in table.groupby("run", sort=False)] if len(table) else []


def of_run(findings: Findings, run: str) -> str:
    """Return what a title says of the run where there is more than one."""
    return f", run {run}" if sum(one.used for one in findings.runs) > 1 else ""


def clock_table(findings: Findings) -> Blocks:
    """Return the numbers of the clocks by run."""
    clock = findings.arrays["clock"]
    if clock.empty:
        return []
    columns = [Column("run"), Column("lag at mid-run", "s"), Column("rate error, ppm"), Column("lag at the end", "s"), Column("second peak / first"), Column("stamps jitter", "s"), Column("found from")]  # fmt: skip
    rows: list[list[Cell]] = [
        [str(r["run"]), _with_error(r["lag"], r["lag_sd"]), _with_error(1e6 * r["rate"], 1e6 * r["rate_sd"]), round(float(r["lag_end"]), 4), round(float(r["margin"]), 3), round(float(r["jitter"]), 4), str(r["method"])]
        for r in clock.to_dict("records")
    ]  # fmt: skip
    return [
        Table(
            "clocks",
            "The device's clock",
            "Device stamp + lag = bench time; the rate error is that of the device's clock.",
            columns,
            rows,
        )
    ]


def _with_error(value: float, sd: float) -> Value:
    return Value(float(value) if np.isfinite(value) else None, float(sd) if np.isfinite(sd) else None)
