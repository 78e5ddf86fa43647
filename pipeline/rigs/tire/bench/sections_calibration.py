"""Peak over load with its prediction band, and surface speed over rotation."""

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
    Text,
    Value,
)
from pipeline.rigs.tire.bench import captions
from pipeline.rigs.tire.bench.paper import G0, SENSITIVITY
from pipeline.rigs.tire.bench.sections_waveform import Blocks

if TYPE_CHECKING:
    import pandas as pd

_LOAD, _PEAK = Axis("load", "N"), Axis("peak over the mean", "ohm")


def _one(findings: Findings, name: str) -> Parameter | None:
    return next(iter(findings.find(name)), None)


def of_calibration(findings: Findings) -> Blocks:
    """Return the calibration with its band, what it leaves, and the sensitivity in three units."""
    points, curve = findings.arrays["calibration"], findings.arrays["calibration_curve"]
    if points.empty:
        return []
    used, unused = points[points["used"]], points[~points["used"]]
    marks: list[Mark] = []
    rest: list[Mark] = [Rule(y=0.0)]
    volts: list[Mark] = []
    if not curve.empty:
        x = curve["load"].to_numpy()
        marks += [
            Band(x, curve["low"].to_numpy(), curve["high"].to_numpy(), "model", "95 % of one revolution"),
            Line(x, curve["peak"].to_numpy(), "model", "quadratic"),
        ]
        volts.append(Line(x, curve["voltage"].to_numpy(), "model", "quadratic in R₂"))
        middle = float(np.median(x))
        at_middle = float(np.interp(middle, x, curve["voltage"].to_numpy()))
        volts.append(Line(x, at_middle + SENSITIVITY * (x - middle), "reference", "70 mV per 50 kg", dashed=True))
    shown: tuple[tuple[pd.DataFrame, Role, str], ...] = (
        (used, "measured", "runs"),
        (unused, "fault", "not in the calibration"),
    )
    for rows, role, label in shown:
        if rows.empty:
            continue
        load, peak, half = rows["load"].to_numpy(), rows["peak"].to_numpy(), 1.96 * rows["peak_sd"].to_numpy()
        reach = 1.96 * rows["load_sd"].to_numpy()
        marks.append(Points(load, peak, role, label, peak - half, peak + half, left=load - reach, right=load + reach))
        volts.append(Points(load, rows["voltage"].to_numpy(), role, label))
        if rows["residual"].notna().any() and role == "measured":
            left = rows["residual"].to_numpy()
            rest.append(Points(load, left, "residual", "", left - half, left + half))
    panels = [Panel(marks, _LOAD, _PEAK, "resistance"), Panel(volts, _LOAD, Axis("peak over rest", "V"), "voltage")]
    if len(rest) > 1:
        panels.append(Panel(rest, _LOAD, Axis("residual", "ohm"), "measured less quadratic"))
    figure = Figure(
        "calibration", "Peak of the waveform over load",
        f"How much does a newton raise the peak? {captions.slope(findings, points)} The band holds 95 % of the peaks of single revolutions; loads are read off it by inverting it "
        "(Fieller), not by regressing load on peak. The paper's line has its slope only: its height is lost.",
        "peak over load with the quadratic calibration, in ohm and in volts, and residuals", panels, columns=2,
    )  # fmt: skip
    return [*_validity(findings), figure, *_sensitivity(findings), *_read_back(findings)]


def _validity(findings: Findings) -> Blocks:
    fit = findings.arrays["fit"].iloc[0]
    if not np.isfinite(fit["least_load"]):
        return []
    pressure = (
        f"at p0 = {1e-3 * fit['p0']:.0f} kPa"
        if np.isfinite(fit["p0"])
        else "at an inflation pressure that no run states"
    )
    return [
        Text([
            f"The calibration holds from {fit['least_load']:.0f} to {fit['most_load']:.0f} N, {pressure}; beyond is extrapolation. Peak heights go "
            "with the pressure's power of about -0.6: 10 % less pressure reads as about 7 % more load."
        ])
    ]  # fmt: skip


def _sensitivity(findings: Findings) -> Blocks:
    found = _one(findings, "load_sensitivity")
    if found is None or found.value is None:
        return []
    value, sd = found.value, found.std_error or 0.0
    rows: list[list[Cell]] = [
        ["µV/N", Value(1e6 * value, 1e6 * sd), round(1e6 * SENSITIVITY)],
        ["mV per 50 kg", Value(value * 50e3 * G0, sd * 50e3 * G0), round(SENSITIVITY * 50e3 * G0)],
        ["N/V", Value(1.0 / value, sd / value**2), round(1.0 / SENSITIVITY, -1)],
    ]
    return [
        Table(
            "sensitivity", "Sensitivity at mid-range",
            f"{captions.beside_paper(value)} Slope of the peak's voltage over load in the middle of the loads, from the quadratic in R₂.",
            [Column("in"), Column("found"), Column("paper, \"in the order of\"")], rows,
        )
    ]  # fmt: skip


def _read_back(findings: Findings) -> Blocks:
    points = findings.arrays["calibration"]
    known = points[points["read_load"].notna()]
    if known.empty:
        return []
    rows: list[list[Cell]] = [
        [
            str(row["run"]), float(row["load"]), Value(float(row["read_load"]), None, (float(row["read_low"]), float(row["read_high"]))),
            round(float(row["read_load"] - row["load"]), 1), "yes" if row["used"] else "no",
        ]
        for row in known.to_dict("records")
    ]  # fmt: skip
    return [
        Table(
            "read_back", "Loads read off the calibration",
            f"{captions.read_back(known)} The load that each run's mean peak stands for, with its 95 % interval (Fieller), beside the load cell.",
            [Column("run"), Column("load", "N"), Column("load read off", "N"), Column("difference", "N"), Column("in the calibration")], rows,
        )
    ]  # fmt: skip


def of_speed(findings: Findings) -> Blocks:
    """Return surface speed over rotation with the line through the origin."""
    table = findings.arrays["speed"]
    radius = _one(findings, "rolling_radius")
    if table.empty or radius is None or radius.value is None:
        return []
    fit = findings.arrays["fit"].iloc[0]
    Re, sd = radius.value, radius.std_error or 0.0
    x = np.array([0.0, 1.08 * float(table["rotation"].max())])
    marks: list[Mark] = [Line(x, Re * x, "model", f"V = Re Ω, Re = {1e3 * Re:.2f} mm")]
    if np.isfinite(fit["Ro"]):
        marks.append(Line(x, fit["Ro"] * x, "reference", f"nominal radius {1e3 * fit['Ro']:.1f} mm", dashed=True))
    used = table[table["used"]]
    marks.append(Points(used["rotation"].to_numpy(), used["speed"].to_numpy(), "measured", "runs"))
    others = table[~table["used"]]
    if len(others):
        marks.append(Points(others["rotation"].to_numpy(), others["speed"].to_numpy(), "fault", "left out"))
    ratio, half = used["radius"].to_numpy(), 1.96 * used["radius_sd"].to_numpy()
    w = used["rotation"].to_numpy()
    ends = np.array([0.95 * w.min(), 1.05 * w.max()])
    radii: list[Mark] = [
        Band(ends, np.full(2, Re - 1.96 * sd), np.full(2, Re + 1.96 * sd), "model", "Re, 95 %"),
        Rule(y=Re, role="model"),
        Points(w, ratio, "residual", "V/Ω of a run", ratio - half, ratio + half),
    ]
    return [
        Figure(
            "speed_line", "Surface speed over rotation",
            f"On which radius does the tire roll? {captions.rolls(findings, radius)}",
            "surface speed over rotation with a line through the origin, and the radius of each run",
            [
                Panel(marks, Axis("rotation", "rad/s"), Axis("surface speed", "km/h"), "speed line"),
                Panel(radii, Axis("rotation", "rad/s"), Axis("V/Ω", "m"), "what it leaves: radius of each run"),
            ],
            columns=2,
        )
    ]  # fmt: skip
