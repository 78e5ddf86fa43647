"""`mre.hold`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.findings import Findings, ModelResult, Parameter, Run
from pipeline.findings.findings import OperatingPoint
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.agreement import judge_repeats
from pipeline.rigs.mre.hold.analysis import Analysed, analyse
from pipeline.rigs.mre.hold.arrays import arrays_of
from pipeline.rigs.mre.hold.blank import Blank, blank_of
from pipeline.rigs.mre.hold.declaration import PARAMETERS, HoldSettings
from pipeline.rigs.mre.hold.field_faults import judge_field
from pipeline.rigs.mre.hold.field_fit import FieldFit, fit_field
from pipeline.rigs.mre.hold.force_faults import judge_force
from pipeline.rigs.mre.hold.published import published
from pipeline.rigs.mre.hold.record import Record, UnusableError, record_of
from pipeline.rigs.mre.hold.record_faults import judge_record
from pipeline.rigs.mre.hold.told import told_of
from pipeline.rigs.nothing_usable import nothing_usable

_SPECS = {spec.name: spec for spec in PARAMETERS}
_ELSEWHERE = {
    "axial_loop": "mre.axial",
    "step": "mre.step",
    "shear": "mre.shear",
    "preload": "mre.shear",
    "shear_rich": "mre.shear_rich",
}
_FORCE = ("force_initial", "force_gain", "saturation_current", "sharpness", "relaxation")
_BLANK = ("blank", "spacer")


def identify(recordings: Sequence[Recording], settings: HoldSettings, context: Context) -> Findings:
    """Identify a hold campaign: one sweep, or several; the field map and the blank test may be logs of their own.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    doubts = Doubts()
    left_out: dict[str, str] = {}
    records = _records(recordings, settings, left_out)
    blank = _blank(records, left_out)
    fields = {
        record.run: field for record in records if not is_blank(record) and (field := fit_field(record)) is not None
    }
    analysed: list[Analysed] = []
    for record in records:
        if is_blank(record) or record.of("force_axial") is None or is_field_map(record):
            continue
        try:
            analysed.append(analyse(record, blank, fields.get(record.run) or next(iter(fields.values()), None)))
        except ValueError as error:
            left_out[record.run] = str(error)
            fields.pop(record.run, None)
    if not analysed and not fields:
        raise InputError(nothing_usable(left_out, recordings))
    for run, reason in left_out.items():
        doubts.doubt(run, f"left out: {reason.rstrip('.')}.")
    for record in records:
        if record.run not in left_out:
            judge_record(record, settings, doubts)
    usable_force = {found.run for found in analysed if judge_force(found, doubts)}
    judge_repeats([found for found in analysed if found.run in usable_force], doubts)
    by_run = {record.run: record for record in records}
    sound = {run: field for run, field in fields.items() if judge_field(field, by_run[run], settings, doubts)}
    if not analysed:
        doubts.doubt(None, "there is no log with an axial force: only the field was identified.")
    for campaign, other in context.uses.items():
        doubts.note(
            None,
            f"campaign '{campaign}' ({other.experiment}) was handed over and is not used: a hold test uses no other findings.",
        )
    return Findings(
        campaign=context.campaign,
        experiment="mre.hold",
        verdict=doubts.said.verdict,
        reasons=doubts.said.reasons
        or ["Saturation was passed, both sweeps agree with the law, and the residual is no more than the noise."],
        parameters=_parameters(analysed, usable_force, fields, sound),
        models=[model for found in analysed for model in _models(found, len(analysed) > 1)],
        published=published(analysed, sound, recordings),
        quality=doubts.quality,
        runs=[Run(run=r.run, used=r.run not in left_out, reason=left_out.get(r.run, "")) for r in recordings],
        advice=doubts.said.advice,
        arrays=arrays_of(analysed, sound, blank, by_run),
    )


def is_blank(record: Record) -> bool:
    """Tell whether a log is that of a spacer."""
    return str(record.recording.conditions.get("test", "")).lower() in _BLANK


def is_field_map(record: Record) -> bool:
    """Tell whether a log is declared to be one of the field alone."""
    return str(record.recording.conditions.get("test", "")).lower() == "field_map"


def usable(recording: Recording, settings: HoldSettings) -> Record:
    """Return the holds of a log that this experiment can use.

    Raises
    ------
    UnusableError
        If there are none, or the log says that it belongs to another experiment.
    """
    test = str(recording.conditions.get("test", "")).lower()
    if test in _ELSEWHERE:
        raise UnusableError(f"its condition 'test' is '{test}': that belongs to {_ELSEWHERE[test]}")
    record = record_of(recording, settings.settle)
    force = record.of("force_axial")
    loaded = not is_blank(record) and not is_field_map(record)
    if force is not None and loaded and float(np.nanmedian(force.mean)) < 0:
        raise UnusableError(
            "force_axial is negative, but compression counts positive: mend it in the recipe with 'sign: -1' under 'channels'",
            "force_axial",
        )
    return record


def _records(recordings: Sequence[Recording], settings: HoldSettings, left_out: dict[str, str]) -> list[Record]:
    records = []
    for recording in recordings:
        try:
            records.append(usable(recording, settings))
        except (UnusableError, InputError) as error:
            left_out[recording.run] = str(error).rstrip(".")
    return records


def _blank(records: Sequence[Record], left_out: dict[str, str]) -> Blank | None:
    found = None
    for record in records:
        if is_blank(record):
            found = blank_of(record)
            if found is None:
                left_out[record.run] = "a blank test needs force_axial and a hold at 0 A"
    return found


def _parameters(
    analysed: Sequence[Analysed], forces: Collection[str], fields: Mapping[str, FieldFit], sound: Mapping[str, FieldFit]
) -> list[Parameter]:
    told: list[Parameter] = []
    for found in analysed:
        at: OperatingPoint = {"run": found.run} if len(analysed) > 1 else {}
        conditions = found.record.recording.conditions
        error = conditions.get("force_gain_error")
        gain = float(error) if isinstance(error, float) else 0.0
        offset = found.blank.zero_error if found.blank is not None else 0.0
        estimates = told_of(found, gain, offset)
        if found.run not in forces:
            reason = "the force of this run is not to be used, see the reasons"
            estimates = [undetermined(e.name, reason, e.at) for e in estimates]
        method = f"separable least squares on {found.fit.rows.current.size} holds: means and creep"
        told += [_parameter(e, at, method, gain if e.name == "force_initial" else 0.0) for e in estimates]
    if not analysed:
        told += [_parameter(undetermined(name, "there is no log with an axial force"), {}, "") for name in _FORCE]
    for run, field in fields.items():
        at = {"run": run} if len(fields) > 1 else {}
        estimates = field.estimates()
        if run not in sound:
            estimates = [
                undetermined(e.name, "the flux density of this run is not to be used, see the reasons", e.at)
                for e in estimates
            ]
        told += [_parameter(e, at, f"separable least squares on {field.current.size} holds") for e in estimates]
    if not fields:
        reason = "no flux density was logged, or on too few levels"
        told += [_parameter(undetermined(name, reason), {}, "") for name in ("flux_slope", "flux_saturation")]
    return told


def _parameter(e: Estimate, at: OperatingPoint, method: str, gain_error: float = 0.0) -> Parameter:
    """Return an estimate as a parameter; of its error `gain_error` times the value comes from the calibration."""
    spec = _SPECS[e.name]
    return Parameter(
        name=e.name,
        symbol=spec.symbol,
        value=e.value,
        std_error=e.std_error,
        type_b=gain_error * abs(e.value) if gain_error and e.value is not None else None,
        ci95=e.ci95,
        unit=spec.unit,
        at={**at, **dict(e.at)},
        description=e.reason if e.value is None else f"{spec.description}{f'; {e.reason}' if e.reason else ''}",
        source=spec.source,
        method=method,
    )


def _models(found: Analysed, several: bool) -> list[ModelResult]:
    straight = found.saturation.state == "not reached"
    texts = {
        "S law": "bends at I_s, the sharper the larger p",
        "hinge": "straight up to I_s, then flat: the S law with p → ∞",
        "tanh": "hyperbolic tangent, much like the S law with p = 2.5",
        "FK": "law of Froehlich and Kennelly, eq. (7) of the paper: the S law with p = 1",
        "straight line": "no saturation",
    }  # fmt: skip
    refused = f"; no number rests on it: {found.misfit.costs_law}" if found.misfit.costs_law else ""
    models = []
    for candidate in found.saturation.candidates:
        selected = candidate.name == ("straight line" if straight else "S law")
        models.append(
            ModelResult(
                name=f"{found.run}: {candidate.name}" if several else candidate.name,
                family=f"force against current{f', {found.run}' if several else ''}",
                selected=selected,
                n_parameters=candidate.n_parameters,
                n_data=candidate.n_data,
                rms_residual=float((found.rest**2).mean() ** 0.5) if selected else None,
                unit="N",
                nrmse=found.nrmse if selected else None,
                chi2_reduced=candidate.chi2 / max(candidate.n_data - candidate.n_parameters, 1),
                aicc=candidate.aicc,
                bic=candidate.bic,
                description=texts[candidate.name] + (refused if selected else ""),
            )
        )
    return models
