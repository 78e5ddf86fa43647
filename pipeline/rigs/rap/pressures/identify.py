"""`rap.pressures`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.errors import InputError, listing
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.nothing_usable import nothing_usable
from pipeline.rigs.rap.pressures.arrays import arrays_of
from pipeline.rigs.rap.pressures.data_faults import data_faults
from pipeline.rigs.rap.pressures.declaration import PressuresSettings
from pipeline.rigs.rap.pressures.gaps import gap_notes
from pipeline.rigs.rap.pressures.models import models_of
from pipeline.rigs.rap.pressures.parameters import none_told, parameters_of
from pipeline.rigs.rap.pressures.published import published
from pipeline.rigs.rap.pressures.record import record_of
from pipeline.rigs.rap.pressures.run_numbers import RunNumbers, run_numbers
from pipeline.rigs.rap.pressures.spikes import without_spikes
from pipeline.rigs.rap.pressures.verdict import judge


@dataclass
class _Sorted:
    """Runs as they were looked at: those with numbers, those left out with the reason, of these the faulty, what was noticed."""

    runs: list[RunNumbers] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    faulty: list[str] = field(default_factory=list)
    quality: list[QualityFinding] = field(default_factory=list)


def identify(recordings: Sequence[Recording], settings: PressuresSettings, context: Context) -> Findings:
    """Identify a campaign of pressure runs, each by itself; where all are faulty the findings say so and hold no number.

    Raises
    ------
    InputError
        If no run has anything to identify.
    """
    found = _Sorted()
    for number, recording in enumerate(recordings):
        context.progress(0.9 * number / len(recordings), f"clock, agreement and hydraulics of {recording.run}")
        _sort(recording, settings, found)
    if not found.runs and not found.faulty:
        raise InputError(nothing_usable(found.left_out, recordings))
    context.progress(0.9, "tables")
    for campaign, other in context.uses.items():
        text = f"campaign '{campaign}' ({other.experiment}) was handed over and is not used: pressures need no other findings"
        found.quality.append(QualityFinding("note", text))
    parameters = parameters_of(found.runs) if found.runs else none_told(found.left_out[found.faulty[0]])
    quality = list(dict.fromkeys(found.quality))
    said = judge(found.runs, parameters, found.left_out, quality, settings)
    return Findings(
        campaign=context.campaign,
        experiment="rap.pressures",
        verdict=said.verdict,
        reasons=said.reasons,
        parameters=parameters,
        models=models_of(found.runs),
        published=published(found.runs, parameters),
        quality=[Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in quality],
        runs=[
            Run(run=r.run, used=r.run not in found.left_out, reason=found.left_out.get(r.run, ""), conditions=dict(r.conditions))
            for r in recordings
        ],
        advice=said.advice,
        arrays=arrays_of(found.runs, settings),
    )  # fmt: skip


def _sort(recording: Recording, settings: PressuresSettings, found: _Sorted) -> None:
    """Find the numbers of one run, or why it has none."""
    try:
        numbers, noticed = looked_at(recording, settings)
    except InputError as error:
        found.left_out[recording.run] = str(error)
        found.quality.append(QualityFinding("error", f"left out: {error}", recording.run))
        return
    found.quality += noticed
    if isinstance(numbers, str):
        found.left_out[recording.run] = numbers
        found.faulty.append(recording.run)
    else:
        found.runs.append(numbers)


def looked_at(recording: Recording, settings: PressuresSettings) -> tuple[RunNumbers | str, list[QualityFinding]]:
    """Return the numbers of a run, or why it is left out, and what was noticed.

    Raises
    ------
    InputError
        If its channels leave nothing to identify.
    """
    sound, spiky = without_spikes(recording)
    record = record_of(sound)
    if not record.sources:
        names = listing(sorted(channel.name for channel in recording), 12)
        raise InputError(
            f"run '{recording.run}' has no pressure of device or bench (it has {names}). rap.pressures needs pressure_<tap>_rap with "
            "pressure_<tap>_bench for agreement, or either with a blood flow for hydraulics; name them in the recipe, under 'channels'."
        )
    faults = data_faults(record)
    noticed = [*faults.findings, *gap_notes(record_of(recording) if spiky else record), *spiky]
    if faults.refused:
        return "; ".join(text.rstrip(".") for text in faults.refused), noticed
    numbers = run_numbers(record, faults, settings)
    return numbers, [*noticed, *numbers.findings]
