"""The torques of one run: nominal levels, peaks, slopes of the map, with what a drift or an end stop does to them.

Nothing of inertia, speed or vibration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.rigs.gearbox.aligned_run import AlignedRun, Span
from pipeline.rigs.gearbox.record import TORQUES
from pipeline.rigs.gearbox.torques.clipping import NONE, Clip
from pipeline.rigs.gearbox.torques.nominal import Level, level
from pipeline.rigs.gearbox.torques.offsets import Offset, Offsets
from pipeline.rigs.gearbox.torques.peaks import ORDER, Peak, peak, steady_noise, unlock_peak
from pipeline.rigs.gearbox.torques.torque_drift import Drift, drift_of
from pipeline.rigs.gearbox.torques.torque_map import Transfer, brake_transfer, startup_transfer, steady_transfer
from pipeline.rigs.gearbox.torques.withheld import brake_rise, lost_levels, lost_rise, lost_startup, mostly_lost
from pipeline.signals.filtering import low_pass

NOMINAL_STAGES = ("fos", "sos", "fos_after")
FOS_STAGES = ("fos", "fos_after")
# A lock that breaks may do so a little before the brake's stage ends; the peak is sought this much wider, s.
_AROUND_PEAK = 0.1
# The low-pass settles within this time; steps to draw its answer in, s.
_SETTLES, _FINE = 0.2, 5e-4

Key = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques of one run.

    Attributes
    ----------
    levels, peaks
        By (`torque_in` or `torque_out`, stage).
    unlock
        Peak of torque_in at the unlock without the shaft's ripple.
    transfers
        Slope of output over input torque by phase.
    drifts
        By channel: a significant change of the locked, steady torque; none where there is no such change.
    clips
        By channel: samples at an end stop.
    cut
        Levels that are left out for such samples.
    withheld
        By (quantity, stage): why a number is left out that lost samples would falsify. Quantities are the torques (their
        peak in `startup` and `brake`, else their level), `slope`, `unlock` and, where the input torque is lost, `event`.
    """

    levels: Mapping[Key, Level] = field(default_factory=dict)
    peaks: Mapping[Key, Peak] = field(default_factory=dict)
    unlock: Peak | None = None
    transfers: Mapping[str, Transfer] = field(default_factory=dict)
    drifts: Mapping[str, Drift] = field(default_factory=dict)
    clips: Mapping[str, Clip] = field(default_factory=dict)
    cut: frozenset[Key] = frozenset()
    withheld: Mapping[Key, str] = field(default_factory=dict)

    @property
    def steady(self) -> list[Span]:
        """The settled parts of FOS, s."""
        return [self.levels["torque_in", stage].span for stage in FOS_STAGES if ("torque_in", stage) in self.levels]


def torques_of(
    run: AlignedRun, offsets: Offsets, clips: Mapping[str, Clip], speed_out: float, speed_in: float
) -> Torques:
    """Return the torques of a run.

    Parameters
    ----------
    run, offsets
        The run and how its zeros are known.
    clips
        By channel: samples at an end stop.
    speed_out, speed_in
        Of the output shaft in FOS and of the input shaft in SOS, rad/s; NaN or 0 where unknown.
    """
    levels, cut = _levels(run, clips, speed_out, speed_in)
    withheld = lost_levels(run, levels) | lost_rise(run)
    levels = {key: one for key, one in levels.items() if key not in withheld}
    steady = [span for span in Torques(levels).steady if not any(mostly_lost(run, name, span) for name in TORQUES)]
    drifts = _drifts(run, offsets, steady)
    # What a drift leaves open concerns runs whose zero was not seen again at the end.
    open_ = {name: drift for name, drift in drifts.items() if not _seen_again(getattr(offsets, name))}
    peaks = _peaks(run, levels, clips)
    withheld |= lost_startup(run, peaks)
    peaks = {key: one for key, one in peaks.items() if key not in withheld}
    transfers = _transfers(run, steady, clips, open_)
    transfers = {phase: one for phase, one in transfers.items() if ("slope", phase) not in withheld}
    widened = {key: _widened_level(one, open_.get(key[0])) for key, one in levels.items()}
    steady_slopes = _steady_transfers(widened)
    slopes = {**transfers, **steady_slopes}
    if not offsets.known:
        slopes = {phase: replace(one, intercept=math.nan, intercept_error=math.nan) for phase, one in slopes.items()}
    unlock = None if ("unlock", "brake") in withheld else _unlock(run, levels)
    return Torques(
        widened,
        {key: _widened_peak(one, open_.get(key[0])) for key, one in peaks.items()},
        None if unlock is None else _widened_peak(unlock, open_.get("torque_in")),
        slopes, drifts, clips, cut, withheld,
    )  # fmt: skip


def _levels(
    run: AlignedRun, clips: Mapping[str, Clip], speed_out: float, speed_in: float
) -> tuple[dict[Key, Level], frozenset[Key]]:
    time, *torques = run.slow
    rate = 1.0 / float(np.median(np.diff(run.time)))
    found, cut = {}, set()
    for stage in (*NOMINAL_STAGES, "fos_loaded"):
        if stage not in run.stages:
            continue
        for name, values, zero in zip(TORQUES, torques, (run.offset_in, run.offset_out), strict=True):
            turning = speed_out if stage != "sos" else speed_in if name == "torque_in" else 0.0
            one = level(time, values, run.stages[stage], turning if math.isfinite(turning) else 0.0, zero)
            if one is None:
                continue
            if clips.get(name, NONE).spoils(one.span, rate):
                cut.add((name, stage))
            else:
                found[name, stage] = one
    return found, frozenset(cut)


def _seen_again(offset: Offset | None) -> bool:
    return offset is not None and offset.before is not None and offset.after is not None


def _drifts(run: AlignedRun, offsets: Offsets, steady: list[Span]) -> dict[str, Drift]:
    time, *torques = run.slow
    angle = run.angle_at(time)
    found = {}
    for name, values in zip(TORQUES, torques, strict=True):
        offset: Offset | None = getattr(offsets, name)
        known = (offset.before or offset.after) if offset is not None else None
        drift = drift_of(time, values, angle, steady, known.time if known is not None else float(time[0]))
        if drift is not None:
            found[name] = drift
    return found


def _widened_level(one: Level, drift: Drift | None) -> Level:
    """Return a level whose zero may have moved as far as the drift tells since it was known."""
    if drift is None:
        return one
    error = drift.error(0.5 * (one.span[0] + one.span[1]))
    total = math.hypot(one.std_error, error)
    dof = one.dof * (total / one.std_error) ** 4 if one.std_error > 0 else one.dof
    return replace(one, std_error=total, own_error=math.hypot(one.own_error, error), dof=dof)


def _widened_peak(one: Peak, drift: Drift | None) -> Peak:
    if drift is None:
        return one
    total = math.hypot(one.std_error, drift.error(one.time))
    dof = one.dof * (total / one.std_error) ** 4 if one.std_error > 0 else one.dof
    return replace(one, std_error=total, dof=dof)


def _peaks(run: AlignedRun, levels: Mapping[Key, Level], clips: Mapping[str, Clip]) -> dict[Key, Peak]:
    spans = {"startup": run.stages.get("startup"), "brake": brake_rise(run)}
    found = {}
    for name, values, zero in zip(
        TORQUES, (run.torque_in, run.torque_out), (run.offset_in, run.offset_out), strict=True
    ):
        steady = [levels[name, stage].span for stage in FOS_STAGES if (name, stage) in levels]
        noise = steady_noise(run.time, values, steady)
        for stage, span in spans.items():
            if span is None:
                continue
            around = (span[0] - _AROUND_PEAK, span[1] + _AROUND_PEAK)
            one = peak(run.time, values, around, noise, offset=zero)
            if one is not None:
                cut = clips.get(name, NONE).count(around) > 0
                found[name, stage] = replace(one, saturated=True) if cut else one
    return found


def _unlock(run: AlignedRun, levels: Mapping[Key, Level]) -> Peak | None:
    settled, rise = levels.get(("torque_in", "fos")), brake_rise(run)
    if settled is None or rise is None:
        return None
    found = unlock_peak(run, (rise[0] - _AROUND_PEAK, rise[1] + _AROUND_PEAK), settled.span)
    if found is None or not rise[0] < found.time:
        return found
    return replace(found, bias=found.bias + _overshoot(rise[0], found, settled.value))


def _overshoot(onset: float, found: Peak, level_: float) -> float:
    """Return what the low-pass adds to a torque that rises in a straight line and stops where the lock breaks, N m."""
    time = np.arange(onset - _SETTLES, found.time + _SETTLES, _FINE)
    kink = np.interp(time, [onset, found.time], [level_, found.value])
    return float(low_pass(time, kink, found.cutoff, ORDER).max()) - found.value


def _transfers(
    run: AlignedRun, steady: list[Span], clips: Mapping[str, Clip], drifts: Mapping[str, Drift]
) -> dict[str, Transfer]:
    """Return the slopes of the moving phases; samples at an end stop, and what comes after them, are left out."""
    found: dict[str, Transfer] = {}
    if run.has("startup") and not any(clip.count(run.stages["startup"]) for clip in clips.values()):
        one = startup_transfer(run, steady)
        if one is not None:
            found["startup"] = one
    rise = brake_rise(run)
    if rise is not None:
        end = min((clip.first(rise) for clip in clips.values()), default=rise[1])
        one = brake_transfer(run, steady, end)
        if one is not None:
            # The zeros of both torques are in T_00 as they are, and cancel in the slope.
            error = math.hypot(
                one.intercept_error,
                run.offset_in.std_error,
                run.offset_out.std_error / one.slope,
                *(drift.error(end) / (one.slope if name == "torque_out" else 1.0) for name, drift in drifts.items()),
            )
            found["brake"] = replace(one, intercept_error=error)
    return found


def _steady_transfers(levels: Mapping[Key, Level]) -> dict[str, Transfer]:
    found = {}
    for phase, stage in (("steady", "sos"), ("loaded", "fos_loaded")):
        fos, loaded = ([levels.get((name, each)) for name in TORQUES] for each in ("fos", stage))
        if fos[0] and fos[1] and loaded[0] and loaded[1]:
            one = steady_transfer((fos[0], fos[1]), (loaded[0], loaded[1]))
            if one is not None:
                found[phase] = replace(one, phase=phase)
    return found
