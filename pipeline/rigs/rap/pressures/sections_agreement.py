"""How far device and bench agree: Bland-Altman, Deming, coherence at the pump's lines (rap.md, section 7, items 2 and 3)."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import (
    Axis,
    Band,
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
    Value,
)
from pipeline.rigs.rap.conditions import TAP_NAMES, TAPS
from pipeline.rigs.rap.pressures import captions
from pipeline.rigs.rap.pressures.declaration import MMHG
from pipeline.rigs.rap.pressures.sections_alignment import Blocks, by_run, of_run
from pipeline.rigs.rap.wording import grouped

if TYPE_CHECKING:
    import pandas as pd

_KINDS = {
    "samples": "samples",
    "means": "means of 5 s",
    "amplitude": "stroke amplitude",
    "as logged": "samples, only shifted",
}


def of_agreement(findings: Findings) -> Blocks:
    """Return Bland-Altman plots of samples and means, and the table of limits in Pa and mmHg."""
    blocks: Blocks = []
    for run, points in by_run(findings.arrays["bland_altman"]):
        limits = findings.arrays["agreement"]
        limits = limits[limits["run"] == run]
        panels = [
            _bland_altman(points[(points["channel"] == tap) & (points["kind"] == kind)], _row(limits, tap, kind), f"{TAP_NAMES[tap]}, {_KINDS[kind]}")
            for tap in TAPS
            for kind in ("samples", "means")
            if ((points["channel"] == tap) & (points["kind"] == kind)).any()
        ]  # fmt: skip
        blocks.append(
            Figure(
                f"bland_altman_{run}", f"Bland-Altman{of_run(findings, run)}",
                f"How far may a device reading be from the bench's? {captions.agreement(limits)} Differences over means after clocks and bandwidth were made equal, nothing else corrected: "
                "left single samples (some of them drawn), right means of 5 s. Bands are 95 % intervals of bias and limits from blocks of 20 s; neighbouring samples are no "
                "independent ones.",
                "differences of device and bench over their mean with bias and limits of agreement, tap by tap", panels, columns=2,
            )
        )  # fmt: skip
        blocks += _limits(findings, run, limits)
    return blocks


def _row(limits: pd.DataFrame, tap: str, kind: str) -> pd.Series | None:
    rows = limits[(limits["channel"] == tap) & (limits["kind"] == kind)]
    return rows.iloc[0] if len(rows) else None


def _bland_altman(points: pd.DataFrame, limit: pd.Series | None, title: str) -> Panel:
    x, y = points["mean"].to_numpy(), points["difference"].to_numpy()
    marks: list[Mark] = [Points(x, y, "measured")]
    if limit is not None:
        ends = np.array([x.min(), x.max()])
        for name, role in (("bias", "model"), ("lower", "residual"), ("upper", "residual")):
            low, high = float(limit[f"{name}_low"]), float(limit[f"{name}_high"])
            if np.isfinite([low, high]).all():
                marks.append(Band(ends, np.full(2, low), np.full(2, high), "model" if role == "model" else "residual"))
            marks.append(
                Rule(
                    y=float(limit[name]), role="model" if role == "model" else "residual", label=f"{limit[name]:.0f} Pa"
                )
            )
    return Panel(marks, Axis("mean of both", "mmHg"), Axis("device - bench", "Pa"), title)


def _limits(findings: Findings, run: str, limits: pd.DataFrame) -> Blocks:
    rows: list[list[Cell]] = [
        [
            TAP_NAMES.get(str(r["channel"]), str(r["channel"])), _KINDS.get(str(r["kind"]), str(r["kind"])), _value(r, "bias"), _value(r, "lower"),
            _value(r, "upper"), *(round(float(r[name]) / MMHG, 2) * MMHG + 0.0 for name in ("bias", "lower", "upper")),
            round(0.5 * float(r["upper"] - r["lower"]) / MMHG, 2) * MMHG, int(r["n"]), int(r["blocks"]),
        ]
        for r in limits.to_dict("records")
    ]  # fmt: skip
    columns = [
        Column("tap"), Column("of"), Column("bias", "Pa"), Column("lower limit", "Pa"), Column("upper limit", "Pa"),
        *(Column(name, "mmHg") for name in ("bias", "lower limit", "upper limit", "half width")), Column("n"), Column("blocks"),
    ]  # fmt: skip
    return [
        Table(
            f"limits_{run}", f"Limits of agreement{of_run(findings, run)}",
            f"Bias and bias -/+ 1.96 standard deviations with 95 % intervals. {captions.equalised(limits)} The findings carry those of samples; those 'only shifted' keep the device's filter delay in and "
            "show what equalising is worth.",
            columns, rows,
        ),
        *_trends(findings, run, limits),
    ]  # fmt: skip


def _trends(findings: Findings, run: str, limits: pd.DataFrame) -> Blocks:
    """Return whether the difference grows with the pressure, by tap."""
    known = limits[limits["slope"].notna()]
    if known.empty:
        return []
    rows: list[list[Cell]] = [
        [
            TAP_NAMES.get(str(r["channel"]), str(r["channel"])), Value(float(r["slope"]), float(r["slope_sd"])),
            Status("grows with pressure", "warning") if _grows(r) else Status("none seen", "ok"),
        ]
        for r in known.to_dict("records")
    ]  # fmt: skip
    told = grouped(((TAP_NAMES.get(str(r["channel"]), str(r["channel"])), "it grows" if _grows(r) else "no slope is seen") for r in known.to_dict("records")), "every tap")  # fmt: skip
    caption = f"Does the difference grow with the pressure? {told[0].upper()}{told[1:]}. Slope of the difference over the mean of both (5 s means): where there is one, limits about a constant bias hold at mid-range only, and gain and offset say more."
    return [
        Table(
            f"trend_{run}",
            f"Proportional bias{of_run(findings, run)}",
            caption,
            [Column("tap"), Column("slope"), Column("")],
            rows,
        )
    ]


def _grows(row: dict[Hashable, Any]) -> bool:
    return bool(abs(row["slope"]) > 2.6 * row["slope_sd"])


def _value(row: dict[Hashable, Any], name: str) -> Value:
    low, high = float(row[f"{name}_low"]), float(row[f"{name}_high"])
    return Value(float(row[name]), None, (low, high) if np.isfinite([low, high]).all() else None)


def of_gains(findings: Findings) -> Blocks:
    """Return the Deming lines with bands and the table of gain, offset and pole with their judgement."""
    blocks: Blocks = []
    for run, points in by_run(findings.arrays["deming_points"]):
        bands = findings.arrays["deming_band"]
        panels = [
            _deming(
                points[points["channel"] == tap],
                bands[(bands["run"] == run) & (bands["channel"] == tap)],
                TAP_NAMES[tap],
            )
            for tap in TAPS
            if (points["channel"] == tap).any()
        ]
        blocks.append(
            Figure(
                f"deming_{run}", f"Deming regression{of_run(findings, run)}",
                f"What are gain and offset of the device? {captions.gains(findings.arrays['gains'], run)} Means of 5 s of the device less those of the bench, over the bench's, with the line of Deming's regression and its "
                "95 % band. Raw pulsating samples would give a gain several per cent too low.",
                "device less bench over bench with regression line, tap by tap", panels, columns=2,
            )
        )  # fmt: skip
    table = findings.arrays["gains"]
    if table.empty:
        return blocks
    several = table["run"].nunique() > 1
    rows: list[list[Cell]] = [
        [
            *([str(r["run"])] if several else []), TAP_NAMES.get(str(r["channel"]), str(r["channel"])), _interval(r, "gain"), _interval(r, "offset"), _interval(r, "offset"),
            Value(float(r["pole"]) if np.isfinite(r["pole"]) else None), float(r["pulsation_gain"]) if np.isfinite(r["pulsation_gain"]) else None,
            Status(str(r["gain_word"]), r["gain_mood"]), Status(str(r["offset_word"]), r["offset_mood"]),
        ]
        for r in table.to_dict("records")
    ]  # fmt: skip
    columns = [*([Column("run")] if several else []), Column("tap"), Column("gain"), Column("offset", "Pa"), Column("offset", "mmHg"), Column("pole", "s"), Column("gain of the pulsation"), Column("gain within tolerance"), Column("offset within tolerance")]  # fmt: skip
    caption = (
        "Gain and offset from Deming's regression on means of 5 s (95 % from blocks), pole and gain of the pulsation from the pump's lines (eq. 2). Both gains should be one: "
        "a pulsation that is damped tells of air."
    )
    return [*blocks, Table("gains", "Gain, offset and pole of the device", caption, columns, rows)]


def _interval(row: dict[Hashable, Any], name: str) -> Value:
    if not np.isfinite(row[name]):
        return Value(None)
    low, high = float(row[f"{name}_low"]), float(row[f"{name}_high"])
    return Value(float(row[name]), None, (low, high) if np.isfinite([low, high]).all() else None)


def _deming(points: pd.DataFrame, band: pd.DataFrame, title: str) -> Panel:
    x = points["bench"].to_numpy()
    marks: list[Mark] = []
    if len(band):
        at = band["bench"].to_numpy()
        marks += [
            Band(at, band["low"].to_numpy() - at, band["high"].to_numpy() - at, "model", "95 %"),
            Line(at, band["fit"].to_numpy() - at, "model", "Deming"),
        ]
    marks += [Rule(y=0.0), Points(x, points["device"].to_numpy() - x, "measured", "means of 5 s")]
    return Panel(marks, Axis("bench", "mmHg"), Axis("device - bench", "Pa"), title)


def of_coherence(findings: Findings) -> Blocks:
    """Return coherence at the pump's lines with its threshold, and the table."""
    blocks: Blocks = []
    for run, rows in by_run(findings.arrays["coherence"]):
        panels = []
        for tap in [tap for tap in TAPS if (rows["channel"] == tap).any()]:
            one = rows[rows["channel"] == tap]
            marks: list[Mark] = []
            for number, (flow, part) in enumerate(one.groupby("flow_set", sort=True)):
                marks.append(
                    Points(
                        part["frequency"].to_numpy(),
                        part["coherence"].to_numpy(),
                        number,
                        f"{6e7 * float(str(flow)):.3g} mL/min",
                    )
                )
            marks.append(Rule(y=float(one["threshold"].median()), role="reference"))
            panels.append(Panel(marks, Axis("frequency", "Hz"), Axis("coherence"), TAP_NAMES[tap]))
        blocks.append(
            Figure(
                f"coherence_{run}", f"Coherence at the pump's lines{of_run(findings, run)}",
                f"Up to which harmonic do both see the same pulsation? {captions.coherent(rows)} Coherence at each line and set-point (Welch, 256 samples, Hann, half overlapping); below the dashed 95 % threshold it is chance. "
                "Between the lines there is noise only, and coherence says nothing.",
                "coherence of device and bench at the harmonics of the pump, tap by tap", panels, columns=2,
            )
        )  # fmt: skip
        blocks.append(_coherence_table(findings, run, rows))
    return blocks


def _coherence_table(findings: Findings, run: str, rows: pd.DataFrame) -> Table:
    """Return one row for each tap and set-point: coherence and |H| of each harmonic."""
    orders = sorted({int(k) for k in rows["harmonic"]})
    cells: list[list[Cell]] = []
    for (tap, _), part in rows.groupby(["channel", "flow_set"], sort=False, dropna=False):
        by = {int(r["harmonic"]): r for r in part.to_dict("records")}
        first = by[min(by)]
        set_ = float(first["flow_set"])
        cells.append([
            TAP_NAMES[str(tap)], set_ if np.isfinite(set_) else None, float(first["frequency"]) / min(by), round(float(first["threshold"]), 3),
            *(_seen(by[k]) if k in by else None for k in orders),
        ])  # fmt: skip
    columns = [
        Column("tap"),
        Column("set-point", "mL/min"),
        Column("strokes", "Hz"),
        Column("threshold"),
        *(Column(f"k = {k}") for k in orders),
    ]
    caption = (
        "Coherence of device and aligned bench at the k-th harmonic, and in brackets |H|, device over bench there without any equalising; – where the coherence does not "
        "stand above chance. An asterisk marks lines above half the sampling rate, which fold back."
    )
    return Table(
        f"coherence_table_{run}", f"Coherence and |H| at the lines{of_run(findings, run)}", caption, columns, cells
    )


def _seen(line: dict[Hashable, Any]) -> str:
    mark = "*" if line["folded"] else ""
    if line["coherence"] <= line["threshold"]:
        return f"–{mark}"
    return f"{min(float(line['coherence']), 0.9999):.4f}{mark} ({line['gain']:.2f})"
