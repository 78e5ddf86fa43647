"""What `rigfit check` tells of one therapy log: faults in the words of `identify`, no numbers."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.therapy.declaration import TherapySettings
from pipeline.rigs.rap.therapy.faults import examined
from pipeline.rigs.rap.therapy.identify import nothing_asked
from pipeline.rigs.rap.therapy.outcome.parameters import parameters_of
from pipeline.rigs.rap.therapy.run_numbers import numbers_of


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for units, signs, exchanged channels, tables that end early, levels, scales and alarms that do not fit.

    Raises
    ------
    InputError
        If nothing can be identified from this run.
    """
    reason = nothing_asked(recording)
    if reason:
        raise InputError(f"{reason}.")
    record, found = examined(recording)
    run = numbers_of(record, TherapySettings(), clocks=False)
    missing = dict.fromkeys(one.description for one in parameters_of(run) if one.value is None)
    return (*found, *run.findings, *(QualityFinding("note", text, recording.run) for text in missing))
