"""`gearbox.load_exchange`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import InputError
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.gearbox.campaign_numbers import CampaignNumbers, campaign_of
from pipeline.rigs.gearbox.declaration import LoadExchangeSettings
from pipeline.rigs.gearbox.faults import errors_of, input_faults
from pipeline.rigs.gearbox.load.checks import Misfit, load_law, run_order, same_inertia
from pipeline.rigs.gearbox.outcome.arrays import arrays_of
from pipeline.rigs.gearbox.outcome.parameters import models_of, parameters_of
from pipeline.rigs.gearbox.outcome.published import published
from pipeline.rigs.gearbox.outcome.verdict import judge
from pipeline.rigs.gearbox.record import record_of
from pipeline.rigs.gearbox.run_faults import run_faults, speed_faults
from pipeline.rigs.gearbox.run_numbers import RunNumbers, numbers_of
from pipeline.rigs.gearbox.vibration.vibration_numbers import VibrationNumbers, vibration_of
from pipeline.rigs.nothing_usable import nothing_usable


@dataclass
class _Sorted:
    """Numbers of the runs that can be used, why others are left out, and what was noticed."""

    numbers: list[RunNumbers] = field(default_factory=list)
    vibration: dict[str, VibrationNumbers] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    quality: list[QualityFinding] = field(default_factory=list)


def identify(recordings: Sequence[Recording], settings: LoadExchangeSettings, context: Context) -> Findings:
    """Identify a campaign of load exchange.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    runs = _Sorted()
    for recording in recordings:
        _sort(recording, runs)
    if not runs.numbers:
        raise InputError(nothing_usable(runs.left_out, recordings))
    campaign = campaign_of(runs.numbers)
    runs.quality = list(dict.fromkeys([*runs.quality, *_campaign_faults(campaign)]))
    levels = [level for run in runs.numbers for level in runs.vibration[run.name].levels]
    parameters = parameters_of(campaign, levels, settings)
    said = judge(campaign, parameters, runs.vibration, runs.left_out, runs.quality, settings)
    return Findings(
        campaign=context.campaign,
        experiment="gearbox.load_exchange",
        verdict=said.verdict,
        reasons=said.reasons,
        parameters=parameters,
        models=models_of(campaign),
        published=published(campaign, parameters, runs.vibration),
        quality=[
            Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in runs.quality
        ],
        runs=[
            Run(
                run=r.run,
                used=r.run not in runs.left_out,
                reason=runs.left_out.get(r.run, ""),
                conditions=dict(r.conditions),
            )
            for r in recordings
        ],
        advice=said.advice,
        arrays=arrays_of(campaign, runs.vibration, settings),
    )


def _sort(recording: Recording, runs: _Sorted) -> None:
    """Find the numbers of one run, or why it has none."""
    try:
        record = record_of(recording)
    except InputError as error:
        runs.left_out[recording.run] = str(error)
        runs.quality.append(QualityFinding("error", f"left out: {error}", recording.run))
        return
    found = [*record.findings, *input_faults(record)]
    numbers: RunNumbers | None = None
    vibration = VibrationNumbers()
    if not errors_of(found):
        numbers = numbers_of(record)
        found += speed_faults(numbers)
    if numbers is not None and not errors_of(found):
        vibration = vibration_of(numbers)
        found += run_faults(numbers, vibration)
    runs.quality += found
    errors = errors_of(found)
    if errors or numbers is None:
        runs.left_out[recording.run] = errors[0]
        return
    runs.numbers.append(numbers)
    runs.vibration[recording.run] = vibration


def _campaign_faults(campaign: CampaignNumbers) -> list[QualityFinding]:
    """Return what the runs together contradict: the law of the load's drag, a trend over the runs."""
    load = campaign.load
    windows = [run.windows for run in campaign.runs if run.windows is not None]
    if load is None:
        return _failed([campaign.unlike])
    single = {run.name: run.load for run in campaign.runs if run.load is not None}
    misfits: list[Misfit | None] = [campaign.unlike, load_law(windows, load), same_inertia(single)]
    if len(single) > 3 and not campaign.mixed:
        values = np.array([float(one.values[0] - load.values[0]) for one in single.values()])
        errors = np.array([float(one.covariance.std_error[0]) for one in single.values()])
        dofs = np.array([one.covariance.dof for one in single.values()])
        speeds = np.array([run.speed for run in campaign.runs if run.name in single])
        misfits.append(run_order(values, errors, dofs, "the load's inertia", "kg m2", speeds))
    return _failed(misfits)


def _failed(misfits: Sequence[Misfit | None]) -> list[QualityFinding]:
    return [
        QualityFinding("warning", f"{one.text} ({one.value:+.1f} {one.unit}, limit {one.limit:.1f})")
        for one in misfits
        if one is not None and one.failed
    ]
