"""Speeds of all members, and what the vibration shows: mesh lines over time, order spectra, level by stage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Points, Rule, Table, Text
from pipeline.rigs.gearbox.outcome import captions
from pipeline.rigs.gearbox.outcome.sections_runs import STAGES, of_run, records, shown_runs

if TYPE_CHECKING:
    import pandas as pd

_MEMBERS = {
    "carrier_1": "input carrier", "carrier_2": "output carrier", "ring": "ring frame", "sun": "sun shaft",
    "planet_1": "planets of train 1", "planet_2": "planets of train 2", "mesh_1": "mesh of train 1", "mesh_2": "mesh of train 2",
}  # fmt: skip


def of_speeds(findings: Findings) -> list[Figure | Table | Text]:
    """Return the table of all members' speeds in FOS and SOS."""
    members = findings.arrays["members"]
    if members.empty:
        return []
    blocks: list[Figure | Table | Text] = []
    for run in shown_runs(findings):
        own = of_run(members, run)
        if own.empty:
            continue
        speeds = [row for row in records(own) if not str(row["member"]).startswith("mesh")]
        meshes = [row for row in records(own) if str(row["member"]).startswith("mesh")]
        rows: list[list[Cell]] = [
            [
                _MEMBERS[str(row["member"])],
                round(row["fos"], 2),
                round(row["sos"], 2) + 0.0 if np.isfinite(row["sos"]) else None,
            ]
            for row in speeds
        ]
        source = str(own["source"].iloc[0])
        told = ", ".join(
            f"{_MEMBERS[str(row['member'])]} {row['sos']:.1f} Hz" for row in meshes if np.isfinite(row["sos"])
        )
        blocks.append(
            Table(
                f"members_{run}", f"Speeds of all members, run {run}",
                f"From the measured output speed (FOS) and in SOS from: {source or 'no SOS in this run'}. Locked, all turn as one body "
                f"and no gears mesh; in SOS {told or 'nothing is known'}.",
                [Column("member"), Column("FOS", "rad/s"), Column("SOS", "rad/s")], rows,
            )
        )  # fmt: skip
    return blocks


def of_vibration(findings: Findings) -> list[Figure | Table | Text]:
    """Return the chapter on vibration; empty where there is no log of it."""
    return [*_lines(findings), *_orders(findings), *_levels(findings)]


def _of(findings: Findings, name: str) -> pd.DataFrame:
    """Return the rows of the runs that are shown."""
    table: pd.DataFrame = findings.arrays[name]
    return table.loc[table["run"].isin(shown_runs(findings))]


def _lines(findings: Findings) -> list[Figure]:
    peaks, ridge = findings.arrays["spectral_peaks"], findings.arrays["ridge"]
    panels = []
    for run in shown_runs(findings):
        own, slip = of_run(peaks, run), of_run(ridge, run)
        if own.empty:
            continue
        marks: list[Mark] = []
        for k, (low, high, label) in enumerate(
            ((10.0, 100.0, "10 to 20 dB above the floor"), (100.0, 1e3, "20 to 30 dB"), (1e3, np.inf, "above 30 dB"))
        ):
            part = own[(own["contrast"] >= low) & (own["contrast"] < high)]
            if len(part):
                marks.append(Points(part["time"].to_numpy(), part["frequency"].to_numpy(), k, label))
        time = slip["time"].to_numpy()
        for order in sorted(dict.fromkeys(ridge["order_2"])) + sorted(dict.fromkeys(ridge["order_1"])):
            line = order * slip["slip"].to_numpy() / (2 * np.pi)
            marks.append(Line(time, line, "model", f"{order:g} s/2π"))
        panels.append(Panel(marks, Axis("time", "s"), Axis("frequency", "Hz"), f"run {run}"))
    if not panels:
        return []
    return [
        Figure(
            "mesh_lines", "Lines of the vibration over time",
            f"Do the gears slip only in SOS and on the way there and back? {captions.slips(_of(findings, 'stages'), _of(findings, 'ridge'))} Strong spectral lines (windows of 0.2 s) and the mesh lines of "
            "the slip s that fits them best: they vanish where the gears are locked.",
            "time and frequency of strong spectral lines with the mesh lines of both trains", panels, columns=2,
        )
    ]  # fmt: skip


def _orders(findings: Findings) -> list[Figure]:
    orders = findings.arrays["orders"]
    panels = []
    for run in shown_runs(findings):
        for stage, shaft in (("fos", "output shaft"), ("sos", "input shaft")):
            own = orders[(orders["run"] == run) & (orders["stage"] == stage)]
            if own.empty:
                continue
            marks: list[Mark] = [Line(own["order"].to_numpy(), own["amplitude"].to_numpy(), "measured")]
            if stage == "sos":
                marks += [
                    Rule(x=order, label=f"{order:g}")
                    for order in dict.fromkeys([*own["order_2"].iloc[:1], *own["order_1"].iloc[:1]])
                ]
            axis = Axis(f"order of the {shaft}")
            panels.append(Panel(marks, axis, Axis("amplitude", "m/s^2", "log"), f"{stage.upper()}, run {run}"))
    if not panels:
        return []
    return [
        Figure(
            "orders", "Order spectra, locked against slipping",
            f"Which orders does the gearbox excite? {captions.strongest(_of(findings, 'orders'))} Locked gears leave shaft orders only; mesh orders in FOS would be partial slip.",
            "amplitude spectra over the order of the shaft in FOS and SOS", panels, columns=2,
        )
    ]  # fmt: skip


def _levels(findings: Findings) -> list[Table]:
    vibration = findings.arrays["vibration"]
    if vibration.empty:
        return []
    stages = [stage for stage in STAGES if stage in set(vibration["stage"])]
    rows: list[list[Cell]] = []
    shown = shown_runs(findings)
    for (run, channel), part in vibration[vibration["run"].isin(shown)].groupby(["run", "channel"], sort=False):
        by = {str(row["stage"]): row for row in records(part)}
        rows.append(
            [str(run), captions.channel(str(channel)), *(round(by[s]["rms"], 3) if s in by else None for s in stages)]
        )
    return [
        Table(
            "vibration", "Vibration by stage",
            f"{captions.shaken(_of(findings, 'vibration'))} Root mean square above 2 Hz. Crest factor and kurtosis stand in arrays/vibration.parquet.",
            [Column("run"), Column("channel"), *(Column(STAGES[s], "m/s^2") for s in stages)], rows,
        )
    ]  # fmt: skip
