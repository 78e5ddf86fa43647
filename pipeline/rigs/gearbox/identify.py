"""`gearbox.load_exchange`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.errors import InputError
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.campaign_numbers import CampaignNumbers, campaign_of
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.load.checks import Misfit, load_law, run_order, same_inertia
from pipeline.rigs.gearbox.many.stand_for_all import shown_of
from pipeline.rigs.gearbox.one_run import SECONDS, Tasks, told_by
from pipeline.rigs.gearbox.outcome.arrays import arrays_of
from pipeline.rigs.gearbox.outcome.parameters import models_of, parameters_of
from pipeline.rigs.gearbox.outcome.published import published
from pipeline.rigs.gearbox.outcome.verdict import judge
from pipeline.rigs.nothing_usable import nothing_usable
from pipeline.rigs.over_runs import MANY


def identify(recordings: Sequence[Recording], settings: LoadExchangeSettings, context: Context) -> Findings:
    """Identify a campaign of load exchange.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    many = len(recordings) > MANY
    each = context.each(told_by, Tasks(recordings, drawn=not many), SECONDS * len(recordings))
    told = {}
    for done, one in enumerate(each, 1):
        told[one.run] = one
        context.progress(0.9 * done / len(recordings), f"run {one.run}")
    left_out = {one.run: one.left_out for one in told.values() if one.left_out}
    runs = [one.numbers for one in told.values() if one.numbers is not None]
    if not runs:
        raise InputError(nothing_usable(left_out, recordings))
    campaign = campaign_of(runs, {one.run: one.begins for one in told.values()})
    if many:
        chosen = set(shown_of(campaign))
        which = [place for place, run in enumerate(told) if run in chosen]
        drawn = context.each(told_by, Tasks([recordings[place] for place in which], drawn=True), SECONDS * len(which))
        told |= {one.run: one for one in drawn}
    vibration = {one.run: one.vibration for one in told.values()}
    quality = [finding for one in told.values() for finding in one.quality]
    quality = list(dict.fromkeys([*quality, *_campaign_faults(campaign), *_over_campaign(campaign)]))
    levels = [level for run in runs for level in vibration[run.name].levels]
    parameters = parameters_of(campaign, levels, settings)
    said = judge(campaign, parameters, vibration, left_out, quality, settings)
    return Findings(
        campaign=context.campaign,
        experiment="gearbox.load_exchange",
        verdict=said.verdict,
        reasons=said.reasons,
        parameters=parameters,
        models=models_of(campaign),
        published=published(campaign, parameters, vibration),
        quality=[Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in quality],
        runs=[
            Run(run=one.run, used=not one.left_out, reason=one.left_out, conditions=dict(one.conditions))
            for one in told.values()
        ],
        advice=said.advice,
        arrays=arrays_of(campaign, told, settings),
    )


def _campaign_faults(campaign: CampaignNumbers) -> list[QualityFinding]:
    """Return what the runs together contradict: the law of the load's drag, a trend over the runs."""
    load = campaign.load
    windows = [run.windows for run in campaign.runs if run.windows is not None]
    if load is None:
        return _failed([campaign.unlike])
    single = {
        run.name: run.load for run in campaign.runs if run.load is not None and run.name not in campaign.exceptions
    }
    misfits: list[Misfit | None] = [campaign.unlike, load_law(windows, load), same_inertia(single)]
    if len(single) > 3 and not campaign.mixed and not campaign.watched:
        values = np.array([float(one.values[0] - load.values[0]) for one in single.values()])
        errors = np.array([float(one.covariance.std_error[0]) for one in single.values()])
        dofs = np.array([one.covariance.dof for one in single.values()])
        speeds = np.array([run.speed for run in campaign.runs if run.name in single])
        misfits.append(run_order(values, errors, dofs, "the load's inertia", "kg m2", speeds))
    return _failed(misfits)


def _over_campaign(campaign: CampaignNumbers) -> list[QualityFinding]:
    """Return what changes over a campaign of many runs, and which are unlike the others."""
    return [QualityFinding("warning", sentence) for number in campaign.watched for sentence in number.sentences()]


def _failed(misfits: Sequence[Misfit | None]) -> list[QualityFinding]:
    return [
        QualityFinding("warning", f"{one.text} ({one.value:+.1f} {one.unit}, limit {one.limit:.1f})")
        for one in misfits
        if one is not None and one.failed
    ]
