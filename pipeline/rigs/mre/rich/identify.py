"""`mre.shear_rich`: from recordings to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.mre.flux_levels import flux_levels
from pipeline.rigs.mre.rich.agreement import agreement_of, say_contradictions
from pipeline.rigs.mre.rich.arrays import arrays_of
from pipeline.rigs.mre.rich.declaration import RichSettings
from pipeline.rigs.mre.rich.faults import say_faults
from pipeline.rigs.mre.rich.fits import RichFit, fit_record
from pipeline.rigs.mre.rich.parameters import models_of, operating_points, parameters_of
from pipeline.rigs.mre.rich.published import published
from pipeline.rigs.mre.rich.records import usable_records
from pipeline.rigs.mre.rich.verdict import judge
from pipeline.rigs.mre.shear.runs import apart
from pipeline.rigs.mre.shear.samples import number_of
from pipeline.rigs.mre.shear.sorted_runs import SortedRuns
from pipeline.rigs.nothing_usable import nothing_usable


def identify(recordings: Sequence[Recording], settings: RichSettings, context: Context) -> Findings:
    """Identify rich records, each on its own.

    Raises
    ------
    InputError
        If no record can be used at all.
    """
    runs = usable_records(recordings)
    fits = _fits(runs, recordings, settings)
    if not fits:
        raise InputError(nothing_usable(runs.left_out, recordings))
    doubts = [*say_contradictions(fits), *say_faults(runs, recordings, fits)]
    points = operating_points(fits)
    agreement = agreement_of(fits)
    judgement = judge(runs, fits, doubts, agreement)
    parameters = parameters_of(fits, points)
    return Findings(
        campaign=context.campaign,
        experiment="mre.shear_rich",
        verdict=judgement.verdict,
        reasons=judgement.reasons,
        advice=judgement.advice,
        parameters=parameters,
        models=models_of(fits),
        published=published(fits),
        quality=[
            Quality(level=q.level, run=q.run, channel=q.channel, span=q.span, message=q.message) for q in runs.quality
        ],
        runs=[Run(run=r.run, used=r.run not in runs.left_out, reason=runs.left_out.get(r.run, "")) for r in recordings],
        arrays=arrays_of(fits, agreement, flux_levels(recordings)),
    )


def _fits(runs: SortedRuns, recordings: Sequence[Recording], settings: RichSettings) -> list[RichFit]:
    by_run = {recording.run: recording for recording in recordings}
    fits = []
    for usable in list(runs.records):
        recording = by_run[usable.run]
        current = usable.current
        label = number_of(recording, "coil_current")
        if current is not None and label is not None and not apart(current, label):
            current = label
        try:
            fits.append(fit_record(usable, current, settings, number_of(recording, "moving_mass"), runs))
        except (InputError, ValueError) as error:
            runs.set_aside(usable.run, str(error).rstrip("."))
    return fits
