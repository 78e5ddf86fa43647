"""`rap.flow`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.errors import InputError, counted, listing
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.rap.flow.arrays import arrays_of
from pipeline.rigs.rap.flow.campaign import campaign_of
from pipeline.rigs.rap.flow.declaration import FlowSettings
from pipeline.rigs.rap.flow.doubts import doubts, not_told
from pipeline.rigs.rap.flow.parameters import models_of, parameters_of
from pipeline.rigs.rap.flow.published import published
from pipeline.rigs.rap.flow.record import run_of
from pipeline.rigs.rap.flow.run_faults import errors_of, inspected, run_faults
from pipeline.rigs.rap.flow.run_windows import RunNumbers, run_numbers
from pipeline.rigs.rap.flow.shared_zeros import with_zeros
from pipeline.rigs.rap.flow.verdict import judge


@dataclass
class _Sorted:
    """Runs as they were looked at: usable, left out with the reason, what was noticed."""

    runs: list[RunNumbers] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    quality: list[QualityFinding] = field(default_factory=list)


def identify(recordings: Sequence[Recording], settings: FlowSettings, context: Context) -> Findings:
    """Identify a campaign of flow runs.

    Raises
    ------
    InputError
        If no run can be used at all.
    """
    runs = _Sorted()
    count = max(len(recordings), 1)
    for number, recording in enumerate(recordings):
        context.progress(0.8 * number / count, f"windows of {recording.run}")
        _sort(recording, runs, settings)
    if not runs.runs:
        raise InputError(_nothing_usable(runs, context))
    context.progress(0.8, "calibration")
    numbers = with_zeros(runs.runs)
    quality = [*runs.quality, *(finding for run in numbers for finding in run_faults(run))]
    found = campaign_of(numbers, settings)
    quality = list(dict.fromkeys([*quality, *found.problems, *doubts(found, settings)]))
    parameters = parameters_of(found)
    said = judge(found, parameters, runs.left_out, quality, settings)
    return Findings(
        campaign=context.campaign,
        experiment="rap.flow",
        verdict=said.verdict,
        reasons=said.reasons,
        parameters=parameters,
        models=models_of(found),
        published=published(found),
        quality=[
            Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message)
            for q in (*quality, *not_told(found))
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
        arrays=arrays_of(found),
    )


def _sort(recording: Recording, runs: _Sorted, settings: FlowSettings) -> None:
    """Find the numbers of one run, or why it has none."""
    try:
        looked = inspected(recording)
        runs.quality += looked.findings
        if looked.refused:
            runs.left_out[recording.run] = looked.refused
            return
        numbers = run_numbers(run_of(looked.sound), settings)
    except InputError as error:
        runs.left_out[recording.run] = str(error)
        runs.quality.append(QualityFinding("error", f"left out: {error}", recording.run))
        return
    errors = errors_of(run_faults(numbers))
    if errors:
        runs.left_out[recording.run] = errors[0]
        runs.quality += run_faults(numbers)
        return
    runs.runs.append(numbers)


def _nothing_usable(runs: _Sorted, context: Context) -> str:
    """Say why no run can be used: the first reason, and how many others there are."""
    if not runs.left_out:
        return f"campaign '{context.campaign}': there is no run."
    (first, reason), *others = runs.left_out.items()
    more = (
        f" {counted(len(others), 'more run')} cannot be used either: {listing([run for run, _ in others], 8)}."
        if others
        else ""
    )
    return f"campaign '{context.campaign}': no run can be used; run '{first}': {reason.rstrip('.')}.{more}"
