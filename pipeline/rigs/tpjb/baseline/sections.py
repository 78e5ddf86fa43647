"""What the report of `tpjb.baseline` shows, drawn from parameters and arrays only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.findings import Findings
from pipeline.findings.figures import Axis, Column, Figure, Line, Mark, Panel, Points, Rule, Section, Table, Value


def sections(findings: Findings) -> Sequence[Section]:
    """Return the one chapter: force over acceleration against frequency, and what the fit leaves."""
    table, curve = findings.arrays["ratios"], findings.arrays["curve"]
    axis = Axis("frequency", "Hz")
    ratio: list[Mark] = []
    rest: list[Mark] = []
    for number, name in enumerate("uv"):
        part = table[table["axis"] == name]
        if part.empty:
            continue
        f = part["frequency"].to_numpy() + (0.12 if number else -0.12)
        ratio.append(
            Points(f, part["mass"].to_numpy(), number, f"along {name}", part["low"].to_numpy(), part["high"].to_numpy())
        )
        left = part["residual"].to_numpy()
        half = (part["high"] - part["low"]).to_numpy() / 2
        rest.append(Points(f, left, number, f"along {name}", left - half, left + half))
    ratio.append(Line(curve["frequency"].to_numpy(), curve["mass"].to_numpy(), "reference", "fit, m_s − k_s/ω²"))
    figure = Figure(
        "ratio",
        "Force over acceleration",
        f"Is the stator a mass on springs? {_answer(table)} Real part of force over acceleration at each tone with 95 % intervals "
        "(u and v set apart for reading), the fitted m_s − k_s/ω², and what it leaves. Points off the line would be contact, or a "
        "resonance of the bench.",
        "force over acceleration against frequency with the fitted curve; below the residuals",
        [Panel(ratio, axis, Axis("Re(F/a)", "kg")), Panel([*rest, Rule(y=0.0)], axis, Axis("residual", "kg"))],
        columns=2,
    )
    rows = [
        [f, part, kind.replace("_", "-"), Value(mass, sd), Value(imaginary, sd)]
        for f, part, kind, mass, imaginary, sd in zip(
            *(table[name] for name in ("frequency", "axis", "excitation", "mass", "imaginary", "std_error")),
            strict=True,
        )
    ]
    listing = Table(
        "ratios",
        "Ratios of force to acceleration",
        f"Is there damping, or a lag? {_lag(table)} The imaginary part tells damping of the hoses, or a lag between force and "
        "acceleration; it does not enter.",
        [
            Column("frequency", "Hz"),
            Column("axis"),
            Column("excitation"),
            Column("Re(F/a)", "kg"),
            Column("Im(F/a)", "kg"),
        ],
        rows if np.isfinite(table["mass"]).all() else [],
    )
    return [Section("ratio", "Force over acceleration", [figure, listing])]


def _answer(table: pd.DataFrame) -> str:
    """Return how many tones lie on the fit within their intervals, and the largest that is left."""
    left = table["residual"].to_numpy()
    half = (table["high"] - table["low"]).to_numpy() / 2
    known = np.isfinite(left) & np.isfinite(half)
    if not known.any():
        return "It cannot be told, no ratio was found."
    on = int((np.abs(left) <= half)[known].sum())
    most = float(np.abs(left[known]).max())
    return (
        f"{on} of {int(known.sum())} ratios lie on the fit within their 95 % intervals; at most {most:.2g} kg are left."
    )


def _lag(table: pd.DataFrame) -> str:
    """Return how many imaginary parts stand out of their errors, and the largest."""
    size, sd = table["imaginary"].abs().to_numpy(), table["std_error"].to_numpy()
    known = np.isfinite(size) & np.isfinite(sd)
    if not known.any():
        return "It cannot be told."
    out = int((size > 3 * sd)[known].sum())
    most = f"the largest imaginary part is {float(size[known].max()):.2g} kg"
    return f"In {out} of {int(known.sum())} ratios; {most}." if out else f"None stands out of its error; {most}."
