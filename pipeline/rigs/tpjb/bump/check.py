"""What `rigfit check` can tell of one bump log, in the words of `identify`."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tpjb.bump.bearing_fit import pads_of
from pipeline.rigs.tpjb.bump.declaration import BumpSettings
from pipeline.rigs.tpjb.bump.record import UnusableError, record_of


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for probes that lie, axes that contradict the force, a force that does not turn or press, other pads.

    Raises
    ------
    InputError
        If this log alone leaves nothing to identify.
    """
    try:
        record = record_of(recording)
        contradiction = pads_of([record], BumpSettings()).contradiction
    except (UnusableError, InputError) as error:
        raise InputError(f"no bump test can be identified from this log: {error}") from error
    found = [finding for finding in record.findings if finding.level != "note"]
    if contradiction:
        found.append(QualityFinding("warning", contradiction))
    return tuple(found)
