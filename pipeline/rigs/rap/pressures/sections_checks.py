"""What the models leave over, check by check (rap.md, 5.8)."""

from __future__ import annotations

from pipeline.findings import Findings
from pipeline.findings.figures import Cell, Column, Status, Table
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.pressures.declaration import MMHG
from pipeline.rigs.rap.pressures.sections_alignment import Blocks

_WORDS = {
    "residual_line": "stroke left in the residual, share of the stroke",
    "drift": "drift of device less bench",
    "curvature": "change of gain over the range of pressure",
    "pulsation_gain": "gain of the pulsation over that of the means, less 1",
    "resistance_trend": "change of the resistance (or of Kuf) within the run, at equal flow",
    "resistance_over_flow": "change of the resistance from lowest to highest flow",
    "meter_step": "meter's step when ultrafiltration comes on, over its rate (return line: -1)",
}
_CIRCUIT = {"r_access": "Ra", "r_filter": "Rf", "r_return": "Rr", "k_uf": "Kuf", "": "flow meter"}


def of_checks(findings: Findings) -> Blocks:
    """Return the table of the checks."""
    table = findings.arrays["checks"]
    if table.empty:
        return []
    several = table["run"].nunique() > 1
    rows: list[list[Cell]] = []
    for r in table.to_dict("records"):
        hourly = r["unit"] == "Pa/h"
        size, unit, digits = (MMHG, "mmHg/h", 2) if hourly else (0.01, "%", 2)
        if r["name"] == "meter_step":
            size, unit, digits = 1.0, "", 2
        value = f"{r['value'] / size:+.{digits}f} ± {1.96 * r['std_error'] / size:.{digits}f} {unit}".strip()
        limit = "–" if r["name"] == "meter_step" else f"{r['limit'] / size:.3g} {unit}".strip()
        rows.append([
            *([str(r["run"])] if several else []), TAP_NAMES.get(str(r["channel"]), _CIRCUIT.get(str(r["channel"]), str(r["channel"]))),
            _WORDS[str(r["name"])], value, limit, Status("beyond", "warning") if r["exceeds"] else Status("in order", "ok"),
        ])  # fmt: skip
    columns = [
        *([Column("run")] if several else []),
        Column("of"),
        Column("check"),
        Column("found, 95 %"),
        Column("limit"),
        Column(""),
    ]
    caption = "Whether anything is left that the models do not explain. A check is beyond where it is larger than its limit and than four standard errors."
    return [Table("checks", "Checks of the models", caption, columns, rows)]
