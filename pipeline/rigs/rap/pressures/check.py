"""What `rigfit check` tells of one log of pressures: faults in the words of `identify`, no numbers."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.pressures.declaration import PressuresSettings
from pipeline.rigs.rap.pressures.identify import looked_at


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for wrong units and signs, exchanged taps, frozen channels, zeros, an ambiguous clock, air at a transducer.

    Raises
    ------
    InputError
        If this run alone leaves nothing to identify.
    """
    return looked_at(recording, PressuresSettings())[1]
