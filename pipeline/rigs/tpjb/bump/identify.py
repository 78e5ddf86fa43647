"""`tpjb.bump`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.findings import Findings, ModelResult, Parameter, Published, Quality, Run
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.nothing_usable import nothing_usable
from pipeline.rigs.tpjb.bump.arrays import arrays_of
from pipeline.rigs.tpjb.bump.bearing_fit import BearingFit, fit_bearing
from pipeline.rigs.tpjb.bump.declaration import BumpSettings
from pipeline.rigs.tpjb.bump.estimates import parameters_of
from pipeline.rigs.tpjb.bump.faults import Doubts, judge, wrong_unit
from pipeline.rigs.tpjb.bump.record import Record, UnusableError, record_of


def identify(recordings: Sequence[Recording], settings: BumpSettings, context: Context) -> Findings:
    """Identify a bump campaign: one bearing, or several told apart by the condition `bearing`.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    judgement = Doubts()
    left_out: dict[str, str] = {}
    records: dict[str, list[Record]] = {}
    for recording in recordings:
        try:
            record = record_of(recording)
        except (UnusableError, InputError) as error:
            left_out[recording.run] = str(error).rstrip(".")
            continue
        records.setdefault(str(recording.conditions.get("bearing", "")), []).append(record)
    fits: dict[str, BearingFit] = {}
    for bearing, members in records.items():
        try:
            fits[bearing] = fit_bearing(members, settings)
        except UnusableError as error:
            left_out.update({member.recording.run: str(error) for member in members})
    if not fits:
        raise InputError(nothing_usable(left_out, recordings))
    for run, reason in left_out.items():
        judgement.doubt(f"Run '{run}' was left out: {reason}.")
    for fit in fits.values():
        for record in fit.records:
            _say(record, judgement)
        judge(fit, settings, judgement)
    parameters = []
    for campaign, other in context.uses.items():
        text = f"campaign '{campaign}' ({other.experiment}) was handed over and is not used: a bump test uses no other findings."
        judgement.quality.append(Quality(level="note", message=text))
    for bearing, fit in fits.items():
        parameters += parameters_of(fit, {"bearing": bearing} if len(fits) > 1 else {}, wrong_unit(fit))
    _alignment(parameters, settings, judgement)
    return Findings(
        campaign=context.campaign,
        experiment="tpjb.bump",
        verdict=judgement.verdict,
        reasons=judgement.reasons or ["The polygon has converged, every side was touched, the contact law holds."],
        parameters=parameters,
        models=[model for bearing, fit in fits.items() for model in _models(fit, bearing if len(fits) > 1 else "")],
        published=_published(fits),
        quality=judgement.quality,
        runs=[Run(run=r.run, used=r.run not in left_out, reason=left_out.get(r.run, "")) for r in recordings],
        advice=judgement.advice,
        arrays=arrays_of(fits),
    )


def _say(record: Record, judgement: Doubts) -> None:
    """Hand on what was odd about a log; anything above a note leaves a doubt."""
    for f in record.findings:
        judgement.quality.append(Quality(level=f.level, run=f.run, channel=f.channel, span=f.span, message=f.message))
        if f.level != "note":
            (judgement.reject if f.level == "error" else judgement.warn)(f"Run '{record.recording.run}': {f.message}")


def _alignment(parameters: Sequence[Parameter], settings: BumpSettings, judgement: Doubts) -> None:
    """Hold the tilt against its limit."""
    tilts = [p for p in parameters if p.name in ("tilt_x", "tilt_y") and p.value is not None]
    size = math.hypot(*(p.value or 0.0 for p in tilts[:2])) if len(tilts) >= 2 else 0.0
    if size > settings.alignment_limit:
        judgement.doubt(
            f"The bearing is tilted against the shaft by {1e6 * size:.3g} urad, more than the limit of "
            f"{1e6 * settings.alignment_limit:.3g} urad.",
            "Adjust the pitch stabilisers.",
        )


def _models(fit: BearingFit, bearing: str) -> list[ModelResult]:
    """Return the polygons tried and the contact law; the one that the parameters come from is selected."""
    prefix = f"{bearing}: " if bearing else ""
    top = fit.blocks.level == fit.blocks.level.max()
    d = next(iter(fit.blocks.planes.values()))[top]
    size = float(np.sqrt(((d - d.mean(axis=0)) ** 2).sum(axis=1).mean()))
    models = [
        ModelResult(
            name=f"{prefix}polygon of {n} sides",
            selected=fit.contact is None and n == fit.n_pads,
            n_parameters=n + 1,
            n_data=int(top.sum()),
            rms_residual=misfit,
            unit="m",
            nrmse=misfit / size,
            description="distance of the orbit at the largest force from the polygon, plane with the lowest number",
        )
        for n, misfit in fit.count.misfits.items()
    ]
    if fit.contact is not None:
        n_data, k = fit.contact.fit.residual.size, len(fit.contact.fit.names)
        off = np.concatenate(
            [(fit.contact.predicted[p] - fit.blocks.planes[p])[fit.contact.kept].ravel() for p in fit.blocks.planes]
        )
        models.append(
            ModelResult(
                name=f"{prefix}contact law, {fit.n_pads} pads",
                selected=True,
                n_parameters=k,
                n_data=n_data,
                rms_residual=float(np.sqrt(np.mean(off**2))),
                unit="m",
                nrmse=float(np.sqrt(2 * np.mean(off**2))) / size,
                chi2_reduced=fit.contact.chi2_reduced,
                bic=fit.contact.fit.chi2 + k * math.log(n_data),
                description="all levels and planes; the rms holds the noise of the force where the stator slides, chi2 weighs it",
            )
        )
    return models


def _published(fits: dict[str, BearingFit]) -> list[Published]:
    rows = []
    for fit in fits.values():
        misfit = fit.count.misfits[fit.n_pads]
        rows.append(
            Published(
                name="orbit of the bump test",
                published="polygonal",
                found=f"{fit.n_pads} sides, rms distance {1e6 * misfit:.2g} um at {max(fit.blocks.levels):.3g} N",
                where="section 2",
                agrees=fit.count.found is not None,
                remark="the paper gives no clearance, centre or stiffness (NDA), so that no number can be compared",
            )
        )
    return rows
