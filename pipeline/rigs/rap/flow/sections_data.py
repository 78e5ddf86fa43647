"""Set-points with the paper's arithmetic, how frequency and amplitude were found, and what each run gave."""

from __future__ import annotations

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Points, Table, Text
from pipeline.rigs.rap.flow import captions
from pipeline.rigs.rap.flow.paper import SET_POINTS, UF_RATE, WORST_ERROR
from pipeline.rigs.rap.flow.sections_errors import Blocks, roles
from pipeline.rigs.rap.therapy.outcome.paper import set_point_notes

_ML_MIN = 1e-6 / 60.0
_SHOWN = 3
# So much of a window is drawn, s.
_DRAWN = 5.0


def of_set_points(findings: Findings) -> Blocks:
    """Return what the paper's numbers mean at the set-points used (rap.md, section 4 rows 4 to 6)."""
    windows = findings.arrays["windows"]
    if windows.empty:
        return []
    levels = sorted({round(float(level) / _ML_MIN, 1) for level in windows["flow_set"].dropna()})
    uf = float(windows["uf"].max())
    shares = ", ".join(f"{WORST_ERROR * q / _ML_MIN:.2f} of {q / _ML_MIN:g}" for q in SET_POINTS)
    on_return = ", ".join(f"{100 * UF_RATE / q:.2f} % of {q / _ML_MIN:g}" for q in SET_POINTS)
    notes = set_point_notes(max(levels) * _ML_MIN if levels else None, uf if uf > 0.0 else UF_RATE, None)
    return [
        Text([
            f"Set-points of these runs: {', '.join(f'{level:g}' for level in levels) or 'not logged'} mL/min"
            + (f", ultrafiltration up to {uf / _ML_MIN:.3g} mL/min." if uf > 0.0 else ", ultrafiltration off or not logged."),
            f"The paper's worst error of {100 * WORST_ERROR:.2f} % is {shares} mL/min. A meter on the return line makes {on_return} mL/min by 5 mL/min of "
            "ultrafiltration alone; the paper does not state where its meter sat, so its 9.12 % cannot be interpreted.",
            *notes,
        ])
    ]  # fmt: skip


def of_windows(findings: Findings) -> Blocks:
    """Return 10 s of pulsation with its fit, and frequency and amplitude over time."""
    blocks: Blocks = []
    example, fit = findings.arrays["example"], findings.arrays["example_fit"]
    panels = []
    for level in list(dict.fromkeys(example["flow_set"]))[:_SHOWN]:
        rows, line = (table[table["flow_set"] == level] if np.isfinite(level) else table for table in (example, fit))
        rows, line = (table[table["time"] < _DRAWN] for table in (rows, line))
        marks: list[Mark] = [
            Points(rows["time"].to_numpy(), rows["measured"].to_numpy(), "measured", "samples"),
            Line(line["time"].to_numpy(), line["fitted"].to_numpy(), "model", "mean, trend, harmonics 1 to 3"),
        ]
        title = f"{level / _ML_MIN:.3g} mL/min" if np.isfinite(level) else "set-point not logged"
        panels.append(Panel(marks, Axis("time in the window", "s"), Axis("pressure", "mmHg"), title))
    if panels:
        blocks.append(
            Figure(
                "example", "A window of pulsation",
                f"Is the roller's line the one that is fitted? {captions.fitted(example, fit)} The frequency is that of the least residual near the periodogram's peak; what is left holds the rollers' "
                "differences, at a third of it. The first 5 s of a window are drawn.",
                "five seconds of pressure with the harmonic fit at each set-point", panels, columns=len(panels),
            )
        )  # fmt: skip
    windows = findings.arrays["windows"]
    if not windows.empty:
        blocks.append(_course(findings))
    return blocks


def _course(findings: Findings) -> Figure:
    windows = findings.arrays["windows"]
    frequency: list[Mark] = []
    amplitude: list[Mark] = []
    for name, role in roles(windows).items():
        rows = windows[windows["group"] == name]
        half = 1.96 * rows["frequency_error"].fillna(0.0).to_numpy()
        f = rows["frequency"].to_numpy()
        frequency.append(Points(rows["back_pressure"].to_numpy(), f, role, name, f - half, f + half))
        if rows["amplitude"].notna().any():
            amplitude.append(Points(rows["back_pressure"].to_numpy(), rows["amplitude"].to_numpy(), role, name))
    x = Axis("mean back pressure", "mmHg")
    panels = [Panel(frequency, x, Axis("roller passages", "Hz"), "frequency")]
    if amplitude:
        panels.append(Panel(amplitude, x, Axis("pulsation A₁", "mmHg"), "pulsation"))
    return Figure(
        "plane", "Where the windows lie",
        f"Do the runs exercise what the estimators need? {captions.spans(windows)} E2 needs pulsations that differ at one frequency, E3 back pressures that differ: clamping the access line gives both.",
        "frequency and amplitude of the pulsation over back pressure, every window", panels, columns=2,
    )  # fmt: skip


def of_runs(findings: Findings) -> Blocks:
    """Return what each run gave: windows, zeros, clock of the meter."""
    table = findings.arrays["runs"]
    if table.empty:
        return []
    rows: list[list[Cell]] = []
    for row in table.to_dict("records"):
        lost = (
            ", ".join(f"{row[state]} {state}" for state in ("stopped", "unsteady", "jump", "lost") if row[state])
            or "none"
        )
        zeros: list[Cell] = [
            round(float(row[key]) / step) * step if np.isfinite(row[key]) else None
            for key, step in (("zero_prefilter", 0.1), ("zero_access", 0.1), ("meter_zero", 0.01 * _ML_MIN))
        ]
        rows.append([
            str(row["run"]), str(row["group"]), str(row["tube"]), str(row["clamp"]), int(row["windows"]), lost, *zeros,
            round(float(row["lag"]), 3) if np.isfinite(row["lag"]) else None, str(row["clock"]),
        ])  # fmt: skip
    return [
        Table(
            "runs", "Runs",
            "Windows lie clear of starts, steps of set-points and clamp changes. Zeros are what the sensors read while the pump stands; those of the pressures are taken off, "
            "that of the meter only where it is clearly off. The lag takes the device's clock to the meter's.",
            [Column("run"), Column("set"), Column("tube"), Column("clamp"), Column("windows"), Column("left out"), Column("zero pre-filter", "Pa"),
             Column("zero access", "Pa"), Column("zero meter", "mL/min"), Column("lag", "s"), Column("clocks aligned by")], rows,
        )
    ]  # fmt: skip
