"""Batch fit and online filter side by side: parameters over time, and the numbers at the end."""

from __future__ import annotations

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Band,
    Column,
    Figure,
    Line,
    Mark,
    Mood,
    Panel,
    Rule,
    Status,
    Table,
    Text,
)
from pipeline.rigs.mre.rich import captions

_SYMBOLS = {
    "k1": "k_1",
    "s1": "s_1",
    "tau": "τ",
    "k2": "k_2",
    "alpha_bw": "a_BW",
    "rho": "ρ",
    "c_bw": "C",
    "n_bw": "n",
    "s_mr": "s_MR",
    "force_lag": "δ",
}
_UNITS = {"k1": "N/m", "s1": "N s/m", "tau": "s", "k2": "N/m", "alpha_bw": "N", "rho": "1/m", "c_bw": "1", "n_bw": "1"}
_UNITS |= {"s_mr": "N s/m", "force_lag": "s"}
# In which unit the table tells a number, and how many of it one SI unit is.
_TOLD = {
    "k1": ("kN/m", 1e-3),
    "s1": ("N s/m", 1.0),
    "tau": ("ms", 1e3),
    "k2": ("kN/m", 1e-3),
    "alpha_bw": ("N", 1.0),
    "rho": ("1/mm", 1e-3),
    "c_bw": ("", 1.0),
    "n_bw": ("", 1.0),
    "s_mr": ("N s/m", 1.0),
    "force_lag": ("µs", 1e6),
}
_MOODS: dict[str, Mood] = {"converged": "ok", "not converged": "warning", "diverged": "rejected", "no filter": "unsaid"}
# The scale of a panel ends at so many times the value that the batch fit gives.
_CLIP = 2.5


def of_online(findings: Findings, titles: dict[str, str]) -> list[Figure | Table | Text]:
    """Return what there is to show of the filter; nothing where it did not run."""
    records = findings.arrays["records"]
    if "online" not in records:
        return []
    blocks: list[Figure | Table | Text] = [_verdicts(findings)]
    table = findings.arrays.get("online")
    for run, title in titles.items():
        if table is not None and (table["run"] == run).any():
            blocks.append(_over_time(findings, run, title))
        blocks.append(_side_by_side(findings, run, title))
    blocks.append(
        Text(
            [
                "The findings report the batch fit. The filter is for tracking, and its own standard deviation is not to be trusted: "
                "several times too large where R is held at four times the noise, too small for what it learned early from wrong "
                "parameters, and far too small where it has diverged. So it is judged by its innovations, by whether parameters still "
                "move, and by the batch fit beside it."
            ]
        )
    )
    return blocks


def _verdicts(findings: Findings) -> Table:
    rows = []
    for row in findings.arrays["records"].to_dict("records"):
        word = str(row["online"])
        rows.append(
            [
                str(row["run"]),
                Status(word, _MOODS.get(word, "unsaid")),
                row["innovation"] if np.isfinite(row["innovation"]) else None,
                row["noise"] if np.isfinite(row["noise"]) else None,
                str(row["online_reason"]),
            ]
        )
    return Table(
        "online_verdicts",
        "State of the filter",
        f"May the filter be trusted? {captions.trusted(findings.arrays['records'])} Innovations are the force less what the filter predicted one step before, of the "
        "second half of the record; beside them the noise that they should not exceed by half: that of the force, or what the batch fit leaves.",
        [Column("run"), Column("filter"), Column("innovation, rms", "N"), Column("noise", "N"), Column("why")],
        rows,
    )


def _over_time(findings: Findings, run: str, title: str) -> Figure:
    table, ends = findings.arrays["online"], findings.arrays["side_by_side"]
    part = table[table["run"] == run]
    time = part["time"].to_numpy(float)
    panels = []
    for name in _SYMBOLS:
        if name not in part or part[name].isna().all():
            continue
        value, low, high = (part[column].to_numpy(float) for column in (name, f"{name}_low", f"{name}_high"))
        row = ends[(ends["run"] == run) & (ends["name"] == name)]
        batch = float(row["batch"].iloc[0]) if len(row) and row["batch"].notna().any() else float("nan")
        least, most = _scale(name, value, batch)
        marks: list[Mark] = [
            Band(time, np.clip(low, least, most), np.clip(high, least, most), "model", "filter, its 95 %"),
            Line(time, np.where((value >= least) & (value <= most), value, np.nan), "model", "filter"),
        ]
        if np.isfinite(batch):
            marks.append(Rule(y=batch, role="reference", label="batch fit"))
        panels.append(Panel(marks, Axis("time", "s"), Axis(_SYMBOLS[name], _UNITS[name]), _SYMBOLS[name]))
    return Figure(
        f"online_{run}",
        f"Parameters over time, {title}",
        f"When does the online filter find what the batch fit finds? {captions.found_online(part, ends[ends['run'] == run])} Line and band: the filter with the 95 % "
        "that it claims; grey: the batch fit of the whole record. What is off the scale at the start is cut.",
        "each parameter over time as the filter estimates it, with its band and the value of the batch fit",
        panels,
        columns=3,
        share_x=True,
    )


def _scale(name: str, value: np.ndarray, batch: float) -> tuple[float, float]:
    """Return between which limits a parameter is drawn."""
    late = value[value.size // 3 :]
    reference = np.r_[late, batch] if np.isfinite(batch) else late
    low, high = float(reference.min()), float(reference.max())
    size = max(abs(low), abs(high))
    room = max(high - low, 0.15 * size if name not in ("force_lag", "s_mr") else 0.6 * size)
    return low - 1.5 * room, high + (_CLIP - 1.0) * room


def _side_by_side(findings: Findings, run: str, title: str) -> Table:
    table = findings.arrays["side_by_side"]
    of_run = table[table["run"] == run].set_index("name")
    rows = []
    for name in [name for name in _TOLD if name in of_run.index]:
        row, factor = of_run.loc[name], _TOLD[name][1]
        off = row.get("difference")
        rows.append(
            [
                *told(name, row["batch"], row["batch_low"], row["batch_high"]),
                _cell(row.get("online"), row.get("online_low"), row.get("online_high"), factor),
                f"{100 * float(off):+.2f} %" if off is not None and np.isfinite(off) else "",
            ]
        )
    return Table(
        f"side_by_side_{run}",
        f"Both methods, {title}",
        f"Do both methods agree? {captions.agree(of_run.reset_index())} Value and half of the 95 % interval; of the filter, the state at the end and the half width "
        "that it claims. Only the batch column is a finding.",
        [
            Column("parameter"),
            Column("unit"),
            Column("batch fit"),
            Column("online filter"),
            Column("filter against batch"),
        ],
        rows,
    )


def told(name: str, value: float | None, low: float | None, high: float | None) -> tuple[str, str, str]:
    """Return name, unit, and value with half of its interval of a parameter, as the tables of both methods tell it."""
    unit, factor = _TOLD[name]
    return name, unit, _cell(value, low, high, factor)


def _cell(value: float | None, low: float | None, high: float | None, factor: float) -> str:
    """Return value and half width with the digits that the half width warrants."""
    if value is None or not np.isfinite(value):
        return "not determined"
    if low is None or high is None or not np.isfinite(high - low) or not high > low:
        return f"{factor * value:.5g}"
    half = 0.5 * factor * (high - low)
    decimals = int(np.clip(1 - np.floor(np.log10(half)), 0, 6))
    return f"{factor * value:.{decimals}f} ± {half:.{decimals}f}"
