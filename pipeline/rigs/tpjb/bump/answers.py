"""What the captions of a bump test answer, from what was found: so that they stay true of any other campaign."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.errors import listing
from pipeline.findings import Findings
from pipeline.findings.figures import Panel, Points, Value


def value_of(findings: Findings, name: str, bearing: str, **at: float) -> Value | None:
    """Return the clearance, stiffness or the like at that place as a cell; None where there is none."""
    full = {**at, **({"bearing": bearing} if any("bearing" in p.at for p in findings.parameters) else {})}
    found = [p for p in findings.parameters if p.name == name and p.at == full]
    return Value(found[0].value, found[0].std_error, found[0].ci95) if found else None


def all_round(findings: Findings, bearing: str, sides: pd.DataFrame) -> str:
    """Return the answer to whether the stator went all round, with the mean clearance where it is told."""
    missed = [f"{row['side']} in plane {row['plane']}" for row in sides[~sides["touched"]].to_dict("records")]
    went = f"No: never at side {listing(missed, 6)}." if missed else "Yes: every side was touched."
    means = {int(p): value_of(findings, "clearance", bearing, plane=float(p)) for p in sorted(sides["plane"].unique())}
    told = [f"{_with_interval(mean, 1e3, 'mm')} in plane {p}" for p, mean in means.items() if mean and mean.value]
    return f"{went} Mean clearance {listing(told, 4)}." if told else went


def _with_interval(value: Value, scale: float, unit: str) -> str:
    """Return a value with half of its 95 % interval, in the digits that this warrants."""
    number = scale * (value.value or 0.0)
    if value.ci95 is None or not value.ci95[1] > value.ci95[0]:
        return f"{number:.3g} {unit}"
    half = scale * (value.ci95[1] - value.ci95[0]) / 2
    digits = max(1 - math.floor(math.log10(half)), 0)
    return f"{number:.{digits}f} ± {half:.{digits}f} {unit}"


def spread(sides: pd.DataFrame) -> str:
    """Return how far the sides of a plane differ, the plane in which they do most."""
    known = sides[np.isfinite(sides["clearance"])]
    if known.empty:
        return "No side's distance can be told."
    ends = known.groupby("plane")["clearance"].agg(["min", "max"])
    plane = (ends["max"] - ends["min"]).idxmax()
    low, high = ends.loc[plane]
    return (
        f"Sides of plane {plane} differ most: {1e3 * low:.4f} to {1e3 * high:.4f} mm, by {1e6 * (high - low):.1f} um."
    )


def converged(findings: Findings, levels: pd.DataFrame, k_p: Value | None) -> str:
    """Return the growth between the two largest forces against the limit of the settings."""
    largest = [part.sort_values("force").tail(2) for _, part in levels.groupby("plane")]
    steps = [np.diff(part[["force", "clearance"]].to_numpy(), axis=0) for part in largest]
    growth = max(float(step[0, 1] / step[0, 0]) for step in steps if step.size)
    limit, pad = float(findings.settings.get("growth_limit", 1e-9)), ""
    if k_p is not None and k_p.value:
        limit, pad = min(limit, 1.5 / k_p.value), f"; a pad alone gives way by {1e9 / k_p.value:.2f} um/kN"
    word = "Yes" if growth <= limit else "No"
    return f"{word}: it grows by {1e9 * growth:.2f} um/kN between the two largest forces, allowed are {1e9 * limit:.2g} um/kN{pad}."


def steady(levels: pd.DataFrame) -> str:
    """Return by how much centre and rotation move over the forces, the plane in which they do most."""
    if levels["force"].nunique() < 2:
        return "Only one force was applied."
    moved = levels.groupby("plane")[["center_x", "center_y", "rotation"]].agg(np.ptp).max()
    return (
        f"The centre moves by no more than {1e6 * max(moved['center_x'], moved['center_y']):.2g} um and the rotation by no "
        f"more than {1e3 * moved['rotation']:.2g} mrad."
    )


def left_over(findings: Findings, panels: Sequence[Panel]) -> str:
    """Return the rms of what is drawn, and the chi-square of the contact law."""
    shown = np.concatenate([mark.y for panel in panels for mark in panel.marks if isinstance(mark, Points)])
    shown = shown[np.isfinite(shown)]
    rms = f"{1e9 * float(np.sqrt(np.mean(shown**2))):.2g} nm rms" if shown.size else "nothing drawn"
    chi2 = next((m.chi2_reduced for m in findings.models if m.selected and m.chi2_reduced is not None), None)
    told = f"; chi2 of the law is {chi2:.2f} a degree of freedom, noise alone gives 1" if chi2 is not None else ""
    return f"What is left is {rms}{told}."


def three_digits(value: float) -> float | None:
    """Return a number with three digits, None for one that is not finite."""
    return float(f"{value:.3g}") + 0.0 if math.isfinite(value) else None
