"""All numbers of one run: clocks aligned, stages found, offsets taken off, levels, peaks, slopes, load, speeds, vibration.

Each number is found by a module of its own; the order stands here. Nothing of a campaign.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.gearbox.aligned_run import AlignedRun, ZeroOffset
from pipeline.rigs.gearbox.alignment import Alignment, align
from pipeline.rigs.gearbox.counts import Counts, counts_of
from pipeline.rigs.gearbox.derived import Torque
from pipeline.rigs.gearbox.inertia import LoadFit, load_parameters
from pipeline.rigs.gearbox.load_windows import Windows, free_spans, modulated
from pipeline.rigs.gearbox.nominal import Level, level
from pipeline.rigs.gearbox.offsets import Offsets, zero_offsets
from pipeline.rigs.gearbox.peaks import Peak, peak, steady_noise, unlock_peak
from pipeline.rigs.gearbox.record import TORQUES, Record
from pipeline.rigs.gearbox.segmentation import segment
from pipeline.rigs.gearbox.sos_speed import InputSpeed, input_speed_of
from pipeline.rigs.gearbox.stages import Segmentation
from pipeline.rigs.gearbox.torque_map import Transfer, brake_transfer, startup_transfer, steady_transfer

NOMINAL_STAGES = ("fos", "sos", "fos_after")
_FOS_STAGES = ("fos", "fos_after")
# A lock that breaks may do so a little before the brake's stage ends; the peak is sought this much wider, s.
_AROUND_PEAK = 0.1


@dataclass(frozen=True, eq=False)
class RunNumbers:
    """What one run tells.

    Attributes
    ----------
    record, alignment, segmentation, offsets, counts, run
        The run on the clock of the torques, and how it came there.
    levels, peaks
        By (`torque_in` or `torque_out`, stage).
    unlock
        Peak of torque_in at the unlock without the shaft's ripple.
    transfers
        Slope of output over input torque by phase: `startup`, `brake`, `steady`.
    windows, load
        Integrated load equation and its fit to this run alone; `load_parts` to start-up and release alone.
    speed_out
        Mean output speed in FOS and its standard error, rad/s.
    speed_in
        Input speed in SOS.
    """

    record: Record
    alignment: Alignment
    segmentation: Segmentation
    offsets: Offsets
    counts: Counts
    run: AlignedRun
    levels: Mapping[tuple[str, str], Level] = field(default_factory=dict)
    peaks: Mapping[tuple[str, str], Peak] = field(default_factory=dict)
    unlock: Peak | None = None
    transfers: Mapping[str, Transfer] = field(default_factory=dict)
    windows: Windows | None = None
    load: LoadFit | None = None
    load_parts: Mapping[str, LoadFit] = field(default_factory=dict)
    speed_out: tuple[float, float] = (math.nan, math.nan)
    speed_in: InputSpeed | None = None

    @property
    def name(self) -> str:
        """Name of the run."""
        return self.record.run

    @property
    def speed(self) -> float:
        """Speed by which runs are sorted, rad/s: as set, else as measured in FOS; NaN where neither is known."""
        return self.record.speed_nominal or self.speed_out[0]

    def zero(self, quantity: str) -> float:
        """Return the standard error of the zero offset of a torque, N m; NaN where it is unknown."""
        offset = getattr(self.offsets, quantity)
        return math.nan if offset is None else float(offset.sd)

    def level(self, quantity: str, stage: str) -> Torque | None:
        """Return a nominal torque with its errors apart."""
        return Torque.of_level(self.levels.get((quantity, stage)), self.zero(quantity))

    def peak(self, quantity: str, stage: str) -> Torque | None:
        """Return a peak torque with its errors apart; None where it is saturated, and so a lower bound only."""
        return (
            None
            if self.saturated(quantity, stage)
            else Torque.of_peak(self.peaks.get((quantity, stage)), self.zero(quantity))
        )

    @property
    def unlocking(self) -> Torque | None:
        """The input torque that broke the lock, without ripple; None where it is saturated."""
        return (
            None
            if self.saturated("torque_in", "brake")
            else Torque.of_peak(self.unlock, self.zero("torque_in"), unbiased=True)
        )

    def saturated(self, quantity: str, stage: str) -> bool:
        """Tell whether the peak is flat at its top."""
        peak_ = self.peaks.get((quantity, stage))
        return peak_ is not None and peak_.saturated

    @property
    def zeroed(self) -> bool:
        """Tell whether the zero offsets of both torques are known."""
        return not any(math.isnan(self.zero(name)) for name in TORQUES)

    def steady(self) -> list[tuple[float, float]]:
        """Return the settled parts of FOS, s."""
        return [self.levels["torque_in", stage].span for stage in _FOS_STAGES if ("torque_in", stage) in self.levels]


def numbers_of(record: Record) -> RunNumbers:
    """Return the numbers of one run."""
    record, alignment = align(record)
    segmentation = segment(record)
    offsets = zero_offsets(record, segmentation)
    counts = counts_of(record)
    run = _aligned(record, segmentation, offsets, counts)
    speed_out = _speed_out(run)
    speed_in = input_speed_of(record, run)
    levels = _levels(run, speed_out[0], speed_in)
    found = RunNumbers(record, alignment, segmentation, offsets, counts, run, levels)
    steady = found.steady()
    windows = modulated(run, steady)
    peaks = _peaks(run, levels)
    return RunNumbers(
        record, alignment, segmentation, offsets, counts, run, levels,
        peaks, _unlock(run, levels), _transfers(run, levels, steady, peaks, found.zeroed),
        windows, None if windows is None else load_parameters([windows]), _load_parts(run, windows),
        speed_out, speed_in,
    )  # fmt: skip


def _aligned(record: Record, segmentation: Segmentation, offsets: Offsets, counts: Counts) -> AlignedRun:
    time = record.torque.time
    free, zeros = {}, {}
    for name in TORQUES:
        offset = getattr(offsets, name)
        free[name] = record.torque[name] if offset is None else record.torque[name] - offset.at(time)
        zeros[name] = ZeroOffset() if offset is None else ZeroOffset(offset.value, offset.sd, offset.dof)
    stages: dict[str, tuple[float, float]] = {}
    for stage in segmentation.stages:
        stages.setdefault(stage.name, (stage.start, stage.end))
    return AlignedRun(
        record.run, time, free["torque_in"], free["torque_out"], counts.time, counts.angle + 0.5 * counts.step, stages,
        {name: event.time for name, event in segmentation.events.items()}, segmentation.speed_nominal,
        zeros["torque_in"], zeros["torque_out"],
    )  # fmt: skip


def _speed_out(run: AlignedRun) -> tuple[float, float]:
    """Return the slope of the angle over FOS and its standard error, rad/s."""
    start, end = run.stages.get("fos", (math.nan, math.nan))
    inside = (run.angle_time > start + 0.2) & (run.angle_time < end - 0.2)
    if inside.sum() < 20:
        return math.nan, math.nan
    time, angle = run.angle_time[inside], run.angle[inside]
    time = time - time.mean()
    slope, level_ = np.polyfit(time, angle, 1)
    rest = angle - slope * time - level_
    count = max(effective_size(rest, 1) - 2.0, 1.0)
    return float(slope), float(np.sqrt(np.mean(rest**2) / np.mean(time**2) / count))


def _levels(run: AlignedRun, speed: float, speed_in: InputSpeed | None) -> dict[tuple[str, str], Level]:
    time, *torques = run.slow
    found = {}
    for stage in (*NOMINAL_STAGES, "fos_loaded"):
        if stage not in run.stages:
            continue
        for name, values, zero in zip(TORQUES, torques, (run.offset_in, run.offset_out), strict=True):
            turning = speed if stage != "sos" else speed_in.value if speed_in and name == "torque_in" else 0.0
            one = level(time, values, run.stages[stage], turning if math.isfinite(turning) else 0.0, zero)
            if one is not None:
                found[name, stage] = one
    return found


def _peaks(run: AlignedRun, levels: Mapping[tuple[str, str], Level]) -> dict[tuple[str, str], Peak]:
    found = {}
    spans = {}
    if "startup" in run.stages:
        start, end = run.stages["startup"]
        spans["startup"] = (start - _AROUND_PEAK, end + _AROUND_PEAK)
    if "unlock" in run.events:
        onset = run.events.get("brake_onset", run.events["unlock"] - 0.3)
        spans["brake"] = (onset - _AROUND_PEAK, run.events["unlock"] + _AROUND_PEAK)
    for name, values, zero in zip(
        TORQUES, (run.torque_in, run.torque_out), (run.offset_in, run.offset_out), strict=True
    ):
        steady = [levels[name, stage].span for stage in _FOS_STAGES if (name, stage) in levels]
        noise = steady_noise(run.time, values, steady)
        for stage, span in spans.items():
            one = peak(run.time, values, span, noise, offset=zero)
            if one is not None:
                found[name, stage] = one
    return found


def _unlock(run: AlignedRun, levels: Mapping[tuple[str, str], Level]) -> Peak | None:
    settled, unlock = levels.get(("torque_in", "fos")), run.events.get("unlock")
    if settled is None or unlock is None:
        return None
    onset = run.events.get("brake_onset", unlock - 0.3)
    return unlock_peak(run, (onset - _AROUND_PEAK, unlock + _AROUND_PEAK), settled.span)


def _transfers(
    run: AlignedRun,
    levels: Mapping[tuple[str, str], Level],
    steady: list[tuple[float, float]],
    peaks: Mapping[tuple[str, str], Peak],
    zeroed: bool,
) -> dict[str, Transfer]:
    """Return the slopes by phase; a saturated peak spoils its phase, and without a zero there is no T_00."""
    cut = {stage for (_, stage), one in peaks.items() if one.saturated}
    found: dict[str, Transfer | None] = {}
    if "startup" not in cut:
        found["startup"] = startup_transfer(run, steady)
    if "brake" not in cut:
        found["brake"] = brake_transfer(run, steady)
    for phase, stage in (("steady", "sos"), ("loaded", "fos_loaded")):
        fos, loaded = ([levels.get((name, each)) for name in TORQUES] for each in ("fos", stage))
        if fos[0] and fos[1] and loaded[0] and loaded[1]:
            one = steady_transfer((fos[0], fos[1]), (loaded[0], loaded[1]))
            found[phase] = None if one is None else replace(one, phase=phase)
    known = {phase: one for phase, one in found.items() if one is not None}
    if zeroed:
        return known
    return {phase: replace(one, intercept=math.nan, intercept_error=math.nan) for phase, one in known.items()}


def _load_parts(run: AlignedRun, windows: Windows | None) -> dict[str, LoadFit]:
    if windows is None:
        return {}
    parts = {name: load_parameters([windows.part(span)]) for name, span in free_spans(run).items()}
    return {name: fit for name, fit in parts.items() if fit is not None}
