"""`rap.cytotoxicity`: from the table of samples to findings. Each step is one call; the steps stand in their own modules."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.findings import Findings, Quality, Run
from pipeline.recording import Recording
from pipeline.rigs.experiment import Context
from pipeline.rigs.nothing_usable import nothing_usable
from pipeline.rigs.rap.cytotoxicity.analysis import Culture, analyse
from pipeline.rigs.rap.cytotoxicity.arrays import arrays_of
from pipeline.rigs.rap.cytotoxicity.declaration import CytotoxicitySettings
from pipeline.rigs.rap.cytotoxicity.parameters import parameters_of
from pipeline.rigs.rap.cytotoxicity.published import published
from pipeline.rigs.rap.cytotoxicity.samples import Samples, samples_of, with_control_of
from pipeline.rigs.rap.cytotoxicity.verdict import judge


def identify(recordings: Sequence[Recording], settings: CytotoxicitySettings, context: Context) -> Findings:
    """Test the cells of each run for equivalence to their control.

    Raises
    ------
    InputError
        If no run holds a sample that can be used.
    """
    found: list[Samples] = []
    left_out: dict[str, str] = {}
    for recording in recordings:
        try:
            found.append(samples_of(recording, settings))
        except InputError as error:
            left_out[recording.run] = str(error)
    cultures = [analyse(samples, settings) for samples in _with_controls(found)]
    if not cultures:
        raise InputError(nothing_usable(left_out, recordings))
    said = judge(cultures)
    quality = [
        Quality(level=p.level, run=p.run, channel=p.channel, message=p.message) for c in cultures for p in c.problems
    ]
    for run, reason in left_out.items():
        quality.append(Quality(level="error", run=run, message=f"left out: {reason}"))
        bare = reason.removeprefix(f"run '{run}'").removeprefix(":").strip()
        said.warn(f"Run {run} is left out: {bare}")
    for campaign, other in context.uses.items():
        message = (
            f"campaign '{campaign}' ({other.experiment}) was handed over and is not used: cells use no other findings."
        )
        quality.append(Quality(level="note", message=message))
    return Findings(
        campaign=context.campaign,
        experiment="rap.cytotoxicity",
        verdict=said.verdict,
        reasons=said.reasons,
        parameters=parameters_of(cultures, settings),
        published=published(cultures),
        quality=quality,
        runs=[Run(run=r.run, used=r.run not in left_out, reason=left_out.get(r.run, "")) for r in recordings],
        advice=said.advice,
        arrays=arrays_of(cultures),
    )


def _with_controls(found: Sequence[Samples]) -> list[Samples]:
    """Return the runs with treated cells; one that lacks a control gets that of the only run which is nothing else."""
    controls = [samples for samples in found if not samples.treated.any()]
    treated: list[Samples] = [samples for samples in found if samples.treated.any()]
    if len(controls) != 1 or not treated:
        return treated or list(controls)
    return [samples if (~samples.treated).any() else with_control_of(samples, controls[0]) for samples in treated]


def alone(recording: Recording, settings: CytotoxicitySettings) -> Culture:
    """Return what one run says by itself.

    Raises
    ------
    InputError
        If it holds no sample that can be used.
    """
    return analyse(samples_of(recording, settings), settings)
