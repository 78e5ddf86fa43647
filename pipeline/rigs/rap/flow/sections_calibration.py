"""What a stroke delivers over back pressure and pulsation, set-points left out, and what unclamped set-points alone would have said."""

from __future__ import annotations

import math

import numpy as np

from pipeline.findings import Findings, Parameter
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Points, Table, Text
from pipeline.rigs.rap.flow import captions
from pipeline.rigs.rap.flow.estimators import F_0
from pipeline.rigs.rap.flow.sections_errors import Blocks, roles

_COEFFICIENTS = ("stroke_volume", "y0", "y1", "stroke_volume_mean", "pump_compliance")
# Symbol, size of the unit in SI and unit of each law's coefficients.
_UNITS = {
    "E1": (("V", 1e-6, "mL"),), "affine": (("a", 1e-6, "mL"), ("b", 1e-6 / 60.0, "mL/min")),
    "E2": (("V_g", 1e-6, "mL"), ("y₀", 1e-12, "10⁻¹² m³/(s Pa)"), ("y₁", 1e-12, "10⁻¹² m³/Pa")), "E3": (("V₀", 1e-6, "mL"), ("C_p", 1e-12, "10⁻¹² m³/Pa")),
}  # fmt: skip
_TRAP = {"E1": "E1, V f", "affine": "Q = a f + b", "E2": "E2, pulsation", "E3": "E3, mean pressures"}


def _one(findings: Findings, name: str) -> Parameter | None:
    found = next(iter(findings.find(name)), None)
    return found if found is not None and found.value is not None else None


def of_calibration(findings: Findings) -> Blocks:
    """Return what the coefficients were read off, and which are not determined."""
    blocks: Blocks = []
    if not findings.arrays["windows"]["flow"].notna().any():
        return []
    panels = [panel for panel in (_stroke(findings), _admittance(findings)) if panel is not None]
    if panels:
        blocks.append(
            Figure(
                "strokes", "What a stroke delivers",
                f"Do the laws hold? {captions.laws(findings.arrays['errors'])} Left: the volume of a stroke falls with the mean back pressure, on one line for all speeds where E3 holds. Right: the flow that a pascal of "
                "pulsation stands for, volume times frequency less the flow, over A₁, against the speed; E2's line passes through the operating points of the calibration.",
                "volume of a stroke over back pressure with E3's line, and flow per pascal of pulsation over frequency with E2's line", panels, columns=2,
            )
        )  # fmt: skip
    missing = [
        p.description
        for name in _COEFFICIENTS
        if (p := next(iter(findings.find(name)), None)) is not None and p.value is None
    ]
    if missing:
        blocks.append(Text([f"Not determined: {reason}." for reason in dict.fromkeys(missing)]))
    return blocks


def _stroke(findings: Findings) -> Panel | None:
    points = findings.arrays["points"]
    known = points[points["flow"].notna() & points["back_pressure"].notna()]
    if known.empty:
        return None
    marks: list[Mark] = []
    V, C = _one(findings, "stroke_volume_mean"), _one(findings, "pump_compliance")
    if V is not None and C is not None and V.value is not None and C.value is not None:
        x = np.array([0.0, 1.05 * known["back_pressure"].max()])
        marks.append(Line(x, V.value - C.value * x, "model", "E3: V₀ - C_p (P_pre - P_a)"))
    for name, role in roles(known).items():
        rows = known[known["group"] == name]
        marks.append(
            Points(rows["back_pressure"].to_numpy(), (rows["flow"] / rows["frequency"]).to_numpy(), role, name)
        )
    return Panel(marks, Axis("mean back pressure", "mmHg"), Axis("volume of a stroke, Q/f", "mL"), "E3")


def _admittance(findings: Findings) -> Panel | None:
    points = findings.arrays["points"]
    coefficients = [_one(findings, name) for name in ("stroke_volume", "y0", "y1")]
    values = [p.value for p in coefficients if p is not None and p.value is not None]
    known = points[points["flow"].notna() & points["amplitude"].notna()]
    if len(values) < 3 or known.empty:
        return None
    V, y_0, y_1 = values
    f = known["frequency"].to_numpy()
    x = np.array([0.95 * f.min(), 1.05 * f.max()])
    marks: list[Mark] = [Line(x, y_0 + y_1 * (x - F_0), "model", "E2: y₀ + y₁ (f - 2 Hz)")]
    for name, role in roles(known).items():
        rows = known[known["group"] == name]
        y = (V * rows["frequency"] - rows["flow"]) / rows["amplitude"]
        marks.append(Points(rows["frequency"].to_numpy(), y.to_numpy(), role, name))
    return Panel(marks, Axis("roller passages", "Hz"), Axis("flow per pulsation", "m^3/(s Pa)"), "E2")


def of_left_out(findings: Findings) -> Blocks:
    """Return how well set-points are predicted that the calibration did not see."""
    table = findings.arrays["left_out"]
    if table.empty:
        return []
    levels = sorted(table["flow_set"].dropna().unique())
    rows: list[list[Cell]] = []
    for name in ("E2", "E2 quadratic", "E3"):
        of_law = table[table["estimator"] == name].set_index("flow_set")["worst"]
        if not of_law.empty:
            values = [float(of_law.get(level, math.nan)) for level in levels]
            rows.append(
                [
                    name,
                    *(round(value, 4) if math.isfinite(value) else None for value in values),
                    max((round(v, 4) for v in values if math.isfinite(v)), default=None),
                ]
            )
    by = {str(row[0]): row[-1] for row in rows}
    text = (
        "Each set-point is left out of the calibration in turn and predicted by the rest; an outer one is extrapolated."
    )
    linear, quadratic = by.get("E2"), by.get("E2 quadratic")
    if isinstance(linear, float) and isinstance(quadratic, float):
        better = quadratic < linear
        text += (
            f" A term in (f - f₀)² predicts {'better' if better else 'worse'} ({100 * quadratic:.2g} against {100 * linear:.2g} %), though it fits better: "
            f"{'with so many set-points it may be kept' if better else 'the linear E2 is kept'}."
        )
    heads = [Column(f"{6e7 * level:g} mL/min", "%") for level in levels]
    return [
        Table("left_out", "Largest error at the set-point left out", text, [Column("estimator"), *heads, Column("worst", "%")], rows)
    ]  # fmt: skip


def _spelt(law: str, written: str) -> str:
    """Return coefficients, written in SI one after the other, each with its symbol in its unit for reading."""
    values = [float(text) for text in written.split(",")]
    return ", ".join(
        f"{symbol} = {value / size:.3g} {unit}" for value, (symbol, size, unit) in zip(values, _UNITS[law], strict=True)
    )


def of_trap(findings: Findings) -> Blocks:
    """Return what a calibration on unclamped set-points would have claimed, and what it is worth on the clamped ones."""
    table = findings.arrays["trap"]
    if table.empty:
        return []
    rows: list[list[Cell]] = [
        [
            _TRAP[row["law"]],
            round(float(row["inside"]), 4),
            round(float(row["outside"]), 4),
            _spelt(str(row["law"]), str(row["coefficients"])),
        ]
        for row in table.to_dict("records")
    ]
    by = {row["law"]: row for row in table.to_dict("records")}
    text = (
        f"Fitted to the unclamped set-points alone, E2 is right within {100 * by['E2']['inside']:.1f} % there and off by up to {100 * by['E2']['outside']:.0f} % once the "
        f"access line narrows; Q = a f + b, which is no model of a pump at all, is right within {100 * by['affine']['inside']:.1f} % and off by up to "
        f"{100 * by['affine']['outside']:.0f} %. Pulsation and back pressure follow the speed as long as nobody touches the circuit: set-points alone cannot tell a good "
        "estimator from a bad one, and a published worst error at three set-points says little."
    )
    return [
        Text([text]),
        Table(
            "trap", "Laws fitted to unclamped set-points only",
            "Largest relative error on the windows that they were fitted to, and on clamped ones, of the calibration or else of the hold-out.",
            [Column("law"), Column("unclamped, fitted", "%"), Column("clamped, predicted", "%"), Column("coefficients")], rows,
        ),
    ]  # fmt: skip
