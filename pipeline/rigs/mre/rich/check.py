"""What only the physics of the shear rig tells of one rich record, for `rigfit check`: in the words of `identify`."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.rich.records import usable_records
from pipeline.rigs.mre.shear.faults import say_varying
from pipeline.rigs.mre.shear.operating import held_of
from pipeline.rigs.nothing_usable import nothing_usable


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Say what leaves the record out, and what is odd about it.

    Raises
    ------
    InputError
        If the record alone leaves nothing to identify.
    """
    runs = usable_records([recording])
    if not runs.records:
        raise InputError(nothing_usable(runs.left_out, [recording]))
    say_varying([held_of(recording)], runs)
    return [finding for finding in runs.quality if finding.level != "note"]
