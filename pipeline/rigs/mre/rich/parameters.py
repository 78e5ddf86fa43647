"""Estimates of the batch fits -> parameters and models of the findings, with the names of mre.md section 10."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.estimation.estimate import Estimate
from pipeline.findings import ModelResult, Parameter
from pipeline.findings.findings import OperatingPoint
from pipeline.rigs.mre.rich.declaration import PARAMETERS
from pipeline.rigs.mre.rich.fits import RichFit
from pipeline.rigs.mre.rich.online_verdict import ABSENT

_SPECS = {spec.name: spec for spec in PARAMETERS}
_FLOORS = {"c_bw": 0.5, "n_bw": 1.0, "k1": 0.0, "s1": 0.0, "alpha_bw": 0.0}
_SUMS = {"k1_plus_k2": {"k1", "k2"}, "k2_plus_alpha_rho": {"k2", "alpha_bw", "rho"}}


def operating_points(fits: Sequence[RichFit]) -> dict[str, OperatingPoint]:
    """Return `at` of each run: the coil current; preload and run where the current alone does not tell them apart."""
    points: dict[str, OperatingPoint] = {}
    for fit in fits:
        at: OperatingPoint = {} if fit.current is None else {"coil_current": round(float(fit.current), 3)}
        alike = [other for other in fits if other.current == fit.current]
        if len({other.usable.preload for other in alike}) > 1 and fit.usable.preload is not None:
            at["preload"] = fit.usable.preload
        points[fit.run] = at
    alone = {run for run, at in points.items() if sum(other == at for other in points.values()) == 1}
    return {run: at if run in alone else {**at, "run": run} for run, at in points.items()}


def parameters_of(fits: Sequence[RichFit], points: Mapping[str, OperatingPoint]) -> list[Parameter]:
    """Return the parameters of the batch fits, each at the current of its record; sums only where members are open."""
    found = []
    for fit in fits:
        batch = fit.batch
        method = (
            f"separable least squares in time, low-pass {batch.cutoff:.3g} Hz, errors widened for coloured residuals"
        )
        open_ = {e.name for e in batch.estimates if not e.determined}
        for e in batch.estimates:
            if e.name in _SPECS and (e.name not in _SUMS or _SUMS[e.name] & open_):
                found.append(_parameter(e, points[fit.run], method, holds_field=bool(fit.current)))
        for equivalent in fit.linear:
            method = f"F = K x + C v over the record, misfit {100 * equivalent.nrmse:.2g} % of the force"
            found += [_parameter(e, points[fit.run], method, holds_field=False) for e in equivalent.estimates]
    return found


def _parameter(estimate: Estimate, at: OperatingPoint, method: str, *, holds_field: bool) -> Parameter:
    spec = _SPECS[estimate.name]
    value = estimate.value if estimate.value is not None and math.isfinite(estimate.value) else None
    if value is None:
        description = estimate.reason or "not determined"
    else:
        meaning = (
            "static stiffness with the field, k2 + k_MR" if estimate.name == "k2" and holds_field else spec.description
        )
        description = f"{meaning}; {estimate.reason}" if estimate.reason else meaning
    return Parameter(
        name=estimate.name,
        symbol=spec.symbol,
        value=value,
        std_error=estimate.std_error if value is not None else None,
        ci95=_admissible(estimate) if value is not None else None,
        unit=spec.unit,
        at=at,
        description=description,
        source=spec.source,
        method=method,
    )


def _admissible(estimate: Estimate) -> tuple[float, float] | None:
    """Return the interval without what the model does not admit."""
    if estimate.ci95 is None:
        return None
    floor = _FLOORS.get(estimate.name, -math.inf)
    return max(estimate.ci95[0], floor), max(estimate.ci95[1], floor)


def models_of(fits: Sequence[RichFit]) -> list[ModelResult]:
    """Return both methods of each record; the batch fit is the one that is reported."""
    models = []
    for fit in fits:
        family = fit.run if len(fits) > 1 else ""
        suffix = f" {fit.run}" if len(fits) > 1 else ""
        batch = fit.batch
        models.append(
            ModelResult(
                name=f"batch{suffix}",
                family=family,
                selected=True,
                n_parameters=batch.n_parameters,
                n_data=batch.n_data,
                rms_residual=batch.rms_residual,
                unit="N",
                nrmse=batch.nrmse,
                aicc=batch.aicc,
                bic=batch.bic,
                cv_error=batch.nrmse_second_half,
                description="separable least squares on the whole record; predicts the second half from the first",
            )
        )
        if fit.online is not None and fit.verdict is not None and fit.verdict.word != ABSENT:
            assert fit.online.filter is not None
            spread = float(np.std(fit.usable.series.F[fit.usable.series.counts]))
            innovation = fit.verdict.innovation
            models.append(
                ModelResult(
                    name=f"online filter{suffix}",
                    family=family,
                    n_parameters=fit.online.filter.x.size - 2,
                    n_data=fit.online.history.step_time.size,
                    rms_residual=innovation,
                    unit="N",
                    nrmse=innovation / spread if math.isfinite(innovation) and spread > 0 else None,
                    description=f"joint unscented Kalman filter, {fit.verdict.word}; its residual are the one-step predictions "
                    "of the second half",
                )
            )
    return models
