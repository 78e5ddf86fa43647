"""What captions answer, read from the tables of the findings, and how they name a current."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pipeline.errors import listing
from pipeline.rigs.in_words import known

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.findings import Findings, Parameter

_EFFECTS = {"mr_effect_amplitude": "equal amplitude", "mr_effect_force": "equal force"}
LOOPS = {"stiffness_secant": ("K_sec", 1e3, "kN/m"), "loss_factor": ("loss factors", 1.0, "")}
MODULI = {"shear_modulus_storage": ("G'", 1e6, "MPa"), "shear_modulus_loss": ("G''", 1e6, "MPa")}
_ODD = 3.0  # times the middle run, and times what noise explains
_OTHER = {"frequency": "amplitude", "amplitude": "frequency"}


def level_text(current: float | None) -> str:
    """Return a current for a label, an empty text where there is none."""
    return "" if current is None or not math.isfinite(current) else f"{round(current, 2):g} A"


def followed(runs: pd.DataFrame) -> str:
    """Say of which run the model misses most of the force; '' where no model was fitted."""
    known = runs[runs["nrmse"].notna()] if "nrmse" in runs else runs.iloc[:0]
    if known.empty:
        return ""
    worst = known.iloc[int(known["nrmse"].argmax())]
    half = float(known["nrmse"].median())
    most = f"at most {_percent(worst['nrmse'])} (run {worst['run']})"
    return f"It misses {_percent(half)} of the force's rms in the middle run, {most}."


def not_fitted(loops: pd.DataFrame) -> str:
    """Name the runs that are drawn without the model because the fit leaves them out; '' where there are none, or no model."""
    known = loops["model"].notna().groupby(loops["run"], sort=False).any()
    left = [str(run) for run in known.index[~known]]
    return f" Not in the fit, so drawn with their own harmonics: {listing(left, 6)}." if left and known.any() else ""


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


def between(runs: pd.DataFrame, names: Mapping[str, tuple[str, float, str]]) -> str:
    """Say between which runs each number goes; `names` are columns of it with a symbol, the size of a unit and the unit."""
    told = []
    for name, (symbol, size, unit) in names.items():
        low, high = (runs.iloc[int(at)] for at in (runs[name].argmin(), runs[name].argmax()))
        least, most = (_three(row[name] / size) for row in (low, high))
        told.append(f"{symbol} between {least} ({low['run']}) and {most}{unit and f' {unit}'} ({high['run']})")
    return f"{' and '.join(told)}."


def added(found: Sequence[Parameter], symbol: str, size: float, unit: str) -> str:
    """Say what the largest current adds, from a parameter in the order of the current."""
    return f"{symbol} = {known(found[-1], size, unit)} at {float(found[-1].at['coil_current']):g} A"


def off_the_model(agreement: pd.DataFrame) -> str:
    """Say how far the loop metrics are off the model's, and how many intervals hold it."""
    off = (agreement["ratio"] - 1).abs()
    holds = int(((agreement["low"] <= 1) & (agreement["high"] >= 1)).sum())
    told = f"{holds} of {len(agreement)} intervals (95 %) hold its number"
    return f"{told}; the farthest is {_percent(float(off.max()))} off (run {agreement['run'].iloc[int(off.argmax())]})."


def gained(findings: Findings) -> str:
    """Say what the largest current adds to the stiffness at each preload, at equal amplitude and at equal force."""
    found = [p for p in findings.parameters if p.name in _EFFECTS]
    if not found:
        return "Not told: there is no pair of a run with and one without current."
    top = max(float(p.at["coil_current"]) for p in found)
    told = []
    for name, where in _EFFECTS.items():
        at = [p for p in found if p.name == name and float(p.at["coil_current"]) == top]
        ends = [p for p in at if p.value is not None]
        ends = ends if len(ends) < 3 else [ends[0], ends[-1]]
        said = " and ".join(f"{known(p, 0.01, '%')} at {float(p.at.get('preload', 0.0)):g} N" for p in ends)
        if at:
            reason = at[0].description.rstrip(".")
            told.append(f"at {where} {said or f'not told ({reason})'}")
    return f"At {top:g} A, {'; '.join(told)}."


def stands_out(used: pd.DataFrame) -> str:
    """Say which run is met worst, and whether it is out of line with the others."""
    worst, middle = used.iloc[int(used["chi2_reduced"].argmax())], float(used["chi2_reduced"].median())
    most = float(worst["chi2_reduced"])
    odd = most > _ODD * max(middle, 1.0)
    answer = (
        f"Yes, {worst['run']}: chi2 per datum is {most:.3g}"
        if odd
        else f"No: chi2 per datum is at most {most:.3g} ({worst['run']})"
    )
    return f"{answer}, {middle:.2g} in the middle run."


def _three(value: float) -> str:
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}" if value else "0"


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _place(row: pd.Series, over: str) -> str:
    at = {"frequency": f"{row['frequency']:.3g} Hz", "amplitude": f"{1e3 * row['amplitude']:.3g} mm"}
    return f"{at[over]} ({at[_OTHER[over]]})"
