"""What the figures and tables of `rap.flow` answer, in words computed from the tables that they draw."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pipeline.findings import Findings
from pipeline.rigs.rap.flow.sets import CALIBRATION, HOLDOUT, called
from pipeline.rigs.rap.wording import joined, signed

if TYPE_CHECKING:
    import pandas as pd

MMHG = 133.322


def followed(errors: pd.DataFrame, estimators: Mapping[str, str]) -> str:
    """Return the largest error of each estimator over all sets, the best first."""
    worst = errors[errors["estimator"].isin(list(estimators))].groupby("estimator")["worst"].max().sort_values()
    if worst.empty:
        return "No window has both estimate and meter."
    found = [f"{name} within {100 * value:.3g} %" for name, value in worst.items()]
    return f"Over all runs and clamp settings {joined(found)} of the meter: so far off is the worst window."


def beyond(windows: pd.DataFrame, limit: float) -> str:
    """Return how many windows E2 and E3 miss by more than the limit."""
    told = []
    for name in ("E2", "E3"):
        off = windows[f"{name}_error"].dropna().abs()
        if len(off):
            told.append(f"{int((off > limit).sum())} of {len(off)} windows of {name}")
    return f"Beyond {100 * limit:.3g} % lie {joined(told)}." if told else ""


def held_out(errors: pd.DataFrame) -> str:
    """Return which of E2 and E3 predicts the hold-out better; '' without one."""
    own = errors[(errors["set"] == HOLDOUT) & errors["estimator"].isin(("E2", "E3"))]
    worst = own.groupby("estimator")["worst"].max().sort_values()
    if len(worst) < 2:
        return "There is no hold-out by which E2 and E3 could be judged."
    (best, least), (other, most) = worst.items()
    return f"By the hold-out {best} predicts better: it is off by {100 * least:.3g} % at most, {other} by {100 * most:.3g} %."


def laws(errors: pd.DataFrame) -> str:
    """Return what E2 and E3 leave of the calibration (rms) and where on the mean they lie off the others."""
    told = []
    for name in ("E3", "E2"):
        own = errors[errors["estimator"] == name]
        fit = own[own["group"] == called(CALIBRATION)]
        off = [f"{signed(100 * mean, 2)} % ({group})" for group, mean in zip(own["group"], own["mean"], strict=True) if group != called(CALIBRATION)]  # fmt: skip
        if len(fit):
            more = f" and on the mean is off by {joined(off)}" if off else ""
            told.append(f"{name} leaves {100 * float(fit['rms'].iloc[0]):.2g} % (rms) of the calibration{more}")
    return f"{'; '.join(told)}." if told else "Neither could be calibrated."


def means_held(findings: Findings, table: pd.DataFrame) -> str:
    """Return in how many cells of the table the meter lies within the estimate's interval."""
    within = of = 0
    for row in table.to_dict("records"):
        at = {"flow_set": float(row["flow_set"])} if np.isfinite(row["flow_set"]) else {}
        found = next(iter(findings.find("flow", run=str(row["run"]), estimator=str(row["estimator"]), **at)), None)
        if found is not None and found.ci95 is not None and np.isfinite(row["metered"]):
            of += 1
            within += found.ci95[0] <= row["metered"] <= found.ci95[1]
    return f"The meter's mean lies inside {within} of the {of} intervals." if of else ""


def fitted(example: pd.DataFrame, fit: pd.DataFrame) -> str:
    """Return what the fit leaves of the pulsation that is drawn, as a share of its swing."""
    shares = []
    for level in dict.fromkeys(example["flow_set"]):
        rows, line = (table[table["flow_set"] == level] if np.isfinite(level) else table for table in (example, fit))
        left = rows["measured"] - np.interp(rows["time"], line["time"], line["fitted"])
        shares.append(float(np.sqrt(np.mean(left**2)) / np.std(rows["measured"])))
    low, high = (f"{100 * share:.2g}" for share in (min(shares), max(shares)))
    return f"The fit leaves {low if low == high else f'{low} to {high}'} % of the pulsation (rms)."


def spans(windows: pd.DataFrame) -> str:
    """Return how far back pressure and pulsation of the calibration differ at one set-point, the least of them."""
    own = windows[windows["set"] == CALIBRATION].dropna(subset=["flow_set"]).groupby("flow_set")
    least = [float((own[name].max() - own[name].min()).min()) / MMHG for name in ("back_pressure", "amplitude")]
    if not np.isfinite(least).all():
        return "The calibration does not tell."
    return f"At each set-point of the calibration back pressures differ by {least[0]:.2g} mmHg and more, pulsations by {least[1]:.2g} mmHg and more."  # fmt: skip
