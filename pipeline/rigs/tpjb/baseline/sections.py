"""What the report of `tpjb.baseline` shows, drawn from parameters and arrays only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
    ratio.append(Line(curve["frequency"].to_numpy(), curve["mass"].to_numpy(), "model", "m_s - k_s/w²"))
    figure = Figure(
        "ratio",
        "Force over acceleration",
        "Is the stator a mass on springs? Real part of force over acceleration at each tone with 95 % intervals (u and v set apart "
        "for reading), the fitted m_s - k_s/w², and what it leaves. Points off the line: contact, a resonance of the bench.",
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
        "The imaginary part tells damping of the hoses, or a lag between force and acceleration; it does not enter.",
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
