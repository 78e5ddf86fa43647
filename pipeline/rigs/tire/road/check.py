"""What `rigfit check` tells of one drive: faults in the words of `identify`, no numbers; of a long log its beginning.

Whether the bench fits is not asked here: no findings are handed over.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.tire.passages.device import Device, device_of
from pipeline.rigs.tire.passages.passage_faults import course_of, passage_findings
from pipeline.rigs.tire.passages.revolutions import Revolutions, revolutions_of
from pipeline.rigs.tire.tire_size import tire_size

# Passages are looked for in the first so many seconds; packets are counted in the whole log.
_LOOKED = 300.0


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for lost packets, wrong polarity, swapped channels, clipping, drifts and a broken sensor."""
    try:
        device = device_of(recording)
        if recording.conditions.get("tire_size"):
            tire_size(recording.conditions["tire_size"], f"run '{recording.run}', tire_size")
        course = course_of(_beginning(device))
    except InputError as error:
        return (QualityFinding("error", str(error), recording.run),)
    return passage_findings(device, course, None)


def _beginning(device: Device) -> Iterator[Revolutions]:
    for block in revolutions_of(device):
        yield block
        if block.times.size and block.times[-1] > device.span[0] + _LOOKED:
            return
