"""Estimated flow over metered flow, their errors beside the paper's 9.12 %, and the table of the estimators."""

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
    Role,
    Rule,
    Status,
    Table,
    Text,
    Value,
)
from pipeline.rigs.rap.flow import captions
from pipeline.rigs.rap.flow.paper import WORST_ERROR
from pipeline.rigs.rap.flow.sets import CALIBRATION, HOLDOUT, called
from pipeline.rigs.rap.wording import joined

if TYPE_CHECKING:
    import pandas as pd

Blocks = list[Figure | Table | Text]
_METER, _ERROR = Axis("metered flow", "mL/min"), Axis("estimate/meter - 1", "%")
_ESTIMATORS = {
    "E0": "E0: strokes counted, volume from the lowest set-point",
    "E2": "E2: pulsation",
    "E3": "E3: mean pressures",
}
_ROWS = {
    "E2": "E2, pulsation", "E3": "E3, mean pressures", "rap": "the device's own estimate", "E0": "E0, V f from the lowest set-point", "E1": "E1, V f",
    "E2 quadratic": "E2 with a term in (f - f₀)²", "affine": "a f + b, no pump model",
}  # fmt: skip


def of_errors(findings: Findings) -> Blocks:
    """Return where the meter sits, the figures and the table of errors."""
    points = findings.arrays["points"]
    known = points[points["flow"].notna()]
    blocks: Blocks = [Text([meter_position(findings)])]
    if known.empty:
        return blocks
    return [*blocks, _over_meter(findings, known), *_errors(findings, known), _table(findings), _flows(findings)]


def meter_position(findings: Findings) -> str:
    """Return a sentence on where the flow meter sits, which every flow error rests on."""
    meter = findings.arrays["meter"].iloc[0]
    if not findings.arrays["windows"]["metered"].notna().any():
        return "No run has a flow meter: nothing can be calibrated or judged."
    gain = f"Its gain is taken as uncertain by {100 * meter['gain_u']:.2g} % ({'stated' if meter['gain_stated'] else 'assumed'}); volumes and flows carry that in full."
    if meter["used"]:
        how = "as stated" if meter["stated"] else "as the logs themselves tell, it is not stated"
        added = (
            " On the return line it reads Q_b - Q_uf: the UF rate is added to it."
            if meter["used"] == "return"
            else " It reads the blood flow there."
        )
        return f"The flow meter sits on the {meter['used']} line ({how}).{added} {gain}"
    return (
        f"Where the flow meter sits is {'contradicted by its own readings' if meter['stated'] else 'not known'}: only windows without ultrafiltration are held against "
        f"it. On the return line it would read the blood flow less the UF rate, 5 to 8 % less at 60 to 100 mL/min and 5 mL/min of UF. {gain}"
    )


def roles(points: pd.DataFrame) -> dict[str, Role]:
    """Return a colour for each set, as it is called."""
    groups = sorted(
        points["group"].unique(), key=lambda name: (name != called(CALIBRATION), name != called(HOLDOUT), name)
    )
    return {name: i for i, name in enumerate(groups)}


def _over_meter(findings: Findings, points: pd.DataFrame) -> Figure:
    """Return estimates over the meter, by operating point with the scatter of its windows."""
    panels = []
    low, high = 0.95 * points["flow"].min(), 1.05 * points["flow"].max()
    for name, title in _ESTIMATORS.items():
        marks: list[Mark] = [Line(np.array([low, high]), np.array([low, high]), "reference", "estimate = meter")]
        for one, role in roles(points).items():
            rows = points[(points["group"] == one) & points[name].notna()]
            if rows.empty:
                continue
            x, half = rows["flow"].to_numpy(), 1.96 * rows["flow_sd"].fillna(0.0).to_numpy()
            y = rows[name].to_numpy()
            marks.append(Points(x, y, role, one, left=x - half, right=x + half))
        if len(marks) > 1:
            panels.append(Panel(marks, _METER, Axis("estimated flow", "mL/min"), title))
    return Figure(
        "over_meter", "Estimated over metered flow",
        f"Which estimator follows the meter when the access line is narrowed? {captions.followed(findings.arrays['errors'], _ESTIMATORS)} Each point is one set-point and clamp setting; bars are 95 % of the meter's windows. "
        "E0 counts strokes only and does not see that a clamp costs volume.",
        "estimated flow over metered flow for E0, E2 and E3, by set", panels, columns=len(panels) or 1,
    )  # fmt: skip


def _errors(findings: Findings, points: pd.DataFrame) -> Blocks:
    """Return relative errors of E2 and E3 over the meter, and those of all over the paper's set-points."""
    windows = findings.arrays["windows"]
    panels = []
    for name in ("E2", "E3"):
        marks: list[Mark] = []
        for one, role in roles(points).items():
            rows = points[(points["group"] == one) & points[f"{name}_error"].notna()]
            if rows.empty:
                continue
            inside = windows[windows["group"] == one]
            half = 1.96 * _scatter(rows, inside, f"{name}_error")
            y = rows[f"{name}_error"].to_numpy()
            marks.append(Points(rows["flow"].to_numpy(), y, role, one, y - half, y + half))
        if marks:
            limits: list[Mark] = [
                Rule(y=0.0),
                Rule(y=WORST_ERROR, role="fault", label="paper's worst, 9.12 %"),
                Rule(y=-WORST_ERROR, role="fault"),
            ]
            panels.append(Panel([*limits, *marks], _METER, _ERROR, _ESTIMATORS[name]))
    if not panels:
        return []
    return [
        Figure(
            "errors", "Relative error",
            f"How far off is a window? {captions.beyond(windows, WORST_ERROR)} Points are operating points, bars hold 95 % of their windows. The paper's "
            f"{100 * WORST_ERROR:.2f} % was found without clamps.",
            "relative error of E2 and E3 over metered flow, with lines at plus and minus 9.12 %", panels, columns=2, share_y=True,
        )
    ]  # fmt: skip


def _scatter(rows: pd.DataFrame, windows: pd.DataFrame, column: str) -> np.ndarray:
    """Return the standard deviation of the windows of each operating point."""
    keys = ["run", "clamp", "flow_set"]
    sd = windows.groupby(keys, dropna=False)[column].std()
    return np.array([float(sd.get(tuple(row), math.nan)) for row in rows[keys].to_numpy()])


def _share(value: float) -> float | None:
    """Return a share to a hundredth of a percent."""
    return round(float(value), 4) if math.isfinite(value) else None


def _table(findings: Findings) -> Table:
    errors = findings.arrays["errors"]
    limit = float(findings.settings.get("error_limit", WORST_ERROR))
    rows: list[list[Cell]] = []
    for name, words in _ROWS.items():
        for row in errors[errors["estimator"] == name].to_dict("records"):
            good = row["worst"] < limit
            judged = name in ("E2", "E3", "rap")
            word = f"{'below' if good else 'above'} {100 * limit:.3g} %"
            rows.append([
                words, str(row["group"]), *(_share(row[key]) for key in ("worst", "worst_open", "rms", "mean")), int(row["count"]),
                Status(word, "ok" if good else "warning") if judged else Status(word), str(row["where"]),
            ])  # fmt: skip
    return Table(
        "estimators", "Errors of the estimators",
        f"{captions.held_out(errors)} Errors are (estimate - meter)/meter over the windows of each set. Those on the calibration set say how well a law fits; only the hold-out says how well it predicts. E0, E1, "
        "the quadratic term and the affine law stand here for comparison. The paper's test had the access line open.",
        [Column("estimator"), Column("set"), Column("largest", "%"), Column("largest, line open", "%"), Column("rms", "%"), Column("mean", "%"), Column("windows"), Column("limit"), Column("worst in")], rows,
    )  # fmt: skip


def _flows(findings: Findings) -> Table:
    """Return the estimated flows of every run and set-point beside the meter."""
    table = findings.arrays["flows"]
    rows: list[list[Cell]] = []
    for (run, level), both in table.groupby(["run", "flow_set"], sort=False, dropna=False):
        cells: list[Cell] = []
        told: dict[str, list[str]] = {}
        for name in ("E2", "E3"):
            row = both[both["estimator"] == name].iloc[0]
            at = {"flow_set": float(level)} if math.isfinite(level) else {}
            found = next(iter(findings.find("flow", run=str(run), estimator=name, **at)), None)
            known = found is not None and found.value is not None
            cells.append(Value(found.value, found.std_error, found.ci95) if found is not None and known else None)
            for text in filter(None, (row["doubt"] or row["why_not"],)):
                told.setdefault(text.split(":")[0], []).append(name)
        metered = float(both["metered"].iloc[0])
        flow_set = float(level) if math.isfinite(level) else None
        rows.append(
            [
                str(run),
                flow_set,
                metered if math.isfinite(metered) else None,
                *cells,
                "; ".join(f"{joined(who)}: {why}" for why, who in told.items()),
            ]
        )
    return Table(
        "flows", "Estimated flow of each set-point",
        f"{captions.means_held(findings, table)} Mean of all windows of a run at a set-point, with 95 % intervals: clamp settings of a run are together. The meter's mean is beside it.",
        [Column("run"), Column("set", "mL/min"), Column("meter", "mL/min"), Column("E2", "mL/min"), Column("E3", "mL/min"), Column("remark")], rows,
    )  # fmt: skip
