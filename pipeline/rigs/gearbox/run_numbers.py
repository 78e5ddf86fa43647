"""All numbers of one run: clocks aligned, stages found, offsets taken off, levels, peaks, slopes, load, speeds, vibration.

Each number is found by a module of its own; the order stands here. Nothing of a campaign.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.rigs.gearbox.aligned_run import AlignedRun, ZeroOffset
from pipeline.rigs.gearbox.clocks.alignment import Alignment, align
from pipeline.rigs.gearbox.common_time import break_off, common_time
from pipeline.rigs.gearbox.load.checks import inertia_parts
from pipeline.rigs.gearbox.load.inertia import LoadFit, load_parameters
from pipeline.rigs.gearbox.load.load_windows import WINDOW, Windows, free_spans, modulated
from pipeline.rigs.gearbox.record import TORQUES, Record
from pipeline.rigs.gearbox.stages.counts import Counts, counts_of
from pipeline.rigs.gearbox.stages.segmentation import segment
from pipeline.rigs.gearbox.stages.stage import Problem, Segmentation
from pipeline.rigs.gearbox.torques.clipping import clip_of
from pipeline.rigs.gearbox.torques.derived import Torque
from pipeline.rigs.gearbox.torques.hum import Hum, without_hum
from pipeline.rigs.gearbox.torques.lost_samples import lost_samples
from pipeline.rigs.gearbox.torques.nominal import Level
from pipeline.rigs.gearbox.torques.offsets import Offsets, zero_offsets
from pipeline.rigs.gearbox.torques.peaks import Peak
from pipeline.rigs.gearbox.torques.run_torques import Torques, torques_of
from pipeline.rigs.gearbox.torques.torque_map import Transfer
from pipeline.rigs.gearbox.vibration.sos_speed import InputSpeed, input_speed_of


@dataclass(frozen=True, eq=False)
class RunNumbers:
    """What one run tells.

    Attributes
    ----------
    record, alignment, segmentation, offsets, counts, run
        The run on the clock of the torques, and how it came there.
    torques
        Levels, peaks, slopes of the torque map, drifts, end stops.
    windows, load
        Integrated load equation and its fit to this run alone; `load_parts` to start-up and release alone.
    speed_out
        Mean output speed in FOS and its standard error, rad/s.
    speed_in
        Input speed in SOS.
    speed_at_unlock
        Speed of the locked shafts as the lock breaks, rad/s, NaN where it is not known.
    broken_off
        Logs that end before others.
    hums
        Torque channel -> mains hum that was taken off all its numbers, not off `record`.
    """

    record: Record
    alignment: Alignment
    segmentation: Segmentation
    offsets: Offsets
    counts: Counts
    run: AlignedRun
    torques: Torques = field(default_factory=Torques)
    windows: Windows | None = None
    load: LoadFit | None = None
    load_parts: Mapping[str, LoadFit] = field(default_factory=dict)
    speed_out: tuple[float, float] = (math.nan, math.nan)
    speed_in: InputSpeed | None = None
    speed_at_unlock: float = math.nan
    broken_off: tuple[Problem, ...] = ()
    hums: Mapping[str, Hum] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the run."""
        return self.record.run

    @property
    def levels(self) -> Mapping[tuple[str, str], Level]:
        """Nominal torques by (`torque_in` or `torque_out`, stage)."""
        return self.torques.levels

    @property
    def peaks(self) -> Mapping[tuple[str, str], Peak]:
        """Peak torques by (`torque_in` or `torque_out`, stage)."""
        return self.torques.peaks

    @property
    def transfers(self) -> Mapping[str, Transfer]:
        """Slope of output over input torque by phase: `startup`, `brake`, `steady`, `loaded`."""
        return self.torques.transfers

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
            else Torque.of_peak(self.torques.unlock, self.zero("torque_in"), unbiased=True)
        )

    def saturated(self, quantity: str, stage: str) -> bool:
        """Tell whether the peak is flat at its top."""
        peak_ = self.peaks.get((quantity, stage))
        return peak_ is not None and peak_.saturated

    @property
    def zeroed(self) -> bool:
        """Tell whether the zero offsets of both torques are known."""
        return not any(math.isnan(self.zero(name)) for name in TORQUES)

    def emptied(self) -> RunNumbers:
        """Return the same numbers without the samples that they were found in: some kB instead of MB."""
        none = np.zeros(0)
        run = replace(self.run, time=none, torque_in=none, torque_out=none, angle_time=none, angle=none)
        counts = replace(self.counts, time=none, angle=none)
        return replace(self, record=self.record.emptied(), run=run, counts=counts)


def numbers_of(record: Record) -> RunNumbers:
    """Return the numbers of one run."""
    logged = record.torque
    record, hums = without_hum(record)
    record, lasting = break_off(record)
    record, alignment = align(record)
    record, ended = common_time(record)
    lost = lost_samples(replace(record, torque=logged))
    segmentation = segment(record)
    offsets = zero_offsets(record, segmentation)
    counts = counts_of(record)
    run = _aligned(record, segmentation, offsets, counts)
    run = replace(run, rate_sd=alignment.rates, lost=lost)
    speed_out = _speed_out(run, counts)
    speed_in = input_speed_of(record, run)
    clips = {name: clip_of(logged.time, logged[name]) for name in TORQUES}
    torques = torques_of(run, offsets, clips, speed_out[0], speed_in.value if speed_in else math.nan)
    windows, parts = _load(run, torques)
    return RunNumbers(
        replace(record, torque=logged), alignment, segmentation, offsets, counts, run, torques,
        windows, None if windows is None else load_parameters([windows]), parts, speed_out, speed_in,
        _speed_at_unlock(run, speed_out[0]), (*lasting, *ended), hums,
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
        zeros["torque_in"], zeros["torque_out"], segmentation.free, segmentation.gaps,
    )  # fmt: skip


def _speed_out(run: AlignedRun, counts: Counts) -> tuple[float, float]:
    """Return the slope of the angle over FOS and its standard error, that of the encoder's clock included, rad/s."""
    start, end = run.stages.get("fos", (math.nan, math.nan))
    speed, error = counts.rate(start + 0.2, end - 0.2)
    return speed, math.hypot(error, run.rate_sd["encoder"] * speed)


def _speed_at_unlock(run: AlignedRun, speed_out: float) -> float:
    """Return the speed of the locked shafts as the lock breaks, rad/s, NaN where it is not known.

    The brake slows them evenly from its onset on, so they have lost twice as much then as on the mean.
    """
    onset, unlock = (run.events.get(name, math.nan) for name in ("brake_onset", "unlock"))
    if not unlock - onset > 0.02 or not run.whole(onset, unlock):
        return math.nan
    turned = np.diff(run.angle_at(np.array([onset, unlock])))[0]
    return float(2.0 * turned / (unlock - onset) - speed_out)


def _load(run: AlignedRun, torques: Torques) -> tuple[Windows | None, dict[str, LoadFit]]:
    """Return the windows that tell of the load alone, and the fits to start-up and release alone."""
    windows = modulated(run, torques.steady)
    if windows is None:
        return None, {}
    cut = torques.clips["torque_out"].times
    if cut.size:
        near = np.searchsorted(cut, windows.time + WINDOW / 2) > np.searchsorted(cut, windows.time - WINDOW / 2)
        windows = windows.where(~near)
    for start, end in run.lost.get("torque_out", ()):
        windows = windows.where((windows.time + WINDOW / 2 < start) | (windows.time - WINDOW / 2 > end))
    drift = torques.drifts.get("torque_out")
    if drift is not None:
        windows = windows.drifting(np.array([drift.change(at) / (drift.rate or drift.step) for at in windows.time]))
    spans = free_spans(run)
    fits = {name: load_parameters([windows.part(span)]) for name, span in spans.items()}
    parts = {name: fit for name, fit in fits.items() if fit is not None}
    if {"startup", "release"} <= set(parts) and inertia_parts(parts["startup"], parts["release"]).failed:
        # Where they contradict each other the brake was not free as the load sped up; at start-up it surely was.
        windows = windows.where(windows.calm | (windows.time < spans["startup"][1]))
    return windows, parts
