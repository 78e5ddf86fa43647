"""What the models leave over, check by check (rap.md, 5.8)."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

from pipeline.findings import Findings
from pipeline.findings.figures import Cell, Column, Status, Table
from pipeline.rigs.rap.conditions import TAP_NAMES
from pipeline.rigs.rap.pressures import captions
from pipeline.rigs.rap.pressures.declaration import MMHG
from pipeline.rigs.rap.pressures.sections_alignment import Blocks
from pipeline.rigs.rap.wording import signed

_WORDS = {
    "residual_line": "stroke left in the residual, share of the stroke",
    "drift": "drift of device less bench",
    "curvature": "change of gain over the range of pressure",
    "pulsation_gain": "gain of the pulsation over that of the means, less 1",
    "resistance_trend": "change of the resistance (or of Kuf) within the run, at equal flow",
    "resistance_over_flow": "change of the resistance from lowest to highest flow",
    "meter_step": "meter's step when ultrafiltration comes on, over its rate (return line: -1)",
}
_CIRCUIT = {"r_access": "Rₐ", "r_filter": "Rf", "r_return": "Rᵣ", "k_uf": "Kuf", "": "flow meter"}


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
        value = f"{signed(r['value'] / size, digits)} ± {1.96 * r['std_error'] / size:.{digits}f} {unit}".strip()
        limit = "–" if r["name"] == "meter_step" else f"{r['limit'] / size:.3g} {unit}".strip()
        rows.append([
            *([str(r["run"])] if several else []), TAP_NAMES.get(str(r["channel"]), _CIRCUIT.get(str(r["channel"]), str(r["channel"]))),
            _WORDS[str(r["name"])], value, limit, _judged(r),
        ])  # fmt: skip
    columns = [
        *([Column("run")] if several else []),
        Column("of"),
        Column("check"),
        Column("found, 95 %"),
        Column("limit"),
        Column(""),
    ]
    caption = (
        f"Is anything left that the models do not explain? {captions.checks(table)} A check is beyond where it is larger than its limit and than four standard "
        "errors; it is undecided where its interval reaches beyond the limit."
    )
    return [Table("checks", "Checks of the models", caption, columns, rows)]


def _judged(row: dict[Hashable, Any]) -> Status:
    if row["exceeds"]:
        return Status("beyond", "warning")
    reaches = abs(row["value"]) + 1.96 * row["std_error"] > row["limit"]
    return Status("undecided") if reaches and row["name"] != "meter_step" else Status("in order", "ok")
