"""Which torques of a run are withheld, and why: those that samples would falsify which are none of the sensor's.

Where samples are lost is found in `lost_samples`.
"""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.rigs.gearbox.aligned_run import AlignedRun, Span
from pipeline.rigs.gearbox.record import TORQUES
from pipeline.rigs.gearbox.torques.lost_samples import overlap
from pipeline.rigs.gearbox.torques.nominal import Level
from pipeline.rigs.gearbox.torques.peaks import Peak

# A mean of which that share is none of the sensor's samples is none. A peak is none where samples are lost this near (s).
_MEAN_LOST, _PEAK_LOST = 0.1, 0.1
# Before the brake comes on the encoder tells the ripple's angle for so long (s).
_LEAD = 0.5
# Where the brake's onset is not known, so long before the unlock its rise begins, s.
_RISE = 0.3

Key = tuple[str, str]


def brake_rise(run: AlignedRun) -> Span | None:
    """Return brake onset and unlock, s."""
    unlock = run.events.get("unlock")
    return None if unlock is None else (run.events.get("brake_onset", unlock - _RISE), unlock)


def mostly_lost(run: AlignedRun, name: str, span: Span) -> bool:
    """Tell whether more of a span is lost than a mean bears."""
    return overlap(run.lost.get(name, ()), span) > _MEAN_LOST * (span[1] - span[0])


def lost_levels(run: AlignedRun, levels: Mapping[Key, Level]) -> dict[Key, str]:
    """Return the means of which too much is none of the sensor's."""
    found = {}
    for (name, stage), one in levels.items():
        lost = run.lost.get(name, ())
        span = run.stages[stage]
        if mostly_lost(run, name, one.span):
            worst = max(lost, key=lambda each: overlap([each], span))
            found[name, stage] = f"{_told(name, worst)}, in {stage.upper().replace('_', ' ')}"
    return found


def lost_rise(run: AlignedRun) -> dict[Key, str]:
    """Return what cannot be told of the brake's rise since torques or encoder tell nothing in it."""
    rise = brake_rise(run)
    if rise is None:
        return {}
    found: dict[Key, str] = {}
    where = "where the brake comes on and the lock breaks"
    around = (rise[0] - _PEAK_LOST, rise[1] + _PEAK_LOST)
    for name in TORQUES:
        lost = [span for span in run.lost.get(name, ()) if overlap([span], around) > 0]
        if lost:
            text = f"{_told(name, lost[0])}, {where}"
            found[name, "brake"] = text
            found.setdefault(("slope", "brake"), text)
            if name == "torque_in":
                found["unlock", "brake"] = found["event", "brake"] = text
    for span in run.gaps:
        # Ripple is taken off by the angle of the encoder.
        if overlap([span], (rise[0] - _LEAD, rise[1] + _PEAK_LOST)) > 0:
            text = f"{_told('the encoder', span)}, {where}"
            found.setdefault(("slope", "brake"), text)
            found.setdefault(("unlock", "brake"), text)
    return found


def lost_startup(run: AlignedRun, peaks: Mapping[Key, Peak]) -> dict[Key, str]:
    """Return what cannot be told of the start-up: peaks near a loss, slopes of which some part is lost."""
    if "startup" not in run.stages:
        return {}
    span = run.stages["startup"]
    found: dict[Key, str] = {}
    for name in TORQUES:
        lost = [each for each in run.lost.get(name, ()) if overlap([each], span) > 0]
        one = peaks.get((name, "startup"))
        for each in lost:
            near = one is not None and overlap([each], (one.time - _PEAK_LOST, one.time + _PEAK_LOST)) > 0
            if near or each[1] - each[0] > 2 * _PEAK_LOST:
                found[name, "startup"] = f"{_told(name, each)}, in the start-up"
        if lost:
            found["slope", "startup"] = f"{_told(name, lost[0])}, in the start-up"
    for each in run.gaps:
        if overlap([each], span) > 0:
            found["slope", "startup"] = f"{_told('the encoder', each)}, in the start-up"
    return found


def _told(name: str, span: Span) -> str:
    return f"{name} tells nothing from {span[0]:.5g} to {span[1]:.5g} s"
