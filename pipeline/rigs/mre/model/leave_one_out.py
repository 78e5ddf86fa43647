"""Fits without each run in turn: a check of the errors, of single bad runs and of prediction.

A refit each where runs are few; where they are many, one step from the optimum, which then lies next to it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.scatter import gain_vectors, whitening
from pipeline.estimation.uncertainty import jackknife
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.dynamic_model import HarmonicModel, real_rows
from pipeline.rigs.mre.model.harmonic_fit import FitOptions, refit
from pipeline.rigs.over_runs import MANY


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
    """Fit without each run in turn, from the optimum and with the run scatter of the full fit."""
    loops = fit.loops
    if len(loops) > MANY:
        return _one_step(fit)
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


def _one_step(fit: DynamicFit) -> LeaveOneOut:
    """Return the fits without each run after one Gauss-Newton step: (J^T J - J_g^T J_g)^-1 J_g^T r_g."""
    model = HarmonicModel(fit.loops, fit.layout, fit.held_lag, tuple(fit.noise[loop.run] for loop in fit.loops))
    q, c = np.r_[np.log(fit.values[:2]), fit.values[2 : model.n_shape]], fit.values[model.n_shape :]
    A, dA = model(q)
    rows = real_rows(np.hstack([(dA @ c).T, A]))
    size = np.linalg.norm(rows, axis=0)
    rows = rows / np.where(size > 0, size, 1.0)
    missed = model.real_data - real_rows(A @ c)
    whiten = whitening(gain_vectors(model.whitened(model.real_data - missed), model.groups), fit.run_scatter)
    J, r = whiten(model.whitened(rows)), whiten(model.whitened(missed))
    H, total = J.T @ J, float(r @ r)
    order = np.argsort(model.groups, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(model.groups))[:-1])
    values = np.full((len(fit.loops), len(fit.names)), np.nan)
    chi2: dict[str, float] = {}
    predicted: dict[str, float] = {}
    misfit = signal = 0.0
    for i, (loop, own) in enumerate(zip(fit.loops, members, strict=True)):
        g = J[own].T @ r[own]
        step = np.linalg.lstsq(H - J[own].T @ J[own], g, rcond=1e-12)[0]
        moved = np.r_[q, c] - step / np.where(size > 0, size, 1.0)
        values[i] = np.r_[np.exp(moved[:2]), moved[2:]]
        chi2[loop.run] = (total - float(r[own] @ r[own]) - float(g @ step)) / max(
            r.size - own.size - q.size - c.size, 1
        )
        off, force = missed[own] + rows[own] @ step, model.real_data[own]
        if fit.layout.labels.count(fit.layout.labels[i]) == 1:
            predicted[loop.run] = math.nan  # its current has no other run
            continue
        predicted[loop.run] = math.sqrt(float(off @ off) / float(force @ force))
        misfit, signal = misfit + float(off @ off), signal + float(force @ force)
    return LeaveOneOut(values, jackknife(values).std_error, chi2, predicted, math.sqrt(misfit / signal))
