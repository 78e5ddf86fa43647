"""What the report of `mre.axial` shows of the motion: how each run was moved, and gauge beside motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings.figures import Axis, Cell, Column, Figure, Panel, Points, Rule, Table
from pipeline.rigs.mre.axial import captions

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.findings import Findings

_MOST = 100  # runs


def runs_seen(runs: pd.DataFrame) -> Table:
    """Return how each run was moved, and what it tells."""
    shown = runs.head(_MOST)
    rounded = [_three_digits(shown[name]) for name in ("residual", "nrmse", "offset")]
    rows: list[list[Cell]] = [
        [
            str(r["run"]),
            r["d_max"],
            r["rate"],
            str(r["motion"]),
            r["gauge_step"] or "fine",
            int(r["samples"]),
            round(r["effective"]),
            *numbers,
        ]
        for r, *numbers in zip(shown.to_dict("records"), *rounded, strict=True)
    ]
    return Table(
        "motion",
        "What was seen of each run",
        f"How was the pad moved, and how much does each run tell? {captions.motion(runs)} Motion between the gauge's steps as its passages ask for; samples that "
        "count: how many independent ones the residual amounts to. Residual: rms, also over that of the force; F_off: offset of the force, taken off.",
        [
            Column("run"),
            Column("d_max", "m"),
            Column("rate", "m/s"),
            Column("motion"),
            Column("gauge step", "m"),
            Column("samples"),
            Column("that count"),
            Column("residual", "N"),
            Column("over force", "%"),
            Column("F_off", "N"),
        ],
        rows,
    )


def _three_digits(values: pd.Series) -> list[float]:
    """Round to the third digit of the largest number, so that a column is as exact everywhere."""
    most = float(values.abs().max())
    decimals = 2 - math.floor(math.log10(most)) if most > 0.0 and math.isfinite(most) else 3
    return [round(float(value), decimals) for value in values]


def gauge(findings: Findings) -> list[Figure]:
    """Return the reading of the first coarse gauge beside the fitted motion; nothing where no gauge is coarse."""
    runs, samples = findings.arrays["runs"], findings.arrays["samples"]
    coarse = runs[(runs["gauge_step"] > 0) & (runs["motion"] != "not smooth")]
    if coarse.empty:
        return []
    row = coarse.iloc[0]
    part = samples[samples["run"] == row["run"]]
    off = part["reading"].to_numpy(float) - part["displacement"].to_numpy(float)
    # The motion counts from first contact; the reading has a zero of its own.
    off = off - np.nanmedian(off)
    time = part["time"].to_numpy(float)
    return [
        Figure(
            "gauge",
            "Gauge and motion",
            f"Is the motion between the gauge's steps right? {captions.between_steps(off, row['gauge_step'], str(row['run']))}",
            "reading of the gauge less the fitted motion over time",
            [
                Panel(
                    [
                        Points(time, off, "residual"),
                        Rule(y=row["gauge_step"] / 2),
                        Rule(y=-row["gauge_step"] / 2),
                    ],
                    Axis("time", "s"),
                    Axis("reading less motion", "m"),
                )
            ],
        )
    ]
