"""What LabVIEW's .lvm files say in their second header: the units of the columns, in rows named after them."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.ingest.delimited.dialect import Dialect

_NAMES = {"Second": "s", "Seconds": "s", "Time": "s", "Newton": "N", "Millimeter": "mm", "Meter": "m"}


def units(lines: Sequence[str], dialect: Dialect) -> list[str | None]:
    """Return the unit of each column, [] where the lines hold no ``Y_Unit_Label``.

    Only files with one common first column of times or none are meant: the units of several are not told apart.
    """
    rows = {cells[0]: cells[1:] for line in lines if len(cells := dialect.split(line)) > 1}
    if "Y_Unit_Label" not in rows or rows.get("X_Columns", ["One"])[0] == "Multi":
        return []
    quantity = rows.get("X_Dimension", [""])[0]
    return [_NAMES.get(quantity), *(_NAMES.get(unit, unit or None) for unit in rows["Y_Unit_Label"])]
