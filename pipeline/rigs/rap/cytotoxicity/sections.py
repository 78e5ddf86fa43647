"""What the report of `rap.cytotoxicity` shows, drawn from parameters and arrays only (rap.md, 7.11)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Band,
    Cell,
    Column,
    Figure,
    Mark,
    Mood,
    Panel,
    Points,
    Rule,
    Section,
    Status,
    Table,
    Text,
    Value,
)
from pipeline.rigs.in_words import chance
from pipeline.rigs.rap.cytotoxicity import captions
from pipeline.rigs.rap.cytotoxicity.declaration import OUTCOMES
from pipeline.rigs.rap.cytotoxicity.parameters import signed

_TIME = Axis("time", "min")
_MOODS: dict[str, Mood] = {"equivalence": "ok", "inconclusive": "warning", "different": "rejected"}
# The control is drawn this share of the span beside the treated cells.
_BESIDE = 0.012


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    tables = findings.arrays
    chapters = [
        Section("equivalence", "Equivalence to the control", _equivalence(tables)),
        Section("samples", "Samples", _samples(tables)),
        Section("power", "Course over time and power of the test", _power(tables)),
    ]
    return [chapter for chapter in chapters if chapter.blocks]


def _equivalence(tables: dict[str, pd.DataFrame]) -> list[Figure | Table | Text]:
    if "outcomes" not in tables:
        return []
    blocks: list[Figure | Table | Text] = [_verdicts(tables["outcomes"])]
    if "differences" not in tables:
        return blocks
    for run, own in tables["differences"].groupby("run", sort=False):
        name = f", run {run}" if tables["differences"]["run"].nunique() > 1 else ""
        blocks += [_difference_figure(own, name), _difference_table(own, name)]
    if bool(tables["outcomes"]["exclusive"].any()):
        blocks.append(
            Text(
                [
                    "Viability, necrosis and apoptosis sum to 100 % here: the classes exclude each other, so the three rows are at most two independent outcomes."
                ]
            )
        )
    return blocks


def _verdicts(outcomes: pd.DataFrame) -> Table:
    several = outcomes["run"].nunique() > 1
    rows: list[list[Cell]] = [
        [
            *([str(row["run"])] if several else []),
            str(row["outcome"]),
            Status(str(row["verdict"]), _MOODS[str(row["verdict"])]),
            float(row["margin"]),
            _scatter(float(row["deviation"]), int(row["dof"])),
            int(row["dof"]),
            str(row["reason"]),
        ]
        for row in outcomes.to_dict("records")
    ]
    return Table(
        "verdicts",
        "Verdicts",
        f"Are the cells as well as those of the control? {captions.verdicts(outcomes)} Equivalence needs every time to pass; inconclusive is not the same as similar.",
        [
            *([Column("run")] if several else []),
            Column("outcome"),
            Column("verdict"),
            Column("margin", "%"),
            Column("scatter of cultures", "%"),
            Column("degrees of freedom"),
            Column("why"),
        ],
        rows,
    )


def _difference_figure(own: pd.DataFrame, name: str) -> Figure:
    panels = []
    for outcome in (o for o in OUTCOMES if o in set(own["outcome"])):
        part = own[own["outcome"] == outcome]
        t, margin = part["time"].to_numpy(), float(part["margin"].iloc[0])
        edge = _edges(t)
        marks: list[Mark] = [
            Band(edge, np.full(2, -margin), np.full(2, margin), "reference", "margin"),
            Rule(y=0.0),
            Points(
                t,
                part["difference"].to_numpy(),
                "measured",
                "difference, 90 %",
                part["low90"].to_numpy(),
                part["high90"].to_numpy(),
            ),
        ]
        panels.append(Panel(marks, _TIME, Axis("treated less control", "%"), outcome))
    return Figure(
        f"differences{name.replace(', run ', '_')}",
        f"Differences to the control{name}",
        f"Do all 90 % intervals lie within the margin? {captions.differences(own)} Differences in percentage points; one interval that crosses the band's edge leaves it open.",
        "difference of treated cells to the control over time with 90 % intervals and the margin of equivalence as a band",
        panels,
        columns=min(len(panels), 3),
    )


def _difference_table(own: pd.DataFrame, name: str) -> Table:
    rows: list[list[Cell]] = [
        [
            str(row["outcome"]),
            float(row["time"]),
            int(row["n_treated"]),
            int(row["n_control"]),
            Value(float(row["treated"])),
            Value(float(row["control"])),
            Value(float(row["difference"]), float(row["std_error"])),
            f"{signed(row['low90'])} to {signed(row['high90'])}",
            chance(float(row["p"])),
            Status("passes", "ok") if row["passes"] else Status("does not pass", "warning"),
        ]
        for row in own.to_dict("records")
    ]
    return Table(
        f"difference_table{name.replace(', run ', '_')}",
        f"Differences time by time{name}",
        f"Which times pass? {captions.passing(own)} The 90 % interval in percentage points and p, the larger one of the two one-sided tests; the time passes where p is below 5 %.",
        [
            Column("outcome"),
            Column("time", "min"),
            Column("n treated"),
            Column("n control"),
            Column("treated", "%"),
            Column("control", "%"),
            Column("difference", "%"),
            Column("90 % interval, points"),
            Column("p"),
            Column("test"),
        ],
        rows,
    )


def _samples(tables: dict[str, pd.DataFrame]) -> list[Figure | Table | Text]:
    if "samples" not in tables:
        return []
    figures: list[Figure | Table | Text] = []
    for run, own in tables["samples"].groupby("run", sort=False):
        name = f", run {run}" if tables["samples"]["run"].nunique() > 1 else ""
        aside = _BESIDE * max(float(own["time"].max() - own["time"].min()), 1.0)
        panels = []
        for outcome in (o for o in OUTCOMES if o in own and own[o].notna().any()):
            marks: list[Mark] = []
            for place, group in enumerate(("treated", "control")):
                part = own[(own["group"] == group) & own[outcome].notna()]
                if len(part):
                    marks.append(
                        Points(part["time"].to_numpy() + place * aside, part[outcome].to_numpy(), place, group)
                    )
                    mean = part.groupby("time")[outcome].mean()
                    if group == "control" and len(mean) == 1:
                        marks.append(Rule(y=float(mean.iloc[0])))
            panels.append(Panel(marks, _TIME, Axis("share of cells", "%"), outcome))
        figures.append(
            Figure(
                f"samples{name.replace(', run ', '_')}",
                f"Samples as counted{name}",
                f"How far do cultures scatter, and does one stand alone? {captions.scatter(tables.get('outcomes'), own, str(run))} Each culture (or mean of cultures) as logged, the control set a little aside, its mean dashed.",
                "share of viable, necrotic and apoptotic cells of each culture over time, treated and control",
                panels,
                columns=min(len(panels), 3),
            )
        )
    return figures


def _power(tables: dict[str, pd.DataFrame]) -> list[Figure | Table | Text]:
    blocks: list[Figure | Table | Text] = []
    outcomes = tables.get("outcomes")
    if outcomes is not None and outcomes["slope"].notna().any():
        blocks.append(_slopes(outcomes[outcomes["slope"].notna()]))
    designs = tables.get("power")
    if designs is not None:
        blocks.append(_designs(designs))
    return blocks


def _slopes(outcomes: pd.DataFrame) -> Table:
    rows: list[list[Cell]] = [
        [
            str(row["run"]),
            str(row["outcome"]),
            signed(3600 * row["slope"]),
            f"{signed(3600 * row['slope_low'])} to {signed(3600 * row['slope_high'])}",
            chance(row["slope_p"]),
            Status("changes", "warning") if row["slope_p"] < 0.05 else Status("no change seen"),
        ]
        for row in outcomes.to_dict("records")
    ]
    return Table(
        "slopes",
        "Change with time",
        f"Does the difference grow while the fluid goes round? {captions.slopes(outcomes)} Weighted line through the differences, in percentage points an hour; a slope that is not zero warns "
        "of longer use even where all times pass.",
        [
            Column("run"),
            Column("outcome"),
            Column("slope, points/h"),
            Column("95 % interval, points/h"),
            Column("p"),
            Column(""),
        ],
        rows,
    )


def _designs(designs: pd.DataFrame) -> Table:
    rows: list[list[Cell]] = [
        [
            str(row["run"]),
            str(row["outcome"]),
            int(row["n"]),
            round(float(row["deviation"]), 4),
            round(float(row["power"]), 3),
            "this test" if row["own"] else ("enough for 90 %" if row["needed"] else ""),
        ]
        for row in designs.to_dict("records")
    ]
    return Table(
        "power",
        "Power of the test",
        f"Could this test have shown equivalence at all? {captions.power(designs)} Probability that all times pass if there is no difference, with the scatter found.",
        [
            Column("run"),
            Column("outcome"),
            Column("cultures a group and time"),
            Column("scatter", "%"),
            Column("power", "%"),
            Column(""),
        ],
        rows,
    )


def _scatter(deviation: float, dof: int) -> Value | None:
    return Value(deviation, deviation / float(np.sqrt(2.0 * dof))) if dof else None


def _edges(t: np.ndarray) -> np.ndarray:
    span = max(float(np.ptp(t)), 60.0)
    return np.array([float(t.min()) - 0.04 * span, float(t.max()) + 0.04 * span])
