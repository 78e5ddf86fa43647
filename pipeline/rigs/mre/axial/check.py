"""What one compression log tells: what identification would say of it alone."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.axial.levels import current_of
from pipeline.rigs.mre.axial.record import UnfitError
from pipeline.rigs.mre.axial.run_fit import fit_run
from pipeline.rigs.nothing_usable import nothing_usable


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Return what is to be doubted of this log.

    Raises
    ------
    InputError
        If it alone leaves nothing to identify.
    """
    try:
        current = current_of(recording)
        if not current.steady:
            raise UnfitError(current.doubt, "current")
        fit = fit_run(recording)
    except UnfitError as error:
        raise InputError(nothing_usable({recording.run: str(error).rstrip(".")}, [recording])) from error
    told = {finding.message for finding in fit.said}
    found = [QualityFinding("warning", doubt, recording.run) for doubt in fit.doubts if doubt not in told]
    found += [QualityFinding("error", reason, recording.run, "force_axial") for reason in fit.rejected]
    if current.doubt:
        found.append(QualityFinding("warning", current.doubt, recording.run, "current"))
    return [*fit.said, *found]
