"""`rap.therapy`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.errors import InputError, counted
from pipeline.findings import Findings, Parameter, Published, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.therapy.declaration import TherapySettings
from pipeline.rigs.rap.therapy.faults import examined
from pipeline.rigs.rap.therapy.outcome.arrays import Tables
from pipeline.rigs.rap.therapy.outcome.checks import OF_THE_LOG, Check, checks_of
from pipeline.rigs.rap.therapy.outcome.paper import paper_alone
from pipeline.rigs.rap.therapy.outcome.parameters import in_order, parameters_of, untold_by
from pipeline.rigs.rap.therapy.outcome.published import published_of
from pipeline.rigs.rap.therapy.outcome.verdict import judge
from pipeline.rigs.rap.therapy.record import PARTS
from pipeline.rigs.rap.therapy.run_numbers import numbers_of


@dataclass
class _Campaign:
    """What is kept of the runs once their samples are let go."""

    tables: Tables = field(default_factory=Tables)
    parameters: list[Parameter] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    published: list[Published] = field(default_factory=list)
    quality: list[QualityFinding] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    untold: set[tuple[str, str]] = field(default_factory=set)


def identify(recordings: Sequence[Recording], settings: TherapySettings, context: Context) -> Findings:
    """Identify a campaign of therapy runs: each run gives what its channels allow.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    campaign = _Campaign()
    for place, recording in enumerate(recordings):
        context.progress(place / max(len(recordings), 1), f"run {recording.run}")
        _take(recording, settings, campaign)
    if len(campaign.left_out) == len(recordings):
        raise InputError(_nothing_usable(campaign.left_out, context))
    quality = list(dict.fromkeys(campaign.quality))
    parameters = in_order(campaign.parameters)
    said = judge(campaign.checks, parameters, campaign.left_out, quality, campaign.untold)
    return Findings(
        campaign=context.campaign,
        experiment="rap.therapy",
        verdict=said.verdict,
        reasons=said.reasons,
        parameters=parameters,
        published=[*campaign.published, *paper_alone()],
        quality=[Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in quality],
        runs=[
            Run(
                run=r.run,
                used=r.run not in campaign.left_out,
                reason=campaign.left_out.get(r.run, ""),
                conditions=dict(r.conditions),
            )
            for r in recordings
        ],
        advice=said.advice,
        arrays=campaign.tables.frames(),
    )


def _take(recording: Recording, settings: TherapySettings, campaign: _Campaign) -> None:
    """Add what one run gives, or why it gives nothing."""
    reason = nothing_asked(recording)
    if reason:
        campaign.left_out[recording.run] = reason
        campaign.quality.append(QualityFinding("error", f"left out: {reason}.", recording.run))
        return
    record, found = examined(recording)
    run = numbers_of(record, settings)
    campaign.quality += [*found, *run.findings]
    parameters = parameters_of(run)
    if not any(run.tells.values()) and not any(one.value is not None for one in parameters):
        reasons = [*(q.message for q in found if q.level == "error"), *run.reasons.values()]
        campaign.left_out[recording.run] = reasons[0] if reasons else "it gives no number"
        campaign.quality.append(QualityFinding("error", f"left out: {campaign.left_out[recording.run]}", recording.run))
        return
    checks = checks_of(run, settings)
    campaign.quality += [
        QualityFinding("warning", one.sentence, run.run, span=one.span)
        for one in checks
        if one.criterion in OF_THE_LOG and one.mood in ("warning", "rejected")
    ]
    campaign.untold |= {(run.run, name) for name in untold_by(run)}
    campaign.parameters += parameters
    campaign.checks += checks
    campaign.published += published_of(run)
    campaign.tables.add(run, checks)


def nothing_asked(recording: Recording) -> str:
    """Say why a run has nothing to do with a therapy, '' where it has."""
    names = {channel for stream in recording.streams.values() for channel in stream.channels}
    looked_for = sorted({name for channels in PARTS.values() for name in channels})
    if names & set(looked_for):
        return ""
    return (
        f"run '{recording.run}' has no channel that tells anything of a therapy run. It needs at least one of {', '.join(looked_for)}; "
        "name what the log has in the recipe, under 'channels'"
    )


def _nothing_usable(left_out: dict[str, str], context: Context) -> str:
    """Say why no run can be used: the first reason, and how many others there are."""
    if not left_out:
        return f"campaign '{context.campaign}': there is no run."
    (first, reason), *others = left_out.items()
    more = f" {counted(len(others), 'more run')} cannot be used either." if others else ""
    return f"campaign '{context.campaign}': run '{first}' cannot be used: {reason.rstrip('.')}.{more}"
