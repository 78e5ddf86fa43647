"""The findings' parameters: coefficients of E2 and E3, flows, errors, each with its interval or the reason for none."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.findings import ModelResult, Parameter
from pipeline.rigs.rap.flow.calibration import LAWS, Calibrated
from pipeline.rigs.rap.flow.declaration import PARAMETERS
from pipeline.rigs.rap.flow.results import ESTIMATORS, Campaign, ErrorRow, FlowRow
from pipeline.rigs.rap.flow.sets import CALIBRATION, HOLDOUT

_SPECS = {spec.name: spec for spec in PARAMETERS}
OWN = "rap"
# Where noise explains less than that share of an error, the error is the law's misfit.
_MISFIT = 0.67
_SCATTER = "linear least squares on windows; scatter of operating points, or spread over left-out set-points where clearly larger"
_WORDS = {
    "E0": "V f, V from the lowest unclamped set-point", "E1": "V f, V from all calibration windows", "E2": "pulsation",
    "E3": "mean pressures", "E2 quadratic": "E2 with a term in (f - f0)^2", "affine": "a f + b, no model of a pump",
    OWN: "the device's own estimate, as it logs it",
}  # fmt: skip


def parameters_of(found: Campaign) -> list[Parameter]:
    """Return all parameters."""
    return [
        *_told(_coefficients(found), _SCATTER),
        *_told(map(_flow, found.flows), "mean over the windows of the set-point"),
        *_told(_errors(found), "windows of the set; a statistic of them, without an interval"),
    ]


def _told(estimates: Iterable[Estimate], method: str) -> list[Parameter]:
    rows = []
    for e in estimates:
        spec = _SPECS[e.name]
        known = e.value is not None and math.isfinite(e.value)
        described = "; ".join(filter(None, (spec.description, e.reason))) if known else (e.reason or "not determined")
        sure = known and e.std_error is not None and math.isfinite(e.std_error)
        rows.append(
            Parameter(
                name=e.name, symbol=spec.symbol, value=e.value if known else None, std_error=e.std_error if sure else None, type_b=e.type_b if sure else None, ci95=e.ci95 if sure else None,
                unit=spec.unit, at=dict(e.at), description=described, source=spec.source, method=method if known else "",
            )
        )  # fmt: skip
    return rows


def _coefficients(found: Campaign) -> list[Estimate]:
    rows = []
    for name in ("E2", "E3"):
        law = found.laws.get(name)
        for i, coefficient in enumerate(LAWS[name].names):
            if law is None:
                rows.append(undetermined(coefficient, found.refused[name]))
            elif law.covariance is None:
                rows.append(undetermined(coefficient, "too few operating points to tell its scatter"))
            else:
                rows.append(_coefficient(found, law, i, coefficient))
    return rows


def _coefficient(found: Campaign, law: Calibrated, i: int, name: str) -> Estimate:
    assert law.covariance is not None
    value, random = float(law.values[i]), float(law.covariance.std_error[i])
    parts = {f"{100 * found.gain_u:.2g} % gain of the flow meter{'' if found.gain_stated else ' (assumed, flowmeter_gain_u is not stated)'}":
             found.gain_u * value}  # fmt: skip
    if found.uf_u > 0.0:
        parts[f"{100 * found.uf_u:.2g} % UF rate added to the meter's reading"] = found.uf_u * value
    if name == "stroke_volume_mean" and found.zero_u > 0.0:
        parts[f"zero of the pressures unknown within {found.zero_u:.0f} Pa"] = found.zero_u * float(law.values[1])
    dof = law.covariance.dof
    words = f"type A {100 * random / abs(value):.2g} %{_of_what(random, float(law.noise[i]), abs(value))}; type B in the error: {', '.join(parts)}"
    if name == "pump_compliance":
        words += "; carries the gain of the device's pressure sensors in full"
    if name in ("y0", "y1"):
        words += "; holds for this filter, return line and air volume only"
    return _combined(name, value, random, math.hypot(*parts.values()), dof, {}, words)


def _of_what(random: float, noise: float, value: float) -> str:
    """Say that an error of type A is what the law misses between set-points, where the noise of the windows is clearly less."""
    if not noise < _MISFIT * random:
        return ""
    return (
        f", which is what the law misses between set-points and clamps and not noise (that alone would be {100 * noise / value:.2g} %): it does not shrink "
        "with longer runs"
    )


def _combined(name: str, value: float, random: float, systematic: float, dof: float, at: dict[str, float | str | bool], words: str) -> Estimate:  # fmt: skip
    """Return an estimate of both types of error; degrees of freedom after Welch and Satterthwaite."""
    total = math.hypot(random, systematic)
    effective = dof * (total / random) ** 4 if random > 0.0 and math.isfinite(dof) else math.inf
    return estimate(name, value, total, dof=effective, at=at, reason=words, type_b=abs(systematic) or None)


def _flow(row: FlowRow) -> Estimate:
    at: dict[str, float | str | bool] = {"run": row.run, "estimator": row.estimator}
    if math.isfinite(row.flow_set):
        at["flow_set"] = row.flow_set
    if row.why_not:
        return undetermined("flow", row.why_not, at)
    words = f"{row.count} windows; type A {100 * row.random:.2g} %, type B {100 * row.systematic:.2g} % (meter that it was calibrated with)"
    words = "; ".join(filter(None, (words, row.doubt)))
    return _combined("flow", row.value, row.random * row.value, row.systematic * row.value, row.dof, at, words)


def _errors(found: Campaign) -> list[Estimate]:
    rows = []
    by = {(row.estimator, row.set, row.tube): row for row in found.errors}
    told = dict.fromkeys((row.set, row.tube) for row in found.errors)
    missing = dict.fromkeys((name, "") for name in (CALIBRATION, HOLDOUT) if name not in {one for one, _ in told})
    for name, tube in told | missing:
        for estimator in (*ESTIMATORS, OWN):
            row = by.get((estimator, name, tube))
            if row is not None:
                rows += _error(row, found)
            elif estimator != OWN:
                at = _at(estimator, name, tube)
                rows += [
                    undetermined(one, _why_no_error(found, estimator, name), at)
                    for one in ("flow_error_max", "flow_error_rms")
                ]
    return rows


def _at(estimator: str, name: str, tube: str) -> dict[str, float | str | bool]:
    return {"estimator": estimator, "set": name, **({"tube_set_id": tube} if tube else {})}


def _error(row: ErrorRow, found: Campaign) -> list[Estimate]:
    at = _at(row.estimator, row.set, row.tube)
    meter = (
        f"a gain error of the meter ({100 * found.gain_u:.2g} %) is in it"
        if row.set != CALIBRATION
        else "the fit's own windows"
    )
    return [
        Estimate("flow_error_max", row.worst, at=at, reason=f"{_WORDS[row.estimator]}; worst in {row.where}; {row.count} windows; {meter}"),
        Estimate("flow_error_rms", row.rms, at=at, reason=f"{_WORDS[row.estimator]}; mean error {100 * row.mean:+.2f} %; {row.count} windows; {meter}"),
    ]  # fmt: skip


def _why_no_error(found: Campaign, estimator: str, name: str) -> str:
    if estimator in found.refused:
        return f"{estimator} is not calibrated: {found.refused[estimator]}"
    return f"no window of the set '{name}' has a blood flow of the meter"


def models_of(found: Campaign) -> list[ModelResult]:
    """Return how the laws fit the calibration windows and predict operating points that they did not see."""
    if not found.laws:
        return []
    spread = float(np.std(found.calibration.flow))
    mean = float(np.mean(found.calibration.flow))
    best = min(
        (name for name in ("E2", "E3") if name in found.laws), key=lambda name: found.laws[name].misfit, default=""
    )
    rows = []
    for name, law in found.laws.items():
        if name == "E0":
            continue  # other data
        residual = law.flow(law.windows) - law.windows.flow
        rms = float(np.sqrt(np.mean(residual**2)))
        rows.append(
            ModelResult(
                name=name, selected=name == best,
                n_parameters=law.values.size, n_data=law.windows.size, rms_residual=rms, unit="m^3/s", nrmse=rms / spread if spread > 0.0 else None,
                cv_error=law.misfit * mean / spread if spread > 0.0 and math.isfinite(law.misfit) else None, description=_WORDS[name],
            )
        )  # fmt: skip
    return rows
