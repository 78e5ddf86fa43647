"""What one log of a hold test tells by itself: what identification would say of it alone."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.analysis import analyse
from pipeline.rigs.mre.hold.declaration import HoldSettings
from pipeline.rigs.mre.hold.field_faults import judge_field
from pipeline.rigs.mre.hold.field_fit import fit_field
from pipeline.rigs.mre.hold.force_faults import judge_force
from pipeline.rigs.mre.hold.identify import is_blank, is_field_map, usable
from pipeline.rigs.mre.hold.record import UnusableError
from pipeline.rigs.mre.hold.record_faults import judge_record


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for wrong units and signs, a set-point, a gap that moves, short holds, a limit not passed.

    Raises
    ------
    InputError
        If this run alone leaves nothing to identify.
    """
    settings, doubts = HoldSettings(), Doubts()
    try:
        record = usable(recording, settings)
    except UnusableError as error:
        raise InputError(f"no hold test can be identified from run '{recording.run}': {error}.") from error
    judge_record(record, settings, doubts)
    if not is_blank(record):
        field = fit_field(record)
        if record.of("force_axial") is not None and not is_field_map(record):
            try:
                judge_force(analyse(record, None, field), doubts, alone=True)
            except ValueError as error:
                raise InputError(f"no hold test can be identified from run '{recording.run}': {error}.") from error
        if field is not None:
            judge_field(field, record, settings, doubts)
    return [QualityFinding(q.level, q.message, q.run, q.channel, q.span) for q in doubts.quality if q.level != "note"]
