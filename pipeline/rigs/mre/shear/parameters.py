"""Estimates of the fits -> parameters and models of the findings, with the names of mre.md section 10."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import counted
from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.findings import ModelResult, Parameter
from pipeline.findings.findings import OperatingPoint
from pipeline.rigs.mre.model.dynamic_fit import DynamicFit
from pipeline.rigs.mre.model.harmonic_fit import Identification
from pipeline.rigs.mre.model.leave_one_out import LeaveOneOut
from pipeline.rigs.mre.model.linear_equivalent import LinearEquivalent
from pipeline.rigs.mre.model.time_fit import TimeFit
from pipeline.rigs.mre.shear.declaration import PARAMETERS
from pipeline.rigs.mre.shear.half_cycle import half_cycle_metrics
from pipeline.rigs.mre.shear.loop_metrics import loop_metrics
from pipeline.rigs.mre.shear.operating import Held
from pipeline.rigs.mre.shear.preload import PreloadTable
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns, UsableRun

_SPECS = {spec.name: spec for spec in PARAMETERS}
_SUMS = {"k1_plus_k2": {"k1", "k2"}, "k2_plus_alpha_rho": {"k2", "alpha_bw", "rho"}}
_LABEL_TOLERANCE = 0.05  # A
VARIANT_TEXTS = {
    "base": "one current: no field terms",
    "ks": "k_MR and s_MR depend on the current (the paper's)",
    "ka": "k_MR and a_BW depend on the current",
    "km": "k_MR and k1 depend on the current",
    "k": "k_MR alone depends on the current",
    "ksa": "k_MR, s_MR and a_BW depend on the current",
}


@dataclass(frozen=True)
class Labels:
    """What the levels of the measured current are called: the set current where it agrees."""

    nominal: dict[float, float]

    @classmethod
    def of(cls, held: Sequence[Held], fit: DynamicFit | None) -> Labels:
        """Match the levels of a fit with the currents that the conditions name."""
        named = {one.conditions.get("coil_current") for one in held}
        known = sorted(float(value) for value in named if isinstance(value, float | int))
        nominal = {}
        for level in fit.levels if fit is not None else ():
            near = min(known, key=lambda label: abs(label - level), default=None)
            if near is not None and abs(near - level) <= _LABEL_TOLERANCE:
                nominal[level] = near
        return cls(nominal)

    def at(self, at: dict[str, float | str | bool]) -> OperatingPoint:
        """Return an operating point with the set current in place of the measured one."""
        current = at.get("coil_current")
        if not isinstance(current, float):
            return dict(at)
        for level, label in self.nominal.items():
            if abs(level - current) < 1e-9:
                return {**at, "coil_current": label}
        return {**at, "coil_current": round(current, 3)}


def parameters_of(
    fit: DynamicFit | None, times: Sequence[TimeFit], preloads: PreloadTable | None, labels: Labels
) -> list[Parameter]:
    """Return the parameters of the dynamic model and the field effects; sums only where members are open."""
    found: list[Parameter] = []
    if fit is not None:
        method = f"separable least squares on harmonics, variant {fit.variant}, {counted(len(fit.loops), 'run')}"
        if fit.rejected:
            method += "; the model is rejected, errors by the scatter between runs"
        if fit.held_lag is not None:
            found.append(_parameter(fit.force_lag, {}, "given, not fitted"))
        estimates = fit.estimates if not fit.reference_current else _without_zero_current(fit, fit.reference_current)
        found += [_parameter(e, labels.at(dict(e.at)), method) for e in _told(estimates)]
    for number, time_fit in enumerate(times):
        at: OperatingPoint = {} if len(times) == 1 else {"group": float(number)}
        method = (
            f"separable least squares in time, low-pass {time_fit.cutoff:.3g} Hz, errors widened for coloured residuals"
        )
        found += [_parameter(e, {**at, **labels.at(dict(e.at))}, method) for e in _told(time_fit.estimates)]
    for effect in preloads.effects if preloads is not None else ():
        found.append(_parameter(effect, labels.at(dict(effect.at)), "from the loops; equal amplitude by the model"))
    return found


def _without_zero_current(fit: DynamicFit, reference: float) -> list[Estimate]:
    """Return the estimates of a campaign that has no run at 0 A.

    k2 and k_MR enter as a sum then: k2 is told at each current and holds k_MR, which is open.
    """
    told: list[Estimate] = []
    for e in fit.estimates:
        current = e.at.get("coil_current")
        if e.name == "k2":
            reason = e.reason if e.value is None else "holds k_MR at this current: there is no run at 0 A"
            told.append(replace(e, at={"coil_current": reference}, reason=reason))
        elif e.name == "k_mr" and isinstance(current, float):
            told.append(undetermined("k_mr", "needs a run at 0 A; k2 at this current holds it", e.at))
            told.append(_static(fit, e, current))
        else:
            told.append(e)
    return told


def _static(fit: DynamicFit, increment: Estimate, current: float) -> Estimate:
    """Return k2 + k_MR at a current other than the reference."""
    at = {"coil_current": current}
    members = [fit.names.index("k2"), fit.names.index(f"k_mr at {current:g} A")]
    if increment.value is None or fit.one("k2").value is None:
        return undetermined("k2", "k2 or k_MR is not determined", at)
    gradient = np.zeros(len(fit.names))
    gradient[members] = 1.0
    sd, dof = fit.errors.of(gradient)
    reason = "holds k_MR at this current: there is no run at 0 A"
    return estimate("k2", float(fit.values[members].sum()), sd, dof=dof, at=at, reason=reason)


def _told(estimates: Sequence[Estimate]) -> list[Estimate]:
    """Leave out the sums whose members are known, and what is no parameter of the findings."""
    open_ = {e.name for e in estimates if not e.determined}
    return [e for e in estimates if e.name in _SPECS and (e.name not in _SUMS or _SUMS[e.name] & open_)]


def _parameter(estimate: Estimate, at: OperatingPoint, method: str) -> Parameter:
    spec = _SPECS[estimate.name]
    value = estimate.value if estimate.value is not None and math.isfinite(estimate.value) else None
    if value is None:
        description = estimate.reason or "not determined"
    else:
        description = f"{spec.description}; {estimate.reason}" if estimate.reason else spec.description
    return Parameter(
        name=estimate.name,
        symbol=spec.symbol,
        value=value,
        std_error=estimate.std_error if value is not None else None,
        ci95=estimate.ci95 if value is not None else None,
        unit=spec.unit,
        at=at,
        description=description,
        source=spec.source,
        method=method,
    )


def run_metrics(usable: UsableRun, fit: DynamicFit | None) -> list[Estimate]:
    """Return the numbers of one loop, the force set right by the lag that the fit found."""
    assert usable.loop is not None
    lag = fit.force_lag if fit is not None and not fit.rejected else None
    known = lag is not None and lag.value is not None
    scattered = fit is not None and not fit.rejected
    found = loop_metrics(
        usable.loop,
        force_lag=float(lag.value or 0.0) if known and lag else 0.0,
        force_lag_sd=float(lag.std_error or 0.0) if known and lag else 0.0,
        run_scatter=fit.run_scatter if scattered and fit else 0.0,
        scatter_dof=fit.scatter.dof if scattered and fit else math.inf,
        pads=usable.pads,
    )
    if known:
        return found
    stiffness = next((e.value for e in found if e.name == "stiffness_storage" and e.value is not None), None)
    if stiffness is None:
        return found
    lost = f"the lag of the force is not known and not in the interval: 10 us take {1e-5 * abs(stiffness):.2g} N s/m from it"
    return [replace(e, reason=e.reason or lost) if e.name == "damping" and e.determined else e for e in found]


def loop_parameters(runs: SortedRuns, fit: DynamicFit | None) -> list[Parameter]:
    """Return loop metrics per run, with the run's own current, frequency, amplitude, preload in `at`."""
    found: list[Parameter] = []
    for usable in runs.loops:
        assert usable.loop is not None
        at = _operating_point(usable, usable.loop.frequency, usable.loop.amplitude)
        method = "harmonic regression of the steady cycles"
        found += [_parameter(e, at, method) for e in run_metrics(usable, fit) if e.name in _SPECS]
    for usable in runs.half_cycles:
        at = _operating_point(usable, None, float(np.abs(usable.series.x - usable.series.x[0]).max()))
        try:
            metrics = half_cycle_metrics(usable.run, usable.series.x, usable.series.F, pads=usable.pads)
        except ValueError as error:
            runs.say("warning", usable.run, f"no loop metrics: {error}.")
            continue
        found += [_parameter(e, at, "one half cycle: load and unload") for e in metrics if e.name in _SPECS]
    return found


def linear_parameters(runs: SortedRuns, linear: Sequence[LinearEquivalent]) -> list[Parameter]:
    """Return spring and damper of the records that need no more."""
    usable = {u.run: u for u in runs.records}
    found = []
    for equivalent in linear:
        run = usable[equivalent.run]
        at = _operating_point(run, None, float(np.ptp(run.series.x)) / 2)
        method = f"F = K x + C v over the record, misfit {100 * equivalent.nrmse:.2g} % of the force"
        found += [_parameter(e, at, method) for e in equivalent.estimates]
    return found


def _operating_point(usable: UsableRun, frequency: float | None, amplitude: float) -> OperatingPoint:
    at: OperatingPoint = {"run": usable.run}
    given = {"coil_current": usable.current, "frequency": frequency, "amplitude": amplitude, "preload": usable.preload}
    at.update({name: float(f"{value:.6g}") for name, value in given.items() if value is not None})
    return at


def models_of(
    dynamic: Identification | None, without: LeaveOneOut | None, times: Sequence[TimeFit]
) -> list[ModelResult]:
    """Return the variants that were compared, and the fits in time."""
    models = []
    for variant in dynamic.variants if dynamic is not None else ():
        assert dynamic is not None
        selected = variant.variant == dynamic.selected.variant
        models.append(
            ModelResult(
                name=variant.variant,
                selected=selected,
                n_parameters=variant.n_parameters,
                n_data=variant.n_data,
                rms_residual=variant.rms_residual,
                unit="N",
                nrmse=variant.nrmse,
                chi2_reduced=variant.chi2 / max(variant.dof, 1),
                aicc=variant.aicc,
                bic=variant.bic,
                cv_error=without.cv_error if selected and without is not None else None,
                description=VARIANT_TEXTS.get(variant.variant, ""),
            )
        )
    for number, fit in enumerate(times):
        models.append(
            ModelResult(
                name="time_domain" if len(times) == 1 else f"time_domain_{number}",
                selected=number == 0,
                n_parameters=fit.n_parameters,
                n_data=fit.n_data,
                rms_residual=fit.rms_residual,
                unit="N",
                nrmse=fit.nrmse,
                aicc=fit.aicc,
                bic=fit.bic,
                cv_error=fit.nrmse_second_half,
                description="fitted in time; predicts the second half from the first",
            )
        )
    return models
