"""Figures on the waveform of a drive: dips over the longitudinal force, bonding, the road's noise."""

from __future__ import annotations

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Band, Figure, Line, Mark, Panel, Points, Rule, Text
from pipeline.rigs.tire.road import captions
from pipeline.rigs.tire.road.sections_tracks import FORCE, TIME, extremes, of_run, rows_of

_ANGLE, _VOLT, _LEFT = Axis("angle", "rad"), Axis("flex voltage less its mean", "V"), Axis("residual", "V")
_OHM = Axis("trailing less leading dip A", "ohm")


def dips(findings: Findings) -> list[Figure]:
    """Return the asymmetry of the dips over the longitudinal force."""
    panels, told = [], []
    for run in findings.arrays["drives"]["run"]:
        table = of_run(findings.arrays["asymmetry"], str(run))
        table = table[np.isfinite(table["force"])]
        if table.empty:
            continue
        model = of_run(findings.arrays["asymmetry_model"], str(run))
        told.append(captions.deepened(table, model))
        words = "Fx of the reference channel" if bool(table["reference"].iloc[0]) else "Fx of the fit"
        marks: list[Mark] = [
            Points(table["force"].to_numpy(), table["asymmetry"].to_numpy(), "measured", "one revolution")
        ]
        if len(model):
            marks.append(Line(model["force"].to_numpy(), model["asymmetry"].to_numpy(), "model", "ring of the bench"))
        panels.append(Panel(marks, Axis(words, FORCE.unit), _OHM, f"run {run}"))
    if not panels:
        return []
    return [
        Figure(
            "dips",
            "Dips over the longitudinal force",
            f"Does driving deepen the leading dip as the ring says? {' '.join(told)} At Fx = 0 A is not zero, because hysteresis makes "
            "free rolling unsymmetric. The line is the bench's ring at the median load: nothing is fitted here.",
            "difference of the two dips over the longitudinal force, measured and by the ring model",
            panels,
            columns=2 if len(panels) > 1 else 1,
        )
    ]


def residuals(findings: Findings) -> list[Figure]:
    """Return what the bench's ring leaves of the mean waveform."""
    panels, told = [], []
    for run in findings.arrays["drives"]["run"]:
        table = of_run(findings.arrays["misfit_by_angle"], str(run))
        if table.empty:
            continue
        angle, left, error, signal = (table[name].to_numpy() for name in ("angle", "residual", "std_error", "signal"))
        told.append(captions.fits_ring(table))
        waveform = Panel([Line(angle, signal, "measured")], _ANGLE, _VOLT, f"run {run}: waveform")
        marks: list[Mark] = [
            Band(angle, -2.0 * error, 2.0 * error, "model", "±2 standard errors of the mean"),
            Line(angle, left, "residual"),
            Rule(y=0.0),
        ]
        panels += [waveform, Panel(marks, _ANGLE, _LEFT, f"run {run}: residual")]
    if not panels:
        return []
    return [
        Figure(
            "misfit_by_angle",
            "Waveform against the bench's ring",
            f"Is the waveform that of the bench's ring? {' '.join(told)} Mean of what the fits leave over, by angle from the peak. What stays outside of the band is a shape that the ring of the "
            "bench does not have: another tire, pressure or sensor, and the errors of load and force grow by it.",
            "mean voltage by angle, and what the ring leaves over of it with the band that noise explains",
            panels,
            columns=2,
        )
    ]


def bonding(findings: Findings) -> list[Figure | Text]:
    """Return the flex sensor's answer over the film's along each drive."""
    panels = []
    for run in findings.arrays["drives"]["run"]:
        table = of_run(findings.arrays["evidence"], str(run))
        table = table[np.isfinite(table["film_ratio"])]
        if table.empty:
            continue
        table = table.iloc[extremes(table["film_ratio"].to_numpy())]
        marks: list[Mark] = [
            Points(table["time"].to_numpy(), table["film_ratio"].to_numpy(), "measured"),
            Rule(y=1.0),
        ]
        panels.append(Panel(marks, TIME, Axis("flex over PVDF, relative", "1"), f"run {run}"))
    told = captions.bonded(rows_of(findings.arrays["drives"]))
    if not panels:
        return [Text([told])]
    return [
        Figure(
            "bonding",
            "Flex sensor against PVDF film",
            f"Is the sensor still bonded? {told} Dots are revolutions. Both see the same bending. A sensor that comes off answers less while the film does not: the ratio steps.",
            "ratio of the amplitudes of flex sensor and PVDF film over time",
            panels,
            columns=2 if len(panels) > 1 else 1,
        ),
    ]


def spectra(findings: Findings) -> list[Figure]:
    """Return the noise that weighs the orders of a revolution."""
    noise = findings.arrays["noise"]
    marks: list[Mark] = []
    for place, run in enumerate(findings.arrays["drives"]["run"]):
        table = of_run(noise, str(run))
        if len(table):
            frequency, density = table["frequency"].to_numpy(), table["density"].to_numpy()
            marks.append(Line(frequency, np.sqrt(density), place, f"run {run}"))
    if not marks:
        return []
    return [
        Figure(
            "noise",
            "Noise of the flex channel on the road",
            f"Is the road's noise white? {captions.white(noise)} What the fits leave over, by frequency: it weighs the orders of each revolution, so that standard errors hold under "
            "coloured road noise.",
            "amplitude density of the noise of the flex voltage over frequency",
            [Panel(marks, Axis("frequency", "Hz", "log"), Axis("noise density", "V/Hz^0.5", "log"))],
        )
    ]
