"""Transmembrane pressure and the membrane's coefficient over time, with the fit and the temperature (rap.md, section 7, item 7)."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Band, Cell, Column, Figure, Line, Mark, Panel, Points, Table, Text
from pipeline.rigs.in_words import chance
from pipeline.rigs.rap.therapy.outcome import captions
from pipeline.rigs.rap.therapy.outcome.frames import of_run, records, runs_of, time_axis
from pipeline.rigs.rap.therapy.outcome.sections_volume import value_of


def of_membrane(findings: Findings) -> list[Figure | Table | Text]:
    """Return the chapter on the membrane."""
    table = findings.arrays["membrane"]
    blocks: list[Figure | Table | Text] = [_course(findings, run) for run in runs_of(table)]
    rows: list[list[Cell]] = []
    for run in runs_of(findings.arrays["parts"]):
        initial, decline = (next(iter(findings.find(name, run=run)), None) for name in ("k_uf_initial", "k_uf_decline"))
        more = next(iter(records(of_run(findings.arrays["decline"], run))), None)
        if initial is None or decline is None or (initial.value is None and decline.value is None):
            continue
        extra = [_told(more, name) for name in ("naive_sd", "p", "blocks")]
        rows.append([run, value_of(initial), value_of(decline), *extra])
    if rows:
        blocks.append(
            Table(
                "membrane", "Coefficient of the membrane",
                "K(t) = K₀/(1 + a t/5 h). Errors from blocks of 40 min: values of one minute are strongly correlated, and the naive standard error "
                "beside them is too small. p: chance of so large a trend where there is none.",
                [Column("Run"), Column("K₀", "mL/h/mmHg"), Column("a"), Column("Naive error of a"), Column("p"), Column("Blocks")], rows,
            )
        )  # fmt: skip
    told = list(dict.fromkeys(str(row["text"]) for row in records(findings.arrays["explanations"])))
    return [*blocks, Text([f"What else would look like this trend: {'; '.join(told)}."])] if told else blocks


def _told(row: dict[str, Any] | None, name: str) -> Cell:
    value = float(row[name]) if row else np.nan
    if not np.isfinite(value):
        return None
    if name == "p":
        return chance(value)
    return f"{value:.2g}" if name == "naive_sd" else f"{value:.1f}"


def _course(findings: Findings, run: str) -> Figure:
    own = of_run(findings.arrays["membrane"], run)
    axis, time = time_axis(own), own["time"].to_numpy()
    k, sd, used = (own[name].to_numpy() for name in ("k", "k_sd", "used"))
    taken = used == 1.0
    marks: list[Mark] = []
    low, high = own["low"].to_numpy(), own["high"].to_numpy()
    if np.isfinite(low).any():
        marks.append(Band(time, low, high, "model", "95 % of the fit"))
    marks.append(Points(time[taken], k[taken], "measured", "60 s means"))
    if np.isfinite(sd[taken]).any():
        marks.append(
            Band(
                time,
                np.where(taken, k - 2.0 * sd, np.nan),
                np.where(taken, k + 2.0 * sd, np.nan),
                "reference",
                "± 2 sd of the pump's gain",
            )
        )
    fitted = own["fitted"].to_numpy()
    if np.isfinite(fitted).any():
        marks.append(Line(time, fitted, "model", "fit"))
    panels = [
        Panel([Line(time, own["tmp"].to_numpy(), "measured")], axis, Axis("TMP", "mmHg"), "transmembrane pressure"),
        Panel(marks, axis, Axis("Kuf", "mL/h/mmHg"), "coefficient of the membrane"),
    ]
    air = own["air"].to_numpy()
    if np.isfinite(air).any():
        panels.append(Panel([Line(time, air, 1)], axis, Axis("air in the housing", "degC"), "temperature"))
    return Figure(
        f"membrane_{run}", f"Run {run}: membrane",
        f"Does the membrane clog? {captions.membrane(findings, run)} Transmembrane pressure from zeroed means, rate of the ultrafiltrate over it, and the air's temperature, which "
        "moves viscosity by some 2 % a kelvin.",
        f"transmembrane pressure, membrane coefficient with its fit and air temperature of run {run} over time", panels, columns=len(panels), share_x=True,
    )  # fmt: skip
