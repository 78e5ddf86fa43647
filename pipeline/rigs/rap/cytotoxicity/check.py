"""What one table of samples tells by itself: what identification would say of it alone."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.rap.cytotoxicity.declaration import CytotoxicitySettings
from pipeline.rigs.rap.cytotoxicity.identify import alone


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for mixed units, shares that cannot be, a missing control, missing times, single cultures.

    Raises
    ------
    InputError
        If this run holds no sample that can be used.
    """
    culture = alone(recording, CytotoxicitySettings())
    told = [problem for problem in culture.problems if problem.level != "note"]
    if culture.control == "none":
        message = "there is no control among the samples: a difference to it cannot be told. Call its rows 'control' in the column 'group'."
        told.append(QualityFinding("warning", message, recording.run, "group"))
    alone_of_its_kind = [
        o.name
        for o in culture.outcomes.values()
        if o.found is None and culture.control != "none" and culture.samples.treated.any()
    ]
    if alone_of_its_kind:
        message = f"one culture of each group for {', '.join(alone_of_its_kind)}: no interval can be given."
        told.append(QualityFinding("warning", message, recording.run))
    return told
