"""Which numbers of a run are told, and from what: the law where it fits, else the holds themselves, else null with the reason."""

from __future__ import annotations

from pipeline.estimation.estimate import Estimate, undetermined
from pipeline.rigs.mre.hold.analysis import Analysed, relaxations_clash
from pipeline.rigs.mre.hold.law_faults import soft_limit
from pipeline.rigs.mre.hold.saturation import estimates_of, increments_of, measured_increments

_NEAR_END = 0.02  # of F0: increments that near to the end of the sensor's range are not told


def told_of(found: Analysed, gain_error: float, offset_error: float) -> list[Estimate]:
    """Return the estimates of one run.

    Parameters
    ----------
    found
        The run.
    gain_error, offset_error
        As in `estimates_of`.
    """
    misfit = found.misfit
    soft = soft_limit(found)
    costs = misfit.costs_law or ("the range of the force sensor seems to end" if soft is not None else "")
    told = estimates_of(found.saturation, gain_error, offset_error, misfit.levels, costs, relaxation_open(found))
    if misfit.course.older is not None:
        reason = "the force at 10 s after the gap was closed lies before the log, and when that was is not told (condition 'gap_closed_for')"
        told = [undetermined(e.name, reason) if e.name == "force_initial" else e for e in told]
    increments = _increments(found, costs)
    if soft is not None:
        end = soft[0] / found.fit.F0 - 1
        increments = [
            undetermined(e.name, "the range of the force sensor seems to end there", e.at)
            if e.value is not None and e.value > end - _NEAR_END
            else e
            for e in increments
        ]
    return told + increments


def relaxation_open(found: Analysed) -> str:
    """Say why the relaxation is not told; empty where it is."""
    misfit = found.misfit
    if misfit.course.older is not None:
        return "the gap seems to have been closed before the log began, and how long is not told (condition 'gap_closed_for')"
    if misfit.drift and "gap_closed_for" not in found.record.recording.conditions:
        return f"{misfit.drift:.2g} N over the log go with time and not with its logarithm: drift, or a gap closed long before the log began"
    if misfit.apart:
        return f"the sweeps differ by {misfit.apart:.2g} N (rms) beside relaxation"
    if misfit.costs_law and not (misfit.levels is not None and misfit.levels.repeats):
        return "no level was held twice, and the law does not fit"
    if relaxations_clash(found):
        return "creep within the holds and the difference between the sweeps contradict each other"
    return ""


def _increments(found: Analysed, costs: str) -> list[Estimate]:
    misfit = found.misfit
    if not costs:
        return increments_of(found.saturation, found.labels())
    if misfit.pull:
        reason = f"{costs}: how much of the rise is the pull of the poles is not known without a blank test"
    elif misfit.levels is None or not found.own_levels:
        reason = f"{costs}, and no hold at 0 A was measured to count from"
    else:
        return measured_increments(misfit.levels, found.own_levels)
    return [undetermined("force_increment", reason, {"coil_current": name}) for name in sorted(found.labels())]
