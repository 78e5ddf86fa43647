"""What `rigfit check` tells of one gearbox log: faults in the words of `identify`, no numbers."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.gearbox.faults import errors_of, input_faults
from pipeline.rigs.gearbox.record import COUNT, SPEED, record_of
from pipeline.rigs.gearbox.run_faults import speed_faults
from pipeline.rigs.gearbox.run_numbers import numbers_of
from pipeline.rigs.gearbox.stages.counts import counts_of


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for wrong signs, swapped torques, wrong units of speed, clocks that differ, and steps of the protocol that are missing."""
    try:
        record = record_of(recording)
    except InputError as error:
        return (QualityFinding("error", str(error), recording.run),)
    counts = counts_of(record)
    encoder = COUNT if record.has_counts else SPEED
    found = [*record.findings, *input_faults(record, counts)]
    found += [QualityFinding(p.level, p.message, record.run, encoder, p.span) for p in counts.problems]
    if errors_of(found):
        return tuple(found)
    numbers = numbers_of(record)
    found += speed_faults(numbers)
    if errors_of(found):
        return tuple(found)
    told = [
        p
        for p in (*numbers.broken_off, *numbers.alignment.problems, *numbers.segmentation.problems)
        if p not in counts.problems
    ]
    return (*found, *(QualityFinding(p.level, p.message, record.run, None, p.span) for p in told))
