"""`mre.step`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Findings, ModelResult, Parameter, Published, Run
from pipeline.findings.findings import OperatingPoint
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.record import UnusableError
from pipeline.rigs.mre.step.arrays import arrays_of
from pipeline.rigs.mre.step.declaration import PARAMETERS, StepSettings
from pipeline.rigs.mre.step.faults import judge_fit, judge_record
from pipeline.rigs.mre.step.lag_fit import Found, LagFit, fit_lags
from pipeline.rigs.mre.step.lag_problem import name_of
from pipeline.rigs.mre.step.record import Record, record_of
from pipeline.rigs.mre.step.repeats import judge_repeats
from pipeline.rigs.mre.step.times import estimates_of, largest
from pipeline.rigs.mre.step.withheld import filter_remark, without_breaks, without_coil
from pipeline.rigs.nothing_usable import nothing_usable

_SPECS = {spec.name: spec for spec in PARAMETERS}
_ELSEWHERE = {
    "axial_loop": "mre.axial", "hold_sweep": "mre.hold", "field_map": "mre.hold", "blank": "mre.hold",
    "shear": "mre.shear", "preload": "mre.shear", "shear_rich": "mre.shear_rich",
}  # fmt: skip


def identify(recordings: Sequence[Recording], settings: StepSettings, context: Context) -> Findings:
    """Identify a campaign of step tests; each log by itself.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    doubts = Doubts()
    left_out: dict[str, str] = {}
    found: list[tuple[Found, list[Estimate]]] = []
    for recording in recordings:
        try:
            record = usable(recording)
            fits = fit_lags(record)
        except (UnusableError, InputError, ValueError) as error:
            left_out[recording.run] = str(error).rstrip(".")
            continue
        found.append((fits, without_coil(fits.fit, estimates_of(fits.fit, calibrated(record)))))
    if not found:
        raise InputError(nothing_usable(left_out, recordings))
    for run, reason in left_out.items():
        doubts.doubt(run, f"left out: {reason}.")
    parameters: list[Parameter] = []
    for number, (fits, fitted) in enumerate(found):
        record = fits.fit.record
        judge_record(record, settings, doubts)
        estimates = without_breaks(fits.fit, fitted, doubts)
        found[number] = (fits, estimates)
        at: OperatingPoint = {"run": record.run} if len(found) > 1 else {}
        sound = judge_fit(fits.fit, estimates, settings, doubts)
        told = [*estimates, *_forces(fits.fit)]
        if not sound:
            reason = "the force of this run is not to be used, see the reasons"
            # Times do not depend on the unit of the force.
            told = [undetermined(e.name, reason, e.at) if e.name in ("creep", "force_step") else e for e in told]
        parameters += [_parameter(e, at) for e in told]
    judge_repeats([(fits.fit, told) for fits, told in found], doubts)
    remarks = [remark for fits, told in found if (remark := filter_remark(fits.fit, told))]
    for campaign, other in context.uses.items():
        doubts.note(
            None,
            f"campaign '{campaign}' ({other.experiment}) was handed over and is not used: a step test uses no other findings.",
        )
    return Findings(
        campaign=context.campaign,
        experiment="mre.step",
        verdict=doubts.said.verdict,
        reasons=[
            *(
                doubts.said.reasons
                or [
                    "Both directions are determined, the force settled after each step, and the residual is no more than the noise."
                ]
            ),
            *remarks,
        ],
        parameters=parameters,
        models=[model for fits, _ in found for model in _models(fits, len(found) > 1)],
        published=_published(found[0][1]),
        quality=doubts.quality,
        runs=[Run(run=r.run, used=r.run not in left_out, reason=left_out.get(r.run, "")) for r in recordings],
        advice=doubts.said.advice,
        arrays=arrays_of(found),
    )


def usable(recording: Recording) -> Record:
    """Return what this experiment needs of a log.

    Raises
    ------
    UnusableError
        If it cannot be used, or says that it belongs to another experiment.
    """
    test = str(recording.conditions.get("test", "")).lower()
    if test in _ELSEWHERE:
        raise UnusableError(f"its condition 'test' is '{test}': that belongs to {_ELSEWHERE[test]}")
    return record_of(recording)


def calibrated(record: Record) -> float:
    """Return how late the force is, s, as calibrated; 0 where it was not."""
    lag = record.recording.conditions.get("force_lag")
    return float(lag) if isinstance(lag, float) else 0.0


def _forces(fit: LagFit) -> list[Estimate]:
    """Return creep, and the change of the force by the largest step of each direction."""
    t, dof = t_quantile(fit.covariance.dof), fit.covariance.dof
    first = len(fit.names)
    told = []
    wanted: list[tuple[str, int, float, OperatingPoint]] = [("creep", first + 1, -1.0, {})]
    for direction in fit.lags:
        number, step = largest(fit, direction)
        wanted.append(("force_step", first + 2 + number, step.after - step.before, {"direction": direction}))
    for name, place, scale, at in wanted:
        variance = float(fit.covariance.matrix[place, place])
        if not math.isfinite(variance):
            told.append(undetermined(name, "the data do not determine it beside the others", at))
            continue
        value, sd = scale * float(fit.c[place - first]), abs(scale) * math.sqrt(variance)
        told.append(Estimate(name, value, sd, (value - t * sd, value + t * sd), dict(at), dof=dof))
    return told


def _parameter(e: Estimate, at: OperatingPoint) -> Parameter:
    spec = _SPECS[e.name]
    return Parameter(
        name=e.name,
        symbol=spec.symbol,
        value=e.value,
        std_error=e.std_error,
        ci95=e.ci95,
        unit=spec.unit,
        at={**at, **dict(e.at)},
        description=e.reason if e.value is None else f"{spec.description}{f'; {e.reason}' if e.reason else ''}",
        source=spec.source,
        method="separable least squares on the measured current, errors widened for coloured residuals",
    )


def _models(found: Found, several: bool) -> list[ModelResult]:
    fit = found.fit
    chosen = name_of(fit.lags)
    prefix = f"{fit.record.run}: " if several else ""
    spread = float(fit.record.force.std())
    return [
        ModelResult(
            name=f"{prefix}{candidate.name}",
            family=fit.record.run if several else "",
            selected=candidate.name == chosen,
            n_parameters=candidate.n_parameters,
            n_data=candidate.n_data,
            rms_residual=fit.sigma if candidate.name == chosen else None,
            unit="N",
            nrmse=fit.sigma / spread if candidate.name == chosen and spread > 0 else None,
            aicc=candidate.aicc,
            bic=candidate.bic,
        )
        for candidate in found.candidates
    ]


def _published(estimates: Sequence[Estimate]) -> list[Published]:
    """Return the paper's one statement on the response: it prints no number."""
    times = {e.at["direction"]: e for e in estimates if e.name == "t63" and e.value is not None}
    if len(times) < 2:
        return []
    rise, fall = times["rise"].value or 0.0, times["fall"].value or 0.0
    return [
        Published(
            name="response to switching on and off",
            published="fast on the rise, slower on the fall",
            found=f"t63 {1e3 * rise:.3g} ms and {1e3 * fall:.3g} ms, {fall / rise:.3g} times as long"
            if rise > 0
            else None,
            where="section 5.2, figure lost",
            agrees=bool(fall > rise),
            remark="the paper's numbers are lost with its figure",
        )
    ]


def _read(time: float) -> str:
    return f"{time:.3g} s" if time >= 1.0 else f"{1e3 * time:.3g} ms"
