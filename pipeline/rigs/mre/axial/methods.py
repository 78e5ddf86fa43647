"""The methods paragraphs of `mre.axial`, written from the findings and the settings that were used."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from pipeline.errors import counted
from pipeline.findings import Findings


def methods(findings: Findings) -> Sequence[str]:
    """Return paragraphs that a second person can repeat the analysis from."""
    runs: pd.DataFrame = findings.arrays["runs"]
    return [_motion(runs), _model(), _numbers(), _errors(findings, runs)]


def _motion(runs: pd.DataFrame) -> str:
    coarse = runs[runs["gauge_step"] > 0]
    text = f"{counted(len(runs), 'run')} of slow compression and release {'was' if len(runs) == 1 else 'were'} cut into strokes where the displacement turns. "
    if len(coarse):
        steps = ", ".join(f"{1e3 * value:g} mm" for value in sorted(set(coarse["gauge_step"].round(9))))
        text += (
            f"The displacement comes in steps of {steps}; known are the moments at which it passes from one step to the next. Each stroke was taken as a polynomial in time of "
            "the least degree that passes through these moments (degree 1, a constant rate, unless they ask for more). "
        )
    kinds = runs["motion"].value_counts()
    if "as read" in kinds:
        text += (
            "Readings whose noise, in terms of force, is small beside the force's own were taken as they are; what all of a stroke are off alike, and where a turn falls between two "
            "samples, was fitted along. "
        )
    return text + "Found: " + ", ".join(f"{kind} in {counted(int(n), 'run')}" for kind, n in kinds.items()) + "."


def _model() -> str:
    return (
        "The force is F = k d + k_3 d^3 + alpha w + F_off with w' = rho (d' − |d'| w), the Bouc-Wen law with C = n = 1 (Brancati et al. 2019, eq. 12; Ismail et al. 2009), which has a "
        "closed form on every stroke; w is 0 at first contact, where displacement is counted from. It is linear in all but rho, which was searched by variable projection (Golub and "
        "Pereyra 1973). Then all unknowns, the coefficients of the motion among them, were fitted to the force samples and to the gauge's passages together, each with its own error: the force "
        "tells the moment of the turn better than the gauge. The log may begin up to a sample after the motion."
    )


def _numbers() -> str:
    return (
        "Secant stiffness is the force of the model at the turn, F_off removed, over the displacement there; slope stiffness is the regression of the loading branch over 20 to 80 % of the "
        "stroke; loss ratio is the work lost in a full loop over the work of loading; the unloading drop is alpha (1 + w_m). Stiffening is the ratio to the run at 0 A less 1. A jump of the gauge or "
        "of the force, and a step of the force at every turn, are sought in every run; what is found is said. Relaxation and viscosity act like hysteresis in a loop at one rate and are in "
        "these numbers."
    )


def _errors(findings: Findings, runs: pd.DataFrame) -> str:
    text = (
        "Intervals hold 95 %, Student's. Where the residual is correlated in time the samples count as fewer (effective sample size). Where rho is not well known, an interval holds what every rho gives "
        "that the data allow; a number that they leave open is not told."
    )
    if (runs["current"].value_counts() > 1).any():
        text += " Runs at one current were averaged; where they scatter by more than their own errors, that scatter (all currents together) is in the errors."
    gains = [
        f"{name.split('_')[0]} {100 * findings.settings[name]:g} %"
        for name in ("force_gain_error", "displacement_gain_error")
        if findings.settings.get(name)
    ]
    return text + (f" Calibration errors (1 sigma) are in the intervals: {', '.join(gains)}." if gains else "")
