"""How the device's clock stands to the bench's: lag over time with the line of its drift (rap.md, section 7, item 1)."""

from __future__ import annotations

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Points, Status, Table, Value
from pipeline.rigs.rap.therapy.outcome import captions
from pipeline.rigs.rap.therapy.outcome.frames import of_run, records, runs_of, time_axis

_PPM = 1e-6


def of_clocks(findings: Findings) -> list[Figure | Table]:
    """Return the chapter on the clocks, of the runs in which device and bench read the same pressures."""
    table = findings.arrays["lags"]
    panels = []
    for run in runs_of(table):
        own = of_run(table, run)
        used = own[own["used"].astype(bool)]
        time, lag, sd = (used[name].to_numpy(dtype=float) for name in ("time", "lag", "sd"))
        marks: list[Mark] = [
            Points(time, lag, "measured", "windows", lag - 1.96 * sd, lag + 1.96 * sd),
            Line(own["time"].to_numpy(), own["line"].to_numpy(), "model", "drift"),
        ]
        panels.append(Panel(marks, time_axis(own), Axis("bench less device", "s"), f"run {run}"))
    blocks: list[Figure | Table] = []
    if panels:
        blocks.append(
            Figure(
                "lags", "Lag of the device's clock",
                f"Do the clocks run alike? {captions.clocks(findings.arrays['clocks'])} What the bench's clock shows more than the device's, window by window, and the line of its drift.",
                "lag between the clocks of device and bench over time with a straight line, one panel a run", panels, columns=2,
            )
        )  # fmt: skip
    rows: list[list[Cell]] = [
        [
            row["run"],
            Value(row["lag"], row["lag_sd"]) if np.isfinite(row["lag"]) else None,
            Value(row["rate"] / _PPM, row["rate_sd"] / _PPM) if np.isfinite(row["rate"]) else None,
            row["end"] if row["sure"] else None,
            Status("sure", "ok") if row["sure"] else Status("not sure", "warning"),
        ]
        for row in records(findings.arrays["clocks"])
    ]
    if rows:
        blocks.append(
            Table(
                "clocks", "Clocks of device and bench", "Lag in the middle of what both logged, and at the end; from the pulsation that both see.",
                [Column("Run"), Column("Lag at mid-run", "s"), Column("Rate, ppm"), Column("Lag at the end", "s"), Column("")], rows,
            )
        )  # fmt: skip
    return blocks
