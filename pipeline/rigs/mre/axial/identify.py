"""`mre.axial`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.estimation.estimate import Estimate
from pipeline.findings import Findings, ModelResult, Parameter, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.axial.arrays import arrays_of
from pipeline.rigs.mre.axial.declaration import PARAMETERS, AxialSettings
from pipeline.rigs.mre.axial.levels import Current, Level, current_of, levels_of, stiffening
from pipeline.rigs.mre.axial.published import published
from pipeline.rigs.mre.axial.record import UnfitError
from pipeline.rigs.mre.axial.run_fit import RunFit, fit_run
from pipeline.rigs.mre.axial.variants import variants_of
from pipeline.rigs.mre.axial.verdict import judge
from pipeline.rigs.mre.flux_levels import flux_levels
from pipeline.rigs.nothing_usable import nothing_usable

_SPECS = {spec.name: spec for spec in PARAMETERS}
# What the gain of the force and of the displacement goes into, and with which power.
_GAINS = {
    "stiffness": (1, -1), "stiffness_secant": (1, -1), "stiffness_slope": (1, -1), "stiffness_cubic": (1, -3),
    "alpha": (1, 0), "unloading_drop": (1, 0), "rho": (0, -1),
}  # fmt: skip


def identify(recordings: Sequence[Recording], settings: AxialSettings, context: Context) -> Findings:
    """Identify a compression campaign.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    fits: list[RunFit] = []
    currents: dict[str, Current] = {}
    left_out: dict[str, str] = {}
    quality: list[QualityFinding] = []
    for recording in recordings:
        try:
            current = current_of(recording)
            if not current.steady:
                raise UnfitError(current.doubt, "current")
            fit = fit_run(recording)
        except (UnfitError, InputError) as error:
            reason = str(error).rstrip(".")
            left_out[recording.run] = reason
            channel = error.channel if isinstance(error, UnfitError) else None
            quality.append(QualityFinding("error", f"left out: {reason}.", recording.run, channel))
            continue
        fits.append(fit)
        currents[fit.run] = current
        quality += _said(fit, currents[fit.run])
    if not fits:
        raise InputError(nothing_usable(left_out, recordings))
    levels = levels_of(fits, currents, settings.current_tolerance)
    estimates = [e for level in levels for e in level.numbers.values()] + stiffening(levels)
    judgement = judge(levels, currents, left_out, estimates)
    condemned = any(fit.rejected for fit in fits)
    return Findings(
        campaign=context.campaign,
        experiment="mre.axial",
        verdict=judgement.verdict,
        reasons=judgement.reasons,
        advice=judgement.advice,
        parameters=[_parameter(e, settings, condemned and _of_rejected(e, levels)) for e in estimates],
        models=_models(levels),
        published=published(levels, recordings),
        quality=[Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in quality],
        runs=[Run(run=r.run, used=r.run not in left_out, reason=left_out.get(r.run, "")) for r in recordings],
        arrays={**arrays_of(levels), **_flux(recordings)},
    )


def _said(fit: RunFit, current: Current) -> list[QualityFinding]:
    """Return what is said of a run: each doubt once, with its channel where ingest-like findings name one."""
    told = {finding.message for finding in fit.said}
    more = [QualityFinding("warning", _sentence(d), fit.run) for d in fit.doubts if d not in told]
    more += [QualityFinding("error", _sentence(r), fit.run, "force_axial") for r in fit.rejected]
    if current.doubt:
        more.append(QualityFinding("warning", f"{_sentence(current.doubt)}", fit.run, "current"))
    return [*fit.said, *more]


def _sentence(text: str) -> str:
    text = text.rstrip(".")
    return f"{text[0].upper()}{text[1:]}."


def _of_rejected(e: Estimate, levels: Sequence[Level]) -> bool:
    """Tell whether an estimate comes from a run whose loop is rejected."""
    bad = [level for level in levels if any(fit.rejected for fit in level.runs)]
    at_bad = any(dict(e.at) == level.at for level in bad)
    return at_bad or (e.name.startswith("stiffening") and any(level.current == 0 for level in bad))


def _parameter(e: Estimate, settings: AxialSettings, rejected: bool) -> Parameter:
    spec = _SPECS[e.name]
    value, error, interval, reason = e.value, e.std_error, e.ci95, e.reason
    force, displacement = _GAINS.get(e.name, (0, 0))
    gain = math.hypot(force * settings.force_gain_error, displacement * settings.displacement_gain_error)
    if rejected:
        value, error, interval, reason = None, None, None, "the loop of a run is rejected, see the quality findings"
    elif value is not None and gain > 0 and interval is not None and error is not None:
        more = 1.96 * gain * abs(value)
        low, high = (math.hypot(end - value, more) for end in interval)
        error, interval = math.hypot(error, gain * abs(value)), (value - low, value + high)
        reason = "; ".join(text for text in (reason, f"the error holds {100 * gain:.2g} % of calibration") if text)
    told = f"{spec.description}: {reason}" if value is None else "; ".join(t for t in (spec.description, reason) if t)
    return Parameter(
        name=e.name,
        symbol=spec.symbol,
        value=value,
        std_error=error,
        type_b=gain * abs(value) if value is not None and gain > 0 and interval is not None else None,
        ci95=interval,
        unit=spec.unit,
        at=dict(e.at),
        description=told,
        source=spec.source,
        method="" if value is None else "difference of levels" if e.name.startswith("stiffening") else "loop model, force and gauge fitted together",
    )  # fmt: skip


def _models(levels: Sequence[Level]) -> list[ModelResult]:
    return [model for level in levels for fit in level.runs for model in variants_of(fit)]


def _flux(recordings: Sequence[Recording]) -> dict[str, object]:
    table = flux_levels(recordings)
    return {"flux_levels": table} if len(table) else {}
