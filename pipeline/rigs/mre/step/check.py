"""What one log of a step test tells by itself: what identification would say of it alone."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.recording import QualityFinding, Recording
from pipeline.rigs.mre.doubts import Doubts
from pipeline.rigs.mre.hold.record import UnusableError
from pipeline.rigs.mre.step.declaration import StepSettings
from pipeline.rigs.mre.step.faults import judge_fit, judge_record
from pipeline.rigs.mre.step.identify import calibrated, usable
from pipeline.rigs.mre.step.lag_fit import fit_lags
from pipeline.rigs.mre.step.times import estimates_of
from pipeline.rigs.mre.step.withheld import without_breaks, without_coil


def check(recording: Recording) -> Sequence[QualityFinding]:
    """Look for a set-point in place of the current, slow sampling, levels cut short, wrong units and signs.

    Raises
    ------
    InputError
        If this run alone leaves nothing to identify.
    """
    settings, doubts = StepSettings(), Doubts()
    try:
        record = usable(recording)
        fit = fit_lags(record).fit
    except (UnusableError, ValueError) as error:
        raise InputError(f"no step test can be identified from run '{recording.run}': {error}.") from error
    judge_record(record, settings, doubts)
    estimates = without_breaks(fit, without_coil(fit, estimates_of(fit, calibrated(record))), doubts)
    judge_fit(fit, estimates, settings, doubts)
    return [QualityFinding(q.level, q.message, q.run, q.channel, q.span) for q in doubts.quality if q.level != "note"]
