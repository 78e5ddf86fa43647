"""Findings handed on: a CSV of all parameters, and bearing tables as ROSS reads them.

Numbers are SI as in findings.json; nothing is fitted or smoothed here.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.errors import InputError, listing
from pipeline.findings.findings import Findings, Parameter

COEFFICIENTS = ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy")


def as_csv(findings: Findings) -> str:
    """Return all parameters, one a line: name, operating point (one column a key), value, error, interval, unit.

    Fields that would be taken for a formula by a spreadsheet keep a leading apostrophe.
    """
    keys = list(dict.fromkeys(key for p in findings.parameters for key in p.at))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(
        ["name", *map(_cell, keys), "value", "std_error", "type_b", "ci95_low", "ci95_high", "unit", "description"]
    )
    for p in findings.parameters:
        low, high = p.ci95 or (None, None)
        at = [p.at.get(key, "") for key in keys]
        writer.writerow(
            [_cell(v) for v in (p.name, *at, p.value, p.std_error, p.type_b, low, high, p.unit, p.description)]
        )
    return out.getvalue()


def _cell(value: float | str | bool | None) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.10g}"
    text = str(value)
    return f"'{text}" if text.lstrip().startswith(("=", "+", "-", "@")) else text


@dataclass(frozen=True)
class BearingTable:
    """Stiffness (N/m) and damping (N s/m) of one bearing over `frequency` (rad/s), rising, shape (n,) each.

    `over` tells what the frequency is: "speed" of the shaft (synchronous coefficients) or "frequency"
    of the excitation at one shaft speed. `skipped` are frequencies with a coefficient that is not told.
    """

    name: str
    over: str
    about: str
    frequency: tuple[float, ...]
    columns: dict[str, tuple[float, ...]]
    skipped: tuple[float, ...] = ()

    def toml(self) -> str:
        """Return what ``ross.BearingElement.load`` reads; the node is 0, to be set by the user."""
        lines = [f"# {line}" for line in self.about.splitlines()]
        lines += [f"[{json.dumps('BearingElement_' + self.name)}]", "n = 0", f"tag = {json.dumps(self.name)}"]
        lines.append(f"frequency = {_numbers(self.frequency)}")
        lines += [f"{name} = {_numbers(values)}" for name, values in self.columns.items()]
        return "\n".join(lines) + "\n"

    def sheet(self) -> bytes:
        """Return the Excel workbook that ``ross.BearingElement.from_table`` reads, in SI."""
        from pipeline.findings.workbook import workbook

        head = [*self.columns, "frequency"]
        rows = zip(*self.columns.values(), self.frequency, strict=True)
        return workbook([head, *rows])


def _numbers(values: Sequence[float]) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"


def bearing_tables(findings: Findings) -> list[BearingTable]:
    """Return the tables of stiffness and damping that findings hold.

    For each load: the synchronous coefficients over shaft speed, and for each load and speed the
    coefficients over the frequency of the excitation.

    Raises
    ------
    InputError
        If there are no such coefficients, or none is told.
    """
    wanted = [p for p in findings.parameters if p.name in COEFFICIENTS]
    if not {"kxx", "cxx"} <= {p.name for p in wanted}:
        names = listing(dict.fromkeys(p.name for p in findings.parameters))
        raise InputError(
            f"campaign '{findings.campaign}' ({findings.experiment}) has no stiffness and damping of a bearing over frequency; its "
            f"parameters are {names}. ROSS tables come from tpjb.dynamic."
        )
    points: dict[tuple[str, tuple[tuple[str, object], ...]], dict[float, dict[str, Parameter]]] = {}
    for p in wanted:
        at = dict(p.at)
        if "frequency" in at:
            place, row = "frequency", 2 * 3.141592653589793 * float(at.pop("frequency"))
        elif at.pop("synchronous", False) and "shaft_speed" in at:
            place, row = "speed", float(at.pop("shaft_speed"))
        else:
            continue
        points.setdefault((place, tuple(sorted(at.items()))), {}).setdefault(row, {})[p.name] = p
    tables = [_table(findings, over, dict(at), rows) for (over, at), rows in points.items()]
    told = [table for table in tables if table.frequency]
    if not told:
        reason = next((p.description for p in wanted if p.value is None), "")
        raise InputError(f"campaign '{findings.campaign}': no coefficient is told ({reason}); nothing to export.")
    return told


def _table(
    findings: Findings, over: str, at: dict[str, object], rows: dict[float, dict[str, Parameter]]
) -> BearingTable:
    complete = {
        row: {name: float(p.value) for name, p in found.items() if p.value is not None}
        for row, found in sorted(rows.items())
    }
    kept = {row: values for row, values in complete.items() if len(values) == len(COEFFICIENTS)}
    where = ", ".join(f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}" for key, value in at.items())
    what = {
        "speed": "synchronous coefficients over shaft speed",
        "frequency": "coefficients over the frequency of the excitation, at one shaft speed",
    }[over]
    parts = [
        findings.campaign,
        *(f"{key}_{value:g}" if isinstance(value, float) else f"{value}" for key, value in at.items()),
        over,
    ]
    about = (
        f"{findings.campaign}, {where}: {what}.\nSI: frequency rad/s, stiffness N/m, damping N s/m. x horizontal, y vertical up.\n"
        "bearing = ross.BearingElement.load(FILE), then set bearing.n to its node."
    )
    return BearingTable(
        "-".join(parts).replace("/", "_").replace(" ", "_"),
        over,
        about,
        tuple(kept),
        {name: tuple(values[name] for values in kept.values()) for name in COEFFICIENTS},
        tuple(row for row in complete if row not in kept),
    )
