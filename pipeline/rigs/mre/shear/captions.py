"""What captions answer, read from the tables of the findings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pipeline.rigs.mre.shear.sections_field import level_text

if TYPE_CHECKING:
    import pandas as pd

_OTHER = {"frequency": "amplitude", "amplitude": "frequency"}


def followed(runs: pd.DataFrame) -> str:
    """Say of which run the model misses most of the force; '' where no model was fitted."""
    known = runs[runs["nrmse"].notna()] if "nrmse" in runs else runs.iloc[:0]
    if known.empty:
        return ""
    worst = known.iloc[int(known["nrmse"].argmax())]
    half = float(known["nrmse"].median())
    most = f"at most {_percent(worst['nrmse'])} (run {worst['run']})"
    return f"It misses {_percent(half)} of the force's rms in the middle run, {most}."


def missed(loops: pd.DataFrame) -> str:
    """Say how much of the force the residual loops reach; '' where there are none."""
    left = loops["residual"].abs().groupby(loops["run"]).max()
    reach = left / loops["force"].abs().groupby(loops["run"]).max()
    if not reach.notna().any():
        return ""
    worst = str(reach.idxmax())
    return f"At most {_percent(reach.loc[worst])} of the largest force, {left.loc[worst]:.2g} N (run {worst})."


def course(runs: pd.DataFrame, over: str) -> str:
    """Say from where to where stiffness and damping go at the lowest current at which `over` varies; '' where at none."""
    for level, part in runs.groupby(runs["current"].astype(float).round(1), dropna=False):
        ends = part.loc[[part[over].idxmin(), part[over].idxmax()]]
        low, high = (row for _, row in ends.iterrows())
        if high[over] <= 1.05 * low[over]:
            continue
        where = f"At {level_text(float(level))}, " if math.isfinite(level) else ""
        told = (
            f"{where}secant stiffness goes from {low['stiffness_secant'] / 1e3:.3g} to {high['stiffness_secant'] / 1e3:.3g} "
            f"kN/m and damping from {low['damping'] / 1e3:.3g} to {high['damping'] / 1e3:.3g} kN s/m between {_place(low, over)} and {_place(high, over)}."
        )
        return told[0].upper() + told[1:]
    return ""


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _place(row: pd.Series, over: str) -> str:
    at = {"frequency": f"{row['frequency']:.3g} Hz", "amplitude": f"{1e3 * row['amplitude']:.3g} mm"}
    return f"{at[over]} ({at[_OTHER[over]]})"
