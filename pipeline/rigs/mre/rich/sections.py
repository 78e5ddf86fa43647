"""What the report of `mre.shear_rich` shows, drawn from parameters and arrays only (mre.md section 7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Cell,
    Column,
    Figure,
    Line,
    Mark,
    Matrix,
    Panel,
    Points,
    Role,
    Rule,
    Section,
    Table,
    Value,
)
from pipeline.rigs.in_words import chance, found_by_tests
from pipeline.rigs.mre.micromechanics.sections import sections as micromechanics
from pipeline.rigs.mre.rich import captions
from pipeline.rigs.mre.rich.sections_online import of_online, told
from pipeline.rigs.mre.shear.captions import level_text

DISPLACEMENT, FORCE, TIME = Axis("displacement", "m"), Axis("force", "N"), Axis("time", "s")
_SHOWN = 6
_NO_BREAK = "\u00a0"
_LEFT: tuple[tuple[Role, str, str], ...] = (
    ("residual", "batch", "residual, batch fit"),
    ("model", "online filter", "innovations, online filter"),
)


def sections(findings: Findings) -> Sequence[Section]:
    """Return the chapters that the findings have something for."""
    titles = _titles(findings)
    chapters = [
        Section(
            "records", "Records and the model", [*_reach(findings), *_loops(findings, titles), *_time(findings, titles)]
        ),
        Section("online", "Batch fit and online filter", of_online(findings, titles)),
        Section(
            "agreement",
            "Does only the field's part change with the current?",
            [*_field(findings), *_agreement(findings)],
        ),
        Section(
            "fit",
            "How well the model is known",
            [*_correlation(findings, titles), *_spectra(findings, titles), *_checks(findings)],
        ),
        *micromechanics(findings),
    ]
    return [chapter for chapter in chapters if chapter.blocks]


def _titles(findings: Findings) -> dict[str, str]:
    titles = {}
    for row in findings.arrays["records"].head(_SHOWN).to_dict("records"):
        current = row["current"]
        known = current is not None and np.isfinite(current)
        titles[str(row["run"])] = f"{row['run']}, {level_text(current)}" if known else str(row["run"])
    return titles


def _of_run(table: pd.DataFrame, run: str) -> pd.DataFrame:
    return table[table["run"] == run]


def _reach(findings: Findings) -> list[Table]:
    reaches = captions.reaches(findings.arrays["records"], findings.arrays["side_by_side"])
    rows = []
    for row in findings.arrays["records"].to_dict("records"):
        rows.append(
            [
                str(row["run"]),
                level_text(row["current"]) if row["current"] is not None else "",
                row["duration"],
                _pair(row, "amplitude", 1e3, 2),
                _pair(row, "frequency", 1.0, 1),
                float(f"{row['nrmse']:.3g}"),
                float(f"{row['prediction_nrmse']:.3g}") if np.isfinite(row["prediction_nrmse"]) else None,
            ]
        )
    return [
        Table(
            "records",
            "What the records hold",
            f"Do amplitudes and frequencies reach far enough? {reaches} Nine strokes in ten lie between those told. Misfit of the force (rms) of the "
            "fit to the whole record, and of the fit to its first half in the second.",
            [
                Column("run"),
                Column("current"),
                Column("duration", "s"),
                Column("amplitudes in mm"),
                Column("frequencies in Hz"),
                Column("misfit", "%"),
                Column("misfit when predicted", "%"),
            ],
            rows,
        )
    ]


def _pair(row: dict[str, float], name: str, factor: float, digits: int) -> str:
    low, high = row.get(f"{name}_low", np.nan), row.get(f"{name}_high", np.nan)
    return f"{factor * low:.{digits}f} to {factor * high:.{digits}f}" if np.isfinite(low) else ""


def _loops(findings: Findings, titles: dict[str, str]) -> list[Figure]:
    table, cycles = findings.arrays["loops"], findings.arrays.get("cycles", pd.DataFrame({"run": []}))
    panels = []
    for run, title in titles.items():
        part = _of_run(table, run)
        x, F, model = (part[name].to_numpy() for name in ("displacement", "force", "model"))
        panels.append(Panel(_drawn_cycles(_of_run(cycles, run)), DISPLACEMENT, FORCE, title))
        panels.append(Panel([Points(x, F - model, "residual"), Rule(y=0.0)], DISPLACEMENT, FORCE, f"{title}: residual"))
    return [
        Figure(
            "loops",
            "Force over displacement",
            f"Does the model follow loops of every size? {captions.followed(findings.arrays['records'], table)} "
            "One small, one middle and one large cycle of the record, the model as a line over the samples; beside them what is "
            "left of thinned samples of the whole record, to its own scale.",
            "three loops of force over displacement, measured and model, and the residual over displacement, one row a record",
            panels,
            columns=2,
        )
    ]


def _drawn_cycles(part: pd.DataFrame) -> list[Mark]:
    """Return the samples of the cycles, and over them the model's line of each."""
    if part.empty:
        return []
    marks: list[Mark] = [Points(part["displacement"].to_numpy(), part["force"].to_numpy(), "measured", "measured")]
    for number, cycle in part.groupby("cycle"):
        label = "model" if number == 1 else ""
        marks.append(Line(cycle["displacement"].to_numpy(), cycle["model"].to_numpy(), "model", label))
    return marks


def _time(findings: Findings, titles: dict[str, str]) -> list[Figure]:
    table = findings.arrays["series"]
    panels = []
    for run, title in titles.items():
        part = _of_run(table, run)
        time, force, model = (part[name].to_numpy() for name in ("time", "force", "model"))
        panels.append(
            Panel(
                [Line(time, force, "measured", "measured"), Line(time, model, "model", "model", dashed=True)],
                TIME,
                FORCE,
                title,
            )
        )
        panels.append(Panel([Line(time, force - model, "residual"), Rule(y=0.0)], TIME, FORCE, f"{title}: residual"))
    return [
        Figure(
            "time",
            "Force over time",
            f"Does the model follow in time? {captions.missed(table)} Two seconds of the second half; the parameters are those of the whole record.",
            "force over time, measured and model, and residual over time",
            panels,
            columns=2,
        )
    ]


def _field(findings: Findings) -> list[Table]:
    """Show k2 at each current and what it gained since the least one."""
    found = [p for p in findings.parameters if p.name == "k2" and p.value is not None and "coil_current" in p.at]
    found.sort(key=lambda p: float(p.at["coil_current"]))
    if len(found) < 2:
        return []
    base = found[0]
    damping = {str(p.at): p for p in findings.find("s_mr")}
    rows: list[list[Cell]] = []
    for p in found:
        value, sd = float(p.value or 0.0), float(p.std_error or 0.0)
        sd_base = float(base.std_error or 0.0)
        gain, error = value - float(base.value or 0.0), float(np.hypot(sd, sd_base))
        gained = Value(gain, error, (gain - 1.96 * error, gain + 1.96 * error)) if p is not base else None
        viscous = damping.get(str(p.at))
        rows.append(
            [
                level_text(float(p.at["coil_current"])),
                Value(p.value, p.std_error, p.ci95),
                gained,
                Value(viscous.value, viscous.std_error, viscous.ci95) if viscous else None,
            ]
        )
    return [
        Table(
            "field",
            "What the field adds",
            f"What does the field add? {captions.added(found, damping.get(str(found[-1].at)), findings.verdict)} k2 of each record holds k_MR, which is what it gains. "
            "s_MR is fitted where there is a field.",
            [Column("current"), Column("k2 with the field", "N/m"), Column("gain", "N/m"), Column("s_MR", "N s/m")],
            rows,
        )
    ]


def _agreement(findings: Findings) -> list[Table]:
    table = findings.arrays.get("agreement")
    if table is None:
        return []
    p_value = float(table["p_value"].iloc[0])
    runs = list(dict.fromkeys(table["run"]))
    rows: list[list[Cell]] = []
    for name in dict.fromkeys(table["name"]):
        part = table[table["name"] == name].set_index("run")
        common, half = (float(part[column].iloc[0]) for column in ("common", "common_sd"))
        off = [
            f"{100 * (part.loc[run, 'own'] / common - 1):+.2f} % ({part.loc[run, 'deviation']:+.1f} sd)".replace(
                " ", _NO_BREAK
            )
            for run in runs
        ]
        rows.append([*told(str(name), common, common - 1.96 * half, common + 1.96 * half), *off])
    return [
        Table(
            "agreement",
            "What is said not to depend on the current",
            "Are these common to all currents, as the paper takes them? "
            f"{'Yes' if p_value >= 0.01 else 'No, they differ beyond chance'}: the chance of differences as large is {chance(p_value)}. Each record was "
            "fitted on its own; common value by their covariances with half of its 95 % interval, then how far each record lies off it, in brackets in "
            "standard deviations.",
            [Column("parameter"), Column("unit"), Column("common value"), *(Column(str(run)) for run in runs)],
            rows,
        )
    ]


def _correlation(findings: Findings, titles: dict[str, str]) -> list[Figure]:
    table = findings.arrays["correlation"]
    panels = []
    worst = 0.0
    for run, title in titles.items():
        part = _of_run(table, run)
        names = [str(name) for name in part["name"]]
        worst = max(worst, float(part["condition"].iloc[0]))
        panels.append(Panel([Matrix(part[names].to_numpy(float), names, names)], title=title))
    said = "above 500: only combinations are known" if worst > 500 else "below 500: the parameters can be told apart"
    if worst <= 500 and findings.verdict == "rejected":
        said = "of a model that does not hold, which tells nothing of the device"
    return [
        Figure(
            "correlation",
            "Correlation of the parameters",
            f"Which parameters trade for each other? Correlation of the batch estimates; condition number at most {worst:.3g}, {said}.",
            "matrix of correlation coefficients, one panel a record",
            panels,
            columns=2,
        )
    ]


def _spectra(findings: Findings, titles: dict[str, str]) -> list[Figure]:
    table = findings.arrays.get("spectra")
    if table is None:
        return []
    panels = []
    for run, title in titles.items():
        part = _of_run(table, run)
        marks = []
        for role, method, label in _LEFT:
            curve = part[part["method"] == method]
            if len(curve):
                marks.append(Line(curve["frequency"].to_numpy(), curve["density"].to_numpy(), role, label))
        if marks:
            panels.append(Panel(marks, Axis("frequency", "Hz", "log"), Axis("power density", "N^2/Hz", "log"), title))
    return [
        Figure(
            "spectra",
            "Spectra of what is left",
            f"Is what is left only noise? {captions.left_where_moved(table, findings.arrays['records'])} White noise is flat. An excess there is model, "
            "or noise of the displacement times the stiffness; a line is mains hum, which the batch fit takes out.",
            "power spectral density of batch residual and filter innovations over frequency",
            panels,
            columns=2,
        )
    ]


def _checks(findings: Findings) -> list[Table]:
    table = findings.arrays.get("residual_checks")
    if table is None:
        return []
    rows = [[r["of"], r["name"], chance(r["p_value"]), r["verdict"]] for r in table.to_dict("records")]
    return [
        Table(
            "residual_checks",
            "Tests of what is left",
            f"Is what is left only white noise? {found_by_tests(table['p_value'])} A chance below 1 % says no, the last column how far: the low-pass against aliasing ties "
            "neighbours together, and so do the displacement's noise and hum. Intervals of the batch fit allow for the colour; those of the filter do not.",
            [Column("of"), Column("test"), Column("chance"), Column("result")],
            rows,
        )
    ]
