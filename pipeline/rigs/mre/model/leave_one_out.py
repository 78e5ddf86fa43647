"""Refits without each run in turn: a check of the errors, of single bad runs and of prediction."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import jackknife
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, refit


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Fits without each run in turn.

    Attributes
    ----------
    values
        Parameters without each run, shape (runs, parameters), in the order of `DynamicFit.names`; NaN
        where a parameter needs the run.
    std_error
        By the jackknife over the runs that each parameter can do without; NaN below three.
    chi2_without
        chi2/dof of the others, run scatter accounted for as in the full fit, by run left out.
    prediction_nrmse
        Misfit of the left-out run's force predicted by the others over its rms; NaN where they cannot.
    cv_error
        The same over all runs that can be predicted; NaN where none can.
    """

    values: np.ndarray
    std_error: np.ndarray
    chi2_without: Mapping[str, float]
    prediction_nrmse: Mapping[str, float]
    cv_error: float


def leave_one_out(fit: DynamicFit, options: FitOptions | None = None) -> LeaveOneOut:
    """Refit without each run in turn, from the optimum and with the run scatter of the full fit."""
    loops = fit.loops
    values = np.full((len(loops), len(fit.names)), np.nan)
    chi2: dict[str, float] = {}
    predicted: dict[str, float] = {}
    misfit = signal = 0.0
    for i, left in enumerate(loops):
        others = [loop for loop in loops if loop is not left]
        chi2[left.run] = predicted[left.run] = math.nan
        try:
            without = refit(fit, others, options) if others else None
        except ValueError:  # too few data are left
            without = None
        if without is None:
            continue
        chi2[left.run] = without.chi2 / max(without.dof, 1)
        for j, name in enumerate(fit.names):
            if name in without.names and name not in without.undetermined:
                values[i, j] = without.values[without.names.index(name)]
        if fit.level_of(left.current) not in {*without.layout.labels}:
            continue
        error = (left.F - without.predicted(left))[left.kept]
        own, size = float((np.abs(error) ** 2).sum()), float((np.abs(left.F[left.kept]) ** 2).sum())
        predicted[left.run] = math.sqrt(own / size)
        misfit, signal = misfit + own, signal + size
    spread = np.full(len(fit.names), np.nan)
    for j in range(len(fit.names)):
        known = values[np.isfinite(values[:, j]), j]
        if known.size >= 3:
            spread[j] = jackknife(known[:, None]).std_error[0]
    return LeaveOneOut(values, spread, chi2, predicted, math.sqrt(misfit / signal) if signal else math.nan)
