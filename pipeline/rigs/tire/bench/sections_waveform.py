"""Waveforms with the ring fit, the lengths side by side, revolutions one above the other."""

from __future__ import annotations

import math
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
    Text,
    Value,
)
from pipeline.rigs.tire.bench import captions

if TYPE_CHECKING:
    import pandas as pd

Blocks = list[Figure | Table | Text]
ANGLE = Axis("angle from the peak", "rad")
_CHANGE = Axis("R₂ less its mean", "ohm")
# Of a turn, what is drawn: the rest is flat.
_REACH = 0.5 * math.pi
_RUNS, _REVOLUTIONS = 8, 14


def shown_runs(findings: Findings, most: int = _RUNS) -> list[str]:
    """Return the runs that figures show."""
    return [str(run) for run in findings.arrays["runs"]["run"]][:most]


def of_run(table: pd.DataFrame, run: str) -> pd.DataFrame:
    """Return the rows of one run."""
    return table[table["run"] == run]


def title_of(findings: Findings, run: str) -> str:
    """Return a run's name with its load and speed."""
    row = of_run(findings.arrays["runs"], run).iloc[0]
    load = f"{row['load']:.0f} N" if math.isfinite(row["load"]) else "unknown load"
    return f"{run}: {load}, {3.6 * row['speed']:.3g} km/h"


def shown(parameter: Parameter | None) -> Value:
    """Return a parameter as a cell."""
    return Value(parameter.value, parameter.std_error, parameter.ci95) if parameter is not None else Value(None)


def of_waveforms(findings: Findings) -> Blocks:
    """Return the averaged waveforms with fit and residual, and one of them as curvature and voltage."""
    table, marks = findings.arrays["waveforms"], findings.arrays["marks"]
    panels: list[Panel] = []
    for run in shown_runs(findings):
        own = of_run(table, run)
        own = own[own["angle"].abs() <= _REACH]
        x, y, sd = (own[name].to_numpy() for name in ("angle", "change", "std_error"))
        drawn: list[Mark] = [Band(x, y - 2 * sd, y + 2 * sd, "measured"), Line(x, y, "measured", "measured")]
        rest: list[Mark] = [Band(x, -2 * sd, 2 * sd, "measured", "±2 standard errors"), Rule(y=0.0)]
        if own["model"].notna().any():
            drawn.append(Line(x, own["model"].to_numpy(), "model", "ring fit", dashed=True))
            rest.append(Line(x, y - own["model"].to_numpy(), "residual", "measured less fit"))
        drawn += _marks_of(of_run(marks, run))
        panels.append(Panel(drawn, ANGLE, _CHANGE, title_of(findings, run)))
        if own["model"].notna().any():
            panels.append(Panel(rest, ANGLE, Axis("residual", "ohm"), f"{run}: what the fit leaves"))
    if not panels:
        return []
    fitted = len(panels) > len(shown_runs(findings))
    figure = Figure(
        "waveforms",
        "Averaged waveforms",
        f"Does the ring explain what the sensor sees? {captions.explained(findings)} Mean over the revolutions with ±2 standard errors"
        f"{', the joint ring fit, and what it leaves on its right' if fitted else ''}. The leading dip is on the left. Dashed rules: edges of the "
        "contact by the fit; marks: dips and, on the flanks, the extreme slopes.",
        "resistance over angle for each run with the ring fit and the residual",
        panels,
        columns=2,
    )
    return [figure, *_three_units(findings)]


def _marks_of(rows: pd.DataFrame) -> list[Mark]:
    found: list[Mark] = []
    kinds: tuple[tuple[str, Role], ...] = (("dip", "reference"), ("slope", 2))
    for kind, role in kinds:
        own = rows[rows["kind"] == kind]
        if len(own):
            label = {"dip": "dips", "slope": "extreme slopes"}[kind]
            found.append(Points(own["angle"].to_numpy(), own["change"].to_numpy(), role, label))
    found += [Rule(x=float(angle), role="model") for angle in rows[rows["kind"] == "contact"]["angle"]]
    return found


def _three_units(findings: Findings) -> Blocks:
    """Show one run as k and V: the divider compresses the peak."""
    table = findings.arrays["waveforms"]
    runs = findings.arrays["runs"]
    if runs.empty:
        return []
    run = str(runs.iloc[int(runs["load"].rank(na_option="bottom").argsort().iloc[len(runs) // 2])]["run"])
    own = of_run(table, run)
    own = own[own["angle"].abs() <= _REACH]
    x = own["angle"].to_numpy()
    panels = [
        Panel([Line(x, own["voltage"].to_numpy(), "measured")], ANGLE, Axis("divider voltage", "V"), f"{run}: voltage")
    ]
    if own["curvature"].notna().any():
        panels.append(
            Panel(
                [Line(x, own["curvature"].to_numpy(), "measured"), Rule(y=0.0)], ANGLE, Axis("k = 1/R - κ", "1/m"), f"{run}: curvature",
            )
        )  # fmt: skip
    return [
        Figure(
            "three_units",
            "The same waveform as voltage and as curvature",
            f"What does the sensor measure? {captions.curved(own['curvature'].to_numpy(dtype=float), float(findings.arrays['fit']['R'].iloc[0]))} It is negative where the belt bends more beside the "
            "patch. The divider compresses peaks in volts, so that all numbers here are worked out in resistance.",
            "one averaged waveform in volts and as change of curvature",
            panels,
            columns=2,
        )
    ]


def of_lengths(findings: Findings) -> Blocks:
    """Return the lengths side by side, with the sentence which is which."""
    points = list(
        dict.fromkeys((float(p.at["load"]), float(p.at["speed"])) for p in findings.find("deformation_length"))
    )
    rows: list[list[Cell]] = []
    for load, speed in points:
        by = {name: _at(findings, name, load, speed) for name in captions.LENGTHS}
        contact, bent = by["contact_length"], by["deformation_length"]
        rows.append([load, speed, *(shown(by[name]) for name in captions.LENGTHS), _over(bent, contact)])
    if not rows:
        return []
    length = findings.arrays["fit"]["sensor_length"].iloc[0]
    told = f", here {1e3 * length:.3g} mm," if math.isfinite(length) else ""
    return [
        Text([
            "Which length is which, never to be confused: the contact length Lc is where the road presses, and only the ring fit gives it. The "
            "deformation length Ld is the distance between the two dips: the span over which the belt is bent, several times Lc and hardly "
            f"dependent on load. The slope length, between the steepest flanks, is pinned at the length of the sensor{told} wherever that is longer "
            "than the contact. The zero length lies between the zero crossings of k. None of these three is a contact length."
        ]),
        Table(
            "lengths", "Contact, deformation, slope and zero length by load and speed",
            f"{captions.ratio([row[-1] for row in rows if isinstance(row[-1], float)])} Lc from the ring fit; the others read off the averaged waveform.",
            [Column("load as set", "N"), Column("speed as set", "km/h"), Column("contact Lc", "m"), Column("dip to dip Ld", "m"),
             Column("slope length", "m"), Column("zero length", "m"), Column("Ld/Lc")],
            rows,
        ),
        *_length_figure(findings, points),
    ]  # fmt: skip


def _over(above: Parameter | None, below: Parameter | None) -> float | None:
    """Return the ratio of two lengths, to what their errors warrant."""
    if above is None or below is None or not above.value or not below.value:
        return None
    return round(above.value / below.value, 2)


def _at(findings: Findings, name: str, load: float, speed: float) -> Parameter | None:
    return next(iter(findings.find(name, load=load, speed=speed)), None)


def _length_figure(findings: Findings, points: list[tuple[float, float]]) -> Blocks:
    if len({load for load, _ in points}) < 2:
        return []
    marks: list[Mark] = []
    for number, (name, label) in enumerate(captions.LENGTHS.items()):
        found = [
            p for load, speed in points if (p := _at(findings, name, load, speed)) is not None and p.value is not None
        ]
        if not found:
            continue
        x = np.array([float(p.at["load"]) for p in found])
        y = np.array([p.value for p in found], dtype=float)
        low, high = (np.array([p.ci95[k] if p.ci95 else p.value for p in found], dtype=float) for k in (0, 1))
        marks.append(Points(x, y, number, label, low, high))
    return [
        Figure(
            "lengths_over_load", "Lengths over load",
            f"Which of the lengths follows the load? {captions.grown(findings)} The contact length is the road's; the others are set by the ring's bending length and "
            "by the sensor.",
            "four lengths over load", [Panel(marks, Axis("load", "N"), Axis("length", "m"))],
        )
    ]  # fmt: skip


def of_revolutions(findings: Findings) -> Blocks:
    """Return waterfalls: revolution above revolution, lost samples in grey."""
    table = findings.arrays["waterfall"]
    panels = []
    for run in shown_runs(findings):
        own = of_run(table, run)
        numbers = sorted(own["revolution"].unique())[:_REVOLUTIONS]
        if not numbers:
            continue
        step = 0.35 * float(np.nanmax(own["change"].to_numpy()) - np.nanmin(own["change"].to_numpy()))
        marks: list[Mark] = []
        for place, number in enumerate(numbers):
            rows = own[own["revolution"] == number]
            x, y = rows["angle"].to_numpy(), rows["change"].to_numpy() + place * step
            lost = ~np.isfinite(y)
            if lost.any() and not lost.all():
                bridge = np.interp(x, x[~lost], y[~lost])
                near = lost | np.roll(lost, 1) | np.roll(lost, -1)
                marks.append(
                    Line(
                        x,
                        np.where(near, bridge, np.nan),
                        "reference",
                        "lost",
                    )
                )
            marks.append(Line(x, y, "measured"))
        panels.append(Panel(marks, ANGLE, Axis("R₂ less its mean, set apart", "ohm"), title_of(findings, run)))
    if not panels:
        return []
    return [
        Figure(
            "waterfall", "Revolution above revolution",
            f"Is every passage like the other? {captions.alike(findings.arrays['revolutions'])} The first {_REVOLUTIONS} revolutions of each run from the bottom up, each set off from the one below; "
            "stretches in grey were lost by the radio and bridged for the eye only.",
            "resistance over angle, one line a revolution", panels, columns=2,
        )
    ]  # fmt: skip
