"""The verdict on a campaign of load exchange, its reasons in plain words, what to measure next (gearbox.md, 7).

rejected  no run gives a number: every one is left out; or a torque is in another unit than declared, which falsifies them all.
warning   runs left out, steps of the protocol or core numbers missing, offsets unknown, a torque map whose slope is not 1, or any
          other warning.
ok        none of these.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pipeline.errors import counted, listing
from pipeline.estimation.uncertainty import t_quantile
from pipeline.findings import Parameter
from pipeline.recording import QualityFinding
from pipeline.rigs.gearbox.campaign_numbers import CampaignNumbers
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.load.inertia import unit_mistake
from pipeline.rigs.gearbox.outcome.core_numbers import missing
from pipeline.rigs.gearbox.outcome.verdict_many import by_kind, ended, over_campaign
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers
from pipeline.rigs.judgement import Judgement

_TOLD = 4
# Slope of the torque map that a bench can have (section 5.6).
_SLOPES = (0.2, 1.05)
# Slopes beyond these are no wrong gain but a wrong unit or range: none of the numbers holds.
_NO_GAIN = (0.12, 3.0)
# A slope whose interval reaches farther to either side tells no more than that there is one.
_VAGUE = 0.1
# Inertias that differ by less are one; shaft, coupling and brake disc add up to the second share to a flywheel.
_ALIKE, _MORE = 0.05, 0.25


def judge(
    campaign: CampaignNumbers,
    parameters: Sequence[Parameter],
    vibration: Mapping[str, VibrationNumbers],
    left_out: Mapping[str, str],
    quality: Sequence[QualityFinding],
    settings: LoadExchangeSettings,
) -> Judgement:
    """Weigh what was found."""
    said = Judgement()
    grave = [q for q in quality if q.level != "note" and q.run not in left_out]
    many = bool(campaign.watched)
    if many:
        # What changed and which runs are odd is what a reader of many runs looks for first.
        over_campaign(said, campaign)
        by_kind(said, left_out, grave)
    _sequence(said, campaign)
    _locked(said, campaign, vibration)
    _sensors(said, campaign, settings)
    _input_speed(said, campaign)
    _inertia(said, campaign)
    _speeds(said, campaign, settings)
    for sentence in missing(parameters, many):
        said.warn(sentence)
    if many:
        return said
    for run, reason in list(left_out.items())[:_TOLD]:
        said.warn(f"Run {run} is left out: {ended(reason)}")
    if len(left_out) > _TOLD:
        said.warn(f"{counted(len(left_out) - _TOLD, 'more run')} are left out, see the quality findings.")
    for finding in grave[:_TOLD]:
        said.warn(ended(_placed(finding)))
    if len(grave) > _TOLD:
        said.warn(f"{counted(len(grave) - _TOLD, 'more warning')} stand among the quality findings.")
    return said


def _placed(finding: QualityFinding) -> str:
    """Return a finding with its run, and with its channel where its words do not name it."""
    if not finding.run:
        return finding.message
    channel = f", {finding.channel}" if finding.channel and finding.channel not in finding.message else ""
    return f"Run {finding.run}{channel}: {finding.message}"


def _names(runs: Sequence[RunNumbers]) -> str:
    return listing([run.name for run in runs], 8)


def _sequence(said: Judgement, campaign: CampaignNumbers) -> None:
    odd = [run for run in campaign.runs if not run.segmentation.complete]
    if not odd:
        n = len(campaign.runs)
        said.reasons.append(f"The sequence of stages is complete in {'the run' if n == 1 else f'all {n} runs'}.")
        return
    said.warn(
        f"The sequence of stages is not complete in {counted(len(odd), 'run')} ({_names(odd)}), see the quality findings."
    )
    said.advice.append(
        "Keep to the protocol: 5 s at rest, start-up, FOS 5 s, brake on until the output stands, SOS 5 s, brake off, FOS 5 s, "
        "run-down, 5 s at rest."
    )


def _locked(said: Judgement, campaign: CampaignNumbers, vibration: Mapping[str, VibrationNumbers]) -> None:
    looked = [run for run in campaign.runs if run.record.vibration is not None and "fos" in run.run.stages]
    slipping = [run for run in looked if vibration[run.name].partial is not None]
    if looked and not slipping:
        said.reasons.append("FOS is locked: no mesh line stands in its vibration.")
    elif slipping:
        said.warn(f"FOS is not fully locked in {_names(slipping)}: mesh lines stand in its vibration.")
    else:
        lacks = "FOS" if any(run.record.vibration is not None for run in campaign.runs) else "vibration log"
        said.reasons.append(f"Whether FOS is really locked cannot be checked: there is no {lacks}.")


def _sensors(said: Judgement, campaign: CampaignNumbers, settings: LoadExchangeSettings) -> None:
    transfer = campaign.transfer
    if transfer is None and campaign.unlike is not None and campaign.unlike.failed:
        said.warn(
            f"The sensors are not consistent: {campaign.unlike.text}. T_0, lock and slip torque rest on the slope of their own run."
        )
        return
    if transfer is None:
        said.warn(
            f"The sensors' consistency cannot be checked, as nothing gives the slope of the torque map: {campaign.no_slope}."
        )
        return
    off = abs(transfer.slope - 1.0)
    low, high = (transfer.slope - limit for limit in _SLOPES)
    half = t_quantile(transfer.dof) * transfer.slope_error
    if low < -half or high > half:
        # Beyond any gain that an amplifier is set wrong by it is a unit.
        tell = said.reject if transfer.slope < _NO_GAIN[0] or transfer.slope > _NO_GAIN[1] else said.warn
        tell(
            f"The torque map has slope {transfer.slope:.3g}, which no gearbox locked as one body has ({_SLOPES[0]:g} to {_SLOPES[1]:g}): gain or "
            "unit of a torque sensor is wrong, and so is what follows from both torques."
        )
        return
    told = f"The torque map has slope {transfer.slope:.3f} ± {half:.3f}"
    if off <= half and half > _VAGUE:
        said.warn(f"{told}: too uncertain to tell whether the box is rigid and the sensors' gains are right.")
        said.advice.append(
            "Repeat the brake cycle with less noise, a slower brake or a higher speed: the slope needs a clear rise."
        )
        return
    if off <= settings.slope_tolerance or off <= half:
        said.reasons.append(f"{told}: as a rigid box has.")
        return
    said.warn(
        f"{told} and not 1: drag to ground grows by {1.0 - transfer.slope:.2f} N m per N m transmitted, or a torque sensor has the wrong "
        "gain. Efficiency, T_0, lock and slip torque depend on which; gear friction cannot be it, since locked gears do not slide."
    )
    said.advice.append(
        "Cross-calibrate the torque sensors: couple both shaft to shaft without the gearbox and run a brake cycle (the slope must be 1), and "
        "hang known weights on a lever. One bench run alone cannot tell drag from gain."
    )


def _input_speed(said: Judgement, campaign: CampaignNumbers) -> None:
    with_sos = [run for run in campaign.runs if "sos" in run.run.stages]
    if not with_sos:
        return
    by: dict[str, list[RunNumbers]] = {}
    for run in with_sos:
        by.setdefault(run.speed_in.source if run.speed_in else "nominal", []).append(run)
    words = {"measured": "measured", "mesh lines": "estimated from the mesh lines", "nominal": "assumed nominal"}
    told = "; ".join(f"{words[source]} in {_names(runs)}" for source, runs in by.items())
    if any(run.speed_in is not None and run.speed_in.teeth_assumed for run in with_sos):
        told += ", with the teeth of Table 1, as the runs state none"
    if "nominal" not in by:
        said.reasons.append(f"The input speed in SOS is {told}.")
        return
    whys: dict[str, list[RunNumbers]] = {}
    for run in by["nominal"]:
        whys.setdefault(run.speed_in.why if run.speed_in else "", []).append(run)
    alone = campaign.watched and len(whys) == 1
    because = "; ".join(
        f"{'' if alone else f'{_names(runs)}: '}{why}" for why, runs in list(whys.items())[:_TOLD] if why
    )
    said.warn(
        f"The input speed in SOS is {told}{f' ({because})' if because else ''}: the power dissipated is an upper limit there, since a "
        "drive may droop by tens of percent."
    )
    doubted = any(
        run.speed_in and run.record.vibration is not None and "teeth" in run.speed_in.why for run in by["nominal"]
    )
    said.advice.append(
        "State the teeth of the gearbox (sun, planet and ring of both trains, as '60 20 100; 12 44 100') or log the input speed: the mesh "
        "lines do not fit the teeth."
        if doubted
        else "Log the input speed, or vibration at 2.5 kHz or more: the power in SOS rests on an assumed input speed."
    )


def _speeds(said: Judgement, campaign: CampaignNumbers, settings: LoadExchangeSettings) -> None:
    """Say at how many speeds to measure where friction over speed cannot be told."""
    speeds, least = len(campaign.speeds), settings.least_speeds
    if not 0 < speeds < least:
        return
    lacking = "the law of the locked drag"
    if campaign.slip_law is None:
        lacking += ", and at two for the slip torque over the slip"
    said.advice.append(
        f"Repeat the cycle at {least} speeds or more (now {counted(speeds, 'speed')}), the fastest at four times the slowest: for {lacking}."
    )


def _inertia(said: Judgement, campaign: CampaignNumbers) -> None:
    load = campaign.load
    if load is None or "inertia_load" in load.undetermined:
        why = (
            "the output hardly accelerates with a free brake in these logs"
            if load is None
            else load.undetermined["inertia_load"]
        )
        tell = said.reject if load is not None and unit_mistake(load.values) else said.warn
        tell(f"The load's inertia cannot be told: {ended(why)}")
        return
    value, error = float(load.values[0]), float(load.covariance.std_error[0])
    known = [
        float(inertia)
        for run in campaign.runs
        if isinstance(inertia := run.record.conditions.get("flywheel_inertia"), int | float)
    ]
    half = t_quantile(load.covariance.dof) * error
    digits = max(0, 1 - math.floor(math.log10(half))) if half > 0.0 and math.isfinite(half) else 5
    told = f"The load's inertia is {value:.{digits}f} ± {half:.{digits}f} kg m^2; it trades off with the gain of the output torque sensor"
    if not known:
        said.reasons.append(f"{told}, which a known added inertia would break.")
        said.advice.append(
            "Repeat one run with a known added inertia: it separates the load's inertia from the gain of the output torque sensor."
        )
        return
    low, high = min(known), max(known)
    if high > (1.0 + _ALIKE) * low:
        said.reasons.append(f"{told}; the runs state different flywheels, {low:.4g} to {high:.4g} kg m^2.")
        return
    ratio, spread = value / known[0], 3.0 * error / known[0]
    words = f"{told}: {ratio:.3f} times the flywheel's stated {known[0]:.4g} kg m^2"
    if ratio < 1.0 - _ALIKE - spread:
        said.warn(
            f"{words}. What turns behind the sensor is more than the flywheel and not less: the gain of the output torque sensor is "
            f"{ratio:.3g} of what it should be or less, or the stated inertia is wrong."
        )
    elif ratio > 1.0 + _MORE + spread:
        said.warn(
            f"{words}: shaft and coupling add little, so the gain of the output torque sensor or the stated inertia is wrong."
        )
    else:
        said.reasons.append(f"{words}.")
