"""The chapter of the report of `tpjb.dynamic` that tells how well the excitation tells the coefficients."""

from __future__ import annotations

import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Cell, Column, Figure, Line, Mark, Panel, Points, Table, Text, Value
from pipeline.rigs.tpjb.dynamic import answers


def evidence(findings: Findings) -> list[Figure | Table | Text]:
    """Return the blocks of the last chapter: products of the tones, tones, blocks."""
    arrays = findings.arrays
    blocks: list[Figure | Table | Text] = []
    if "products" in arrays:
        blocks.append(_products(arrays))
    if "inertia" in arrays:
        blocks.append(_inertia(arrays["inertia"]))
    if "tones" in arrays:
        table = arrays["tones"]
        snr = [c for c in table if c.startswith("snr_")]
        rows: list[list[Cell]] = [
            [
                str(r["point"]),
                float(r["frequency"]),
                _finite(r["condition"]),
                *(_finite(r[c]) for c in snr),
                "used" if r["used"] else str(r["reason"]),
            ]
            for _, r in table.iterrows()
        ]
        blocks.append(
            Table(
                "excitation",
                "Tones",
                f"Do both excitations tell both directions? {answers.of_tone_quality(table)} cond(D): condition of the two displacements, 1 is best, beyond 10 they are not independent. Signal to noise of the "
                "displacement in one block, in dB, for the first and second excitation.",
                [
                    Column("operating point"),
                    Column("tone", "Hz"),
                    Column("cond(D)", "1"),
                    *(Column(f"SNR {i + 1} (dB)", "1") for i in range(len(snr))),
                    Column(""),
                ],
                rows,
            )
        )
    if "blocks" in arrays:
        counted = (
            arrays["blocks"]
            .groupby(["point", "run", "excitation"], sort=False)
            .agg(blocks=("used", "size"), used=("used", "sum"), length=("length", "first"))
        )
        blocks.append(
            Table(
                "blocks",
                "Blocks",
                f"How many blocks count? {int(counted['used'].sum())} of {int(counted['blocks'].sum())}. Whole cycles of all tones, and of the shaft where the log is long enough. Blocks across a change of the excitation, or with "
                "a fault, are not used.",
                [
                    Column("operating point"),
                    Column("run"),
                    Column("excitation"),
                    Column("blocks"),
                    Column("used"),
                    Column("length", "s"),
                ],
                [
                    [*map(str, key), int(r["blocks"]), int(r["used"]), float(r["length"])]
                    for key, r in counted.iterrows()
                ],
            )
        )
    return blocks


def _inertia(table: pd.DataFrame) -> Table:
    return Table(
        "inertia",
        "Inertia of the stator that was taken off the force",
        "What was taken off the force? Mass and parallel stiffness of the stator as used, with standard errors where the source gives them.",
        [Column("operating point"), Column("m_s", "kg"), Column("k_s", "N/m"), Column("from")],
        [
            [
                str(r["point"]),
                Value(float(r["mass"]), _finite(r["mass_error"])),
                Value(float(r["stiffness"]), _finite(r["stiffness_error"])),
                str(r["source"]),
            ]
            for _, r in table.iterrows()
        ],
    )


def _finite(value: float) -> float | None:
    return None if pd.isna(value) else float(value)


def _products(arrays: dict[str, pd.DataFrame]) -> Figure:
    table = arrays["products"]
    panels = []
    for (point, kind), part in table.groupby(["point", "excitation"], sort=False):
        f = part["frequency"].to_numpy()
        marks: list[Mark] = [
            Points(f, part["amplitude"].to_numpy(), "measured", "at products of the tones"),
            Line(f, part["noise"].to_numpy(), "reference", "noise of the mean"),
        ]
        panels.append(
            Panel(
                marks, Axis("frequency", "Hz"), Axis("amplitude", "m", "log"), f"{point}, {str(kind).replace('_', '-')}"
            )
        )
    shares = arrays["shares"]
    told = "; ".join(
        f"{r['point']}, {r['excitation'].replace('_', '-')}: {100 * r['share']:.2g} ± {200 * r['std_error']:.1g} %"
        for _, r in shares.iterrows()
    )
    return Figure(
        "products",
        "Motion where a linear bearing has none",
        f"Is the bearing linear at this amplitude? {answers.of_products(shares)} Displacement at sums and differences of the tones (with tones at odd multiples of one "
        f"frequency: its even multiples), beside its noise. All of it over the motion at the tones: {told}.",
        "displacement amplitude at second-order products against frequency, with the noise level",
        panels,
        columns=2,
        share_x=True,
    )
