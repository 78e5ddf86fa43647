"""The circuit: resistances over flow, harmonic ratio of the filter, ultrafiltration (rap.md, section 7, item 7; set-points with notes)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Panel,
    Points,
    Rule,
    Status,
    Table,
    Text,
)
from pipeline.rigs.rap.pressures import captions
from pipeline.rigs.rap.pressures.declaration import MMHG, PARAMETERS
from pipeline.rigs.rap.pressures.paper import ML_MIN
from pipeline.rigs.rap.pressures.sections_alignment import Blocks, by_run, of_run
from pipeline.rigs.rap.therapy.outcome.paper import set_point_notes

if TYPE_CHECKING:
    import pandas as pd

_NAMES = ("r_access", "r_filter", "r_return", "c_return", "l_return", "c_uf", "k_uf")
_SYMBOLS = {"r_access": "Rₐ", "r_filter": "Rf", "r_return": "Rᵣ", "c_return": "C₂", "l_return": "Lᵣ", "c_uf": "Cᵤ", "k_uf": "Kuf"}  # fmt: skip
_LINES = {"r_access": "access: suction over flow", "r_filter": "filter: drop over mean flow", "r_return": "return: pressure over flow", "k_uf": "membrane: UF rate over TMP"}  # fmt: skip
# Pa s/m3 in 1 mmHg/(mL/min); m3/(s Pa) in 1 mL/h/mmHg (rap.md, section 1).
_R_UNIT, _K_UNIT = 7.9993e9, captions.K_UNIT
_HIDDEN = {"c_1": "C₁", "c_access": "Cₐ", "l_access": "Lₐ"}
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SPECS = {spec.name: spec for spec in PARAMETERS}


def of_set_points(findings: Findings) -> Blocks:
    """Return the set-points used with means of the pressures, and what the paper's numbers mean there (rows 4 and 6)."""
    blocks: Blocks = []
    for run, rows in by_run(findings.arrays["levels"]):
        always = bool(rows["turning"].all())
        cells: list[list[Cell]] = [
            [
                *([] if always else ["on" if r["turning"] else "off"]), _number(r["flow_set"]), _number(r["flow"], 0.01 * ML_MIN), _number(r["uf_set"]), _number(r["frequency"], 1e-3),
                *(_number(r[tap], 0.01 * MMHG) for tap in ("access", "prefilter", "return", "uf", "tmp")), float(round(r["end"] - r["start"])),
            ]
            for r in rows.to_dict("records")
        ]  # fmt: skip
        columns = [
            *([] if always else [Column("pump")]), Column("blood flow set", "mL/min"), Column("blood flow used", "mL/min"), Column("UF set", "mL/min"), Column("strokes", "Hz"),
            *(Column(name, "mmHg") for name in ("access", "pre-filter", "return", "UF", "TMP")), Column("steady for", "s"),
        ]  # fmt: skip
        blocks.append(
            Table(
                f"levels_{run}", f"Set-points and mean pressures{of_run(findings, run)}",
                f"Means over the steady part of each step, from {_told_source(rows)}, zero at the pump stop taken off. TMP = (pre-filter + return)/2 - UF does not depend on "
                "the blood flow.",
                columns, cells,
            )
        )  # fmt: skip
        blood, uf, heparin = (_largest(rows, name) for name in ("flow_set", "uf_set", "heparin_set"))
        blocks.append(Text(set_point_notes(blood, uf, heparin)))
    return blocks


def _told_source(rows: pd.DataFrame) -> str:
    return str(rows["source"].iloc[0])


def _number(value: float, step: float = 0.0) -> float | None:
    """Return a number for a table, rounded to `step`; None where there is none."""
    if value is None or not np.isfinite(value):
        return None
    return round(float(value) / step) * step + 0.0 if step else float(value)


def _largest(rows: pd.DataFrame, name: str) -> float | None:
    known = rows[name].dropna()
    return float(known.max()) if len(known) else None


def of_hydraulics(findings: Findings) -> Blocks:
    """Return the table of R, C, L, K, the lines through the origin, the Bode plot of the filter, the UF steps."""
    return [*_table(findings), *_means(findings), *_bode(findings), *_tmp(findings), *_unobservable(findings)]


def _table(findings: Findings) -> Blocks:
    rows: list[list[Cell]] = []
    for parameter in findings.parameters:
        if parameter.name not in _NAMES:
            continue
        other = {"Pa s/m^3": (_R_UNIT, "mmHg/(mL/min)"), "m^3/(s Pa)": (_K_UNIT, "mL/(h mmHg)")}.get(parameter.unit)
        reading = ""
        if other is not None and parameter.value is not None and parameter.std_error:
            reading = _spelt(parameter.value / other[0], parameter.std_error / other[0], other[1])
        value = parameter.value
        rows.append([
            str(parameter.at.get("run", "")), _SYMBOLS[parameter.name], _SPECS[parameter.name].description,
            _in_si(value, parameter.ci95, parameter.unit), reading,
            "–" if value is None or not parameter.std_error else f"{100 * parameter.std_error / abs(value):.2g} %",
            Status("told", "ok") if value is not None else Status("not told", "warning"), parameter.description if value is None else "",
        ])  # fmt: skip
    if not rows:
        return []
    several = any(row[0] for row in rows)
    columns = [Column("run"), Column(""), Column("what"), Column("value, 95 %"), Column("in clinical units"), Column("standard error"), Column(""), Column("why not")]  # fmt: skip
    kept = [k for k in range(len(columns)) if (k or several) and (k != 7 or any(row[7] for row in rows))]
    return [
        Table(
            "hydraulics", "Resistances, compliance, inertance, membrane",
            "All are ratios of pressures to flow: an error of the flow's gain is an error of all of them (R and L fall, C and K rise). Standard errors hold the scatter of the "
            "data and, where the run states them, the gains of flow meter and pressure reference (type B).",
            [columns[k] for k in kept], [[row[k] for k in kept] for row in rows],
        )
    ]  # fmt: skip


def _in_si(value: float | None, ci95: tuple[float, float] | None, unit: str) -> str:
    if value is None:
        return "–"
    half = 0.5 * (ci95[1] - ci95[0]) if ci95 is not None else 0.0
    power = math.floor(math.log10(abs(value)))
    scale = 10.0**power
    digits = max(0, 1 - math.floor(math.log10(half / scale))) if half > 0.0 else 3
    exponent = str(power).translate(_SUPERSCRIPT)
    return f"({value / scale:.{digits}f} ± {half / scale:.{digits}f})·10{exponent} {unit.replace('^3', '³').replace('^2', '²')}"


def _spelt(value: float, sd: float, unit: str) -> str:
    digits = max(0, 1 - math.floor(math.log10(sd)))
    return f"{value:.{digits}f} ± {1.96 * sd:.{digits}f} {unit}"


def _means(findings: Findings) -> Blocks:
    blocks: Blocks = []
    for run, rows in by_run(findings.arrays["resistance"]):
        panels = []
        for name in [name for name in _LINES if (rows["name"] == name).any()]:
            one = rows[rows["name"] == name]
            x, y, half = one["x"].to_numpy(), one["y"].to_numpy(), 1.96 * one["sd"].to_numpy()
            value = _value(findings, name, run)
            marks: list[Mark] = []
            x_axis, y_axis = (
                (Axis("TMP", "mmHg"), Axis("UF rate", "mL/min"))
                if name == "k_uf"
                else (Axis("flow", "mL/min"), Axis("pressure", "mmHg"))
            )
            if value is not None:
                # Without a stop of the pump the zero is not known: a slope is all there is.
                start = 0.0 if name == "k_uf" or bool(one["zeroed"].all()) else float(np.mean(y - value * x))
                ends = np.array([0.0, 1.08 * x.max()])
                marks.append(Line(ends, start + value * ends, "model", "as found"))
                off = y - start - value * x
            marks.append(Points(x, y, "measured", "steps", y - half, y + half))
            panels.append(Panel(marks, x_axis, y_axis, _LINES[name]))
            if value is not None:
                share = value * x
                rest = Points(x, off / share, "residual", "", (off - half) / share, (off + half) / share)
                zero = Line(ends, np.zeros(2), "reference", dashed=True)  # as long as the line beside it
                panels.append(Panel([zero, rest], x_axis, Axis("off the line", "%"), "what it leaves"))
        blocks.append(
            Figure(
                f"resistance_{run}", f"Resistances and membrane{of_run(findings, run)}",
                f"Are the resistances constant? {captions.constant(findings.arrays['checks'], run)} Means of whole steps over the flow that passes, with the line found (through the origin where the zero is known), and what it leaves in percent: a slope there is an "
                "offset left over, or turbulence; a trend within a set-point is told among the quality findings.",
                "mean pressures over flow with lines through the origin and relative residuals", panels, columns=2,
            )
        )  # fmt: skip
    return blocks


def _value(findings: Findings, name: str, run: str) -> float | None:
    rows = [p for p in findings.find(name) if p.at.get("run", run) == run]
    return rows[0].value if rows else None


def _bode(findings: Findings) -> Blocks:
    blocks: Blocks = []
    for run, rows in by_run(findings.arrays["filter_ratio"]):
        curve = findings.arrays["filter_curve"]
        curve = curve[curve["run"] == run]
        sizes: list[Mark] = []
        phases: list[Mark] = []
        if len(curve):
            f = curve["frequency"].to_numpy()
            sizes.append(Line(f, curve["size"].to_numpy(), "model", "eq. (4)"))
            phases.append(Line(f, curve["phase"].to_numpy(), "model", "eq. (4)"))
        for order in sorted(set(rows["harmonic"])):
            one = rows[rows["harmonic"] == order]
            f, half = one["frequency"].to_numpy(), 1.96 * one["sd"].to_numpy()
            size, phase = one["size"].to_numpy(), one["phase"].to_numpy()
            sizes.append(Points(f, size, int(order) - 1, f"k = {order:g}", size - half, size + half))
            phases.append(Points(f, phase, int(order) - 1, f"k = {order:g}", phase - half / size, phase + half / size))
        blocks.append(
            Figure(
                f"bode_{run}", f"Return over pre-filter pressure{of_run(findings, run)}",
                f"Do a compliance and an inertance behind the filter explain how the pulsation decays? {captions.filtered(findings, rows, curve, run)} Ratio of the pulsations at the pump's lines, all speeds, with eq. (4): it does not "
                "depend on the pump nor on the compliance before the filter.",
                "size and phase of return over pre-filter pulsation against frequency with the fitted model",
                [Panel(sizes, Axis("frequency", "Hz"), Axis("|P_ret/P_pre|"), "size"), Panel(phases, Axis("frequency", "Hz"), Axis("phase", "rad"), "phase")],
                columns=2,
            )
        )  # fmt: skip
    return blocks


def _tmp(findings: Findings) -> Blocks:
    blocks: Blocks = []
    for run, rows in by_run(findings.arrays["tmp"]):
        panels = [
            Panel(
                [Line(rows["time"].to_numpy(), rows["tmp"].to_numpy(), "measured", "means of 1 s")],
                Axis("time", "s"),
                Axis("TMP", "mmHg"),
                "transmembrane pressure",
            )
        ]
        membrane = findings.arrays["membrane"]
        membrane = membrane[membrane["run"] == run]
        if len(membrane):
            k, half = membrane["k_uf"].to_numpy(), 1.96 * membrane["sd"].to_numpy()
            over: list[Mark] = [
                Points(membrane["time"].to_numpy(), k, "measured", "steps with UF on", k - half, k + half)
            ]
            value = _value(findings, "k_uf", run)
            if value is not None:
                over.append(Rule(y=value, role="model", label="Kuf"))
            panels.append(Panel(over, Axis("time", "s"), Axis("Kuf", "mL/h/mmHg"), "membrane over time"))
        panels += _switches(findings, run)
        temperature = findings.arrays["runs"].set_index("run").loc[run, "fluid_temperature"]
        told = (
            f" The fluid was at {float(temperature) - 273.15:.1f} °C."
            if np.isfinite(float(temperature))
            else " The log does not state the fluid's temperature."
        )
        blocks.append(
            Figure(
                f"tmp_{run}", f"Membrane{of_run(findings, run)}",
                f"Does the membrane pass what is asked of it, alike at every blood flow and to the end? {captions.membrane(findings, run, membrane)} TMP over the run, the coefficient in each step with UF on, and how the "
                f"ultrafiltrate pressure follows when UF is switched.{told} Saline has no protein: a decline would be temperature (about 2 %/K), offset drift, air or a flow error.",
                "transmembrane pressure over time, ultrafiltration coefficient by step, response to switches", panels, columns=2,
            )
        )  # fmt: skip
    return blocks


def _switches(findings: Findings, run: str) -> list[Panel]:
    rows = findings.arrays["uf_steps"]
    rows = rows[rows["run"] == run]
    marks: list[Mark] = []
    named: set[str] = set()
    for _, one in rows.groupby("step"):
        time, start = one["time"].to_numpy(), float(one["measured"].iloc[0])
        label = "on" if float(one["measured"].iloc[-1]) < start else "off"
        marks += [
            Line(time, one["measured"].to_numpy() - start, "measured", "" if label in named else f"switched {label}"),
            Line(time, one["modelled"].to_numpy() - start, "model", "" if named else "model", dashed=True),
        ]
        named.add(label)
    return (
        [Panel(marks, Axis("time", "s"), Axis("UF pressure less what follows the blood side", "mmHg"), "UF switched")]
        if marks
        else []
    )


def _unobservable(findings: Findings) -> Blocks:
    rows = findings.arrays["unobservable"]
    if rows.empty:
        return []
    cells: list[list[Cell]] = [
        [_HIDDEN.get(str(r["name"]), str(r["name"])), str(r["reason"])]
        for r in rows.drop_duplicates("name").to_dict("records")
    ]
    return [
        Table(
            "unobservable",
            "What this log cannot tell",
            "Parts of the circuit that these signals do not determine.",
            [Column("part"), Column("why")],
            cells,
        )
    ]
