"""Separable fit of the dynamic model to records that are not periodic (random, chirp), sample by sample.

Periodic runs go through `harmonic_fit`, which is faster and treats noise on x better.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate
from pipeline.estimation.selection import Candidate
from pipeline.estimation.separable import SeparableFit, fit_separable, linear_fit, multi_start
from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.mre.model.determination import judge
from pipeline.rigs.mre.model.dynamic_model import SCALE, SHAPE_NAMES, bounds_reached, spread_starts
from pipeline.rigs.mre.model.fit_errors import PHYSICAL_BOUNDS, Errors, Key
from pipeline.rigs.mre.model.fit_estimates import estimates_of, impossible
from pipeline.rigs.mre.model.time_columns import Record, largest_excursion, livelier_part, segments_of
from pipeline.rigs.mre.model.time_errors import coloured
from pipeline.rigs.mre.model.time_evidence import Evidence, changing_gain, curves, stepping_zero, viscous
from pipeline.rigs.mre.model.time_model import TimeModel, TimeOptions
from pipeline.rigs.mre.model.time_residue import Residue, of_drift, of_motion

__all__ = ["Record", "TimeFit", "TimeOptions", "fit_records"]

_SEARCH_ROWS = 6000  # rows of the livelier part on which the starts are tried
# Where the best start misses this share of the force on the livelier part, no search over the whole record makes
# a description of it: a rough one shows by how much it fails.
_HOPELESS, _ROUGH, _FEW = 0.3, 1e-3, 4
_NOISE_PERIODS = 2.5  # of the low-pass on x: so long its noise, times the stiffness, is correlated in the residual
_EVALUATIONS = 60  # of a start; those that get anywhere take a dozen


@dataclass(frozen=True, eq=False)
class TimeFit:
    """The model fitted to whole records, and how the fit of the first half predicts the second.

    Attributes
    ----------
    estimates, names, values, errors, correlation, condition, statements, undetermined, at_bound, inadmissible
        As in `dynamic_fit.DynamicFit`; the covariance is that of coloured residuals.
    rms_residual, nrmse, nrmse_by_run
        Of the final fit: N, and over the rms of the force about its mean.
    nrmse_first_half, nrmse_second_half
        Misfit of the fit to the first half of each record there, and its prediction error on the second.
    aicc, bic
        With the effective number of samples as number of data.
    effective_fraction
        Effective over actual number of residuals.
    cutoff
        Of the low-pass that was used, Hz.
    drift
        Per run, by how much the mean force drifts where that was fitted along, N.
    gain_change
        Per run, by which share the force changes from the start to the end beyond what the model tells.
    curves
        What cubics of the sensors and of the pad would find in the residual, by what would be curved.
    viscous, zero_step
        What a dashpot would find (N s/m), and when (s) and by how much (N) the force's zero would step.
    with_motion, with_time
        What of the residual hangs together with the motion, and what wanders with time alone.
    inertia
        Mass (kg) that one further step of the fit would find in the residual, and its standard error.
    series
        Per run `time`, `displacement`, `force`, `model`: the filtered, thinned series compared (SI).
    """

    estimates: tuple[Estimate, ...]
    names: tuple[str, ...]
    values: np.ndarray
    errors: Errors
    correlation: np.ndarray
    condition: float
    statements: tuple[str, ...]
    undetermined: tuple[str, ...]
    at_bound: tuple[str, ...]
    inadmissible: tuple[str, ...]
    levels: tuple[float, ...]
    rms_residual: float
    nrmse: float
    nrmse_by_run: Mapping[str, float]
    nrmse_first_half: float
    nrmse_second_half: float
    n_data: int
    n_parameters: int
    aicc: float
    bic: float
    effective_fraction: float
    cutoff: float
    starts_agreeing: tuple[int, int]
    drift: Mapping[str, float]
    gain_change: Mapping[str, Evidence]
    curves: Mapping[str, Evidence]
    viscous: Evidence
    zero_step: tuple[float, Evidence]
    with_motion: Residue
    with_time: Residue
    inertia: tuple[float, float]
    series: Mapping[str, Mapping[str, np.ndarray]]

    def one(self, name: str, coil_current: float | None = None) -> Estimate:
        """Return the estimate of that name (at that current); LookupError where there is none."""
        at = {} if coil_current is None else {"coil_current": coil_current}
        found = [e for e in self.estimates if e.name == name and dict(e.at) == at]
        if len(found) != 1:
            raise LookupError(f"{len(found)} estimates are called '{name}' at {at}")
        return found[0]


def fit_records(records: Sequence[Record], options: TimeOptions | None = None) -> TimeFit:
    """Fit the model of 3.6 to one or more records: field terms k_MR, s_MR per current beyond the first.

    Raises
    ------
    InputError
        If no record is long enough.
    """
    options = options or TimeOptions()
    segments = [part for record in records for part in segments_of(record, options.cutoff)]
    if not segments:
        raise InputError(
            f"no record of {', '.join(record.run for record in records)} holds enough unbroken samples for the "
            "time-domain fit: at least 100 above the low-pass's rate are needed. Log longer or without gaps."
        )
    model = TimeModel(segments, options)
    every = model.usable
    lively = TimeModel([livelier_part(segments, _SEARCH_ROWS)], replace(options, drift=1))
    lively = lively.restricted(lively.usable)
    starts = spread_starts(largest_excursion(segments), options.starts, options.seed)
    coarse, agreeing, tried = multi_start(
        lambda q0: _fit(lively, q0[: model.n_shape], 1e-6, _EVALUATIONS), starts, lambda end: _admissible(end, lively)
    )
    hopeless = _nrmse(coarse.residual, lively.data) > _HOPELESS
    search = (_ROUGH, _FEW) if hopeless else (1e-7, 200)
    model.add_drift(linear_fit(model.restricted(every)(coarse.q)[0], model.force[every]).residual)
    model.add_hum(linear_fit(model.restricted(every)(coarse.q)[0], model.force[every]).residual)
    first = model.restricted(every & model.first_half)
    half = _fit(first, coarse.q, *search)
    predicted = model.restricted(every & ~model.first_half)
    fit = _fit(model.restricted(every), half.q, *search)
    return _finished(model, fit, half, first, predicted, (agreeing, tried))


def _fit(model: TimeModel, q0: np.ndarray, tolerance: float, evaluations: int) -> SeparableFit:
    return fit_separable(
        model,
        model.data,
        q0,
        lower=model.lower,
        upper=model.upper,
        scale=SCALE[: model.n_shape],
        tolerance=tolerance,
        max_evaluations=evaluations,
    )


def _memory(model: TimeModel) -> int:
    """Return over how many rows the noise of the low-passed displacement hangs together."""
    return max(
        math.ceil(_NOISE_PERIODS / (part.cutoff * float(np.median(np.diff(part.time))))) for part in model.segments
    )


def _bounds_reached(model: TimeModel, fit: SeparableFit) -> dict[str, float]:
    return bounds_reached(fit.q, fit.at_bound, model.lower, model.upper)


def _admissible(fit: SeparableFit, model: TimeModel) -> bool:
    return bool(np.all(fit.c[:3] > 0)) and not set(_bounds_reached(model, fit)) - PHYSICAL_BOUNDS.keys()


def _keys(model: TimeModel) -> list[Key]:
    names = {"u": "k1", "x": "k2", "w": "alpha_bw", "v": "s_mr", "m": "moving_mass"}
    keys = [Key(name) for name in (*SHAPE_NAMES, "force_lag")[: model.n_shape]]
    for column, level in model.terms:
        if level is None:
            keys.append(Key(names[column]))
        else:
            keys.append(Key({"x": "k_mr", "v": "s_mr"}[column], model.levels[level]))
    return keys


def _finished(
    model: TimeModel,
    fit: SeparableFit,
    half: SeparableFit,
    first: TimeModel,
    second: TimeModel,
    agreeing: tuple[int, int],
) -> TimeFit:
    keys = _keys(model)
    values = np.r_[np.exp(fit.q[:2]), fit.q[2:], fit.c[: len(model.terms)]]
    natural = fit.jacobian[:, : len(keys)].copy()
    natural[:, :2] /= values[:2]
    nuisance = fit.jacobian[:, len(keys) :]
    # Offsets (and drifts) projected out: what is left is the Jacobian of the physical parameters.
    basis = np.linalg.qr(nuisance)[0]
    natural -= basis @ (basis.T @ natural)
    effective = effective_size(fit.residual, nuisance.shape[1])
    fraction = effective / fit.residual.size
    variance = fit.chi2 / max(fit.dof, 1)
    found = coloured(natural, fit.residual, _memory(model))
    errors = Errors(found.matrix, np.zeros((len(keys), 0)), 0.0, found.dof)
    bounds = _bounds_reached(model, fit)
    verdict = judge(keys, values, natural, variance / fraction, errors, bounds)
    sd = np.sqrt(np.diag(errors.covariance))
    measured = model.force[model.usable]
    run_of_row = np.array([model.segments[i].run for i in model.segment_of_row])[model.usable]
    runs = list(dict.fromkeys(run_of_row.tolist()))
    candidate = Candidate("", fit.chi2 * fraction, max(round(effective), 1), fit.jacobian.shape[1])
    return TimeFit(
        estimates=estimates_of(keys, values, errors, verdict, bounds, model.levels[model.reference]),
        names=tuple(key.text for key in keys),
        values=values,
        errors=errors,
        correlation=errors.covariance / np.outer(sd, sd),
        condition=verdict.condition,
        statements=verdict.statements,
        undetermined=verdict.undetermined,
        at_bound=tuple(bounds),
        inadmissible=impossible(keys, values, errors, verdict),
        levels=model.levels,
        rms_residual=float(np.sqrt(np.mean(fit.residual**2))),
        nrmse=_nrmse(fit.residual, measured),
        nrmse_by_run={run: _nrmse(fit.residual[run_of_row == run], measured[run_of_row == run]) for run in runs},
        nrmse_first_half=_nrmse(half.residual, first.data),
        nrmse_second_half=_prediction_error(model, half, first, second),
        n_data=fit.residual.size,
        n_parameters=fit.jacobian.shape[1],
        aicc=candidate.aicc,
        bic=candidate.bic,
        effective_fraction=fraction,
        cutoff=max(part.cutoff for part in model.segments),
        starts_agreeing=agreeing,
        drift=_drift(model, fit, run_of_row),
        gain_change={run: changing_gain(model, fit, run_of_row == run) for run in runs},
        curves=curves(model, fit),
        viscous=viscous(model, fit),
        zero_step=stepping_zero(model, fit),
        with_motion=of_motion(model, fit),
        with_time=of_drift(model, fit),
        inertia=_inertia(model, fit, fraction),
        series={run: _series(model, fit, run, run_of_row) for run in runs},
    )


def _nrmse(residual: np.ndarray, measured: np.ndarray) -> float:
    spread = float(np.std(measured))
    return float(np.sqrt(np.mean(residual**2))) / spread if spread > 0 else math.inf


def _prediction_error(model: TimeModel, half: SeparableFit, first: TimeModel, second: TimeModel) -> float:
    """Return the misfit of the second halves by the fit to the first, states carried through.

    A stretch that begins in the second half has no offset from the first: its own mean is then used, and
    its own drift where there is one, which cannot be extrapolated.
    """
    if not second.rows.any():
        return math.nan
    A, _ = second(half.q)
    terms = len(model.terms)
    residual = second.data - A[:, :terms] @ half.c[:terms]
    known = np.abs(model.nuisance[first.rows]).max(axis=0) > 0
    known[: model.n_slow] = False
    offsets = model.nuisance[second.rows]
    residual = residual - offsets[:, known] @ half.c[terms + first.n_slow :]
    if not known.all():
        residual = linear_fit(offsets[:, ~known], residual).residual
    return _nrmse(residual, second.data)


def _drift(model: TimeModel, fit: SeparableFit, run_of_row: np.ndarray) -> dict[str, float]:
    """Return the range of the fitted drift of each run, N; nothing where no drift was fitted."""
    if model.n_slow == 0:
        return {}
    # Columns stand degree by degree, one for each segment; the first degree is the offset.
    columns = slice(len(model.segments), model.n_slow)
    start = len(model.terms)
    drift = model.nuisance[model.usable][:, columns] @ fit.c[start + columns.start : start + columns.stop]
    return {run: float(np.ptp(drift[run_of_row == run])) for run in dict.fromkeys(run_of_row.tolist())}


def _inertia(model: TimeModel, fit: SeparableFit, fraction: float) -> tuple[float, float]:
    """Return the mass that the residual holds beyond all that was fitted, and its error."""
    column = np.concatenate([part.acceleration for part in model.segments])[model.usable]
    basis = np.linalg.qr(fit.jacobian)[0]
    column = column - basis @ (basis.T @ column)
    power = float(column @ column)
    if not power > 0:
        return 0.0, math.inf
    return float(column @ fit.residual) / power, math.sqrt(fit.chi2 / fit.residual.size / power / fraction)


def _series(model: TimeModel, fit: SeparableFit, run: str, run_of_row: np.ndarray) -> dict[str, np.ndarray]:
    at = run_of_row == run
    rows = np.flatnonzero(model.usable)[at]
    time = np.concatenate([part.time for part in model.segments])[rows]
    x = np.concatenate([part.x for part in model.segments])[rows]
    force = model.force[rows]
    return {"time": time, "displacement": x, "force": force, "model": force - fit.residual[at]}
