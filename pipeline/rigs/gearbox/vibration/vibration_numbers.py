"""What the vibration of one run tells: level by stage, order spectra locked and slipping, mesh lines where there should be none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.estimation.estimate import Estimate, estimate, undetermined
from pipeline.recording import QualityFinding
from pipeline.rigs.gearbox.run_numbers import RunNumbers
from pipeline.rigs.gearbox.vibration.levels import (
    OrderSpectrum,
    aliased_lines,
    high_passed,
    order_spectrum,
    stage_vibration,
    transient,
)
from pipeline.rigs.gearbox.vibration.mesh import MeshSpeed, Ridge, partial_slip, slip_ridge
from pipeline.rigs.gearbox.vibration.sos_speed import line_orders, teeth_in
from pipeline.rigs.gearbox.vibration.vibration_faults import channel_faults

_STAGES = ("startup", "fos", "brake", "sos", "release", "fos_after", "rundown")
# The ridge is sought this long before the brake comes on and after the gears locked again, s.
_AROUND = 0.5


@dataclass(frozen=True)
class StageLevel:
    """Vibration of one channel in one stage: m/s^2, crest factor, kurtosis; the error is NaN where none can be told."""

    run: str
    stage: str
    channel: str
    rms: float
    std_error: float
    dof: float
    crest: float
    kurtosis: float

    @property
    def estimate(self) -> Estimate:
        """The level with an interval that is symmetric in its logarithm: it is positive."""
        if not self.rms > 0:
            return undetermined("vibration_rms", "the channel does not move: dead or not connected")
        if not math.isfinite(self.std_error):
            return undetermined(
                "vibration_rms", f"the stage is too short to tell an error (it reads {self.rms:.3g} m/s^2)"
            )
        return estimate("vibration_rms", self.rms, self.std_error, dof=self.dof, logarithmic=True)


@dataclass(frozen=True, eq=False)
class VibrationNumbers:
    """Vibration of one run.

    Attributes
    ----------
    levels
        One entry a stage and channel.
    spectra
        Order spectrum of the channel `channel` by stage (`fos` on the output shaft, `sos` on the input shaft).
    ridge
        Slip speed over time between brake and relock.
    partial
        Mesh lines found in FOS, None where there are none.
    aliased
        Mesh lines folded back at the sampling rate: (order, Hz).
    disturbance
        Mean square at unlock and relock over that of FOS.
    findings
        What is wrong with single channels.
    """

    levels: tuple[StageLevel, ...] = ()
    channel: str = ""
    spectra: Mapping[str, OrderSpectrum] = field(default_factory=dict)
    ridge: Ridge | None = None
    partial: MeshSpeed | None = None
    aliased: tuple[tuple[float, float], ...] = ()
    disturbance: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[QualityFinding, ...] = ()

    def emptied(self) -> VibrationNumbers:
        """Return the same numbers without spectra and ridge, which only drawings need."""
        return replace(self, spectra={}, ridge=None)


def vibration_of(numbers: RunNumbers) -> VibrationNumbers:
    """Return what the vibration of a run tells; nothing where it was not logged."""
    log, run = numbers.record.vibration, numbers.run
    if log is None or log.time.size < 64:
        return VibrationNumbers()
    time = log.time
    channels = {name: high_passed(time, values) for name, values in log.values.items()}
    stages = [stage for stage in _STAGES if stage in run.stages]
    levels = [
        StageLevel(run.run, stage, name, one.rms, one.rms_error, one.dof, one.crest, one.kurtosis)
        for stage in stages
        for name, values in channels.items()
        if (one := stage_vibration(time, values, run.stages[stage])) is not None
    ]
    faults = channel_faults(run.run, log, levels_by_channel(levels))
    live = {name: values for name, values in channels.items() if np.ptp(log[name]) > 0}
    if not live:
        return VibrationNumbers(tuple(levels), findings=tuple(faults))
    orders = line_orders(teeth_in(numbers.record))
    channel, values = next(iter(live.items()))
    return VibrationNumbers(
        tuple(levels), channel, _spectra(numbers, time, values), _ridge(numbers, live, orders),
        _partial(numbers, live, orders), _aliased(numbers, time, values, orders), _disturbance(numbers, time, values),
        tuple(faults),
    )  # fmt: skip


def levels_by_channel(levels: Sequence[StageLevel]) -> dict[str, dict[str, float]]:
    """Return channel -> stage -> rms, m/s^2."""
    found: dict[str, dict[str, float]] = {}
    for level in levels:
        found.setdefault(level.channel, {})[level.stage] = level.rms
    return found


def _spectra(numbers: RunNumbers, time: np.ndarray, values: np.ndarray) -> dict[str, OrderSpectrum]:
    run, speed = numbers.run, numbers.speed_in
    found: dict[str, OrderSpectrum | None] = {}
    if "fos" in run.stages:
        found["fos"] = order_spectrum(time, values, run.stages["fos"], run.angle_at(time))
    if "sos" in run.stages and speed is not None and speed.source != "nominal":
        found["sos"] = order_spectrum(time, values, run.stages["sos"], speed.value * (time - time[0]))
    return {stage: one for stage, one in found.items() if one is not None}


def _ridge(numbers: RunNumbers, channels: Mapping[str, np.ndarray], orders: tuple[float, ...]) -> Ridge | None:
    run, speed, log = numbers.run, numbers.speed_in, numbers.record.vibration
    if log is None or speed is None or "sos" not in run.stages:
        return None
    start = run.events.get("brake_onset", run.stages["sos"][0]) - _AROUND
    end = run.events.get("relock", run.stages["sos"][1]) + _AROUND
    first = dict([next(iter(channels.items()))])
    return slip_ridge(log.time, first, (start, end), 1.1 * speed.value, orders, hop=0.1)


def _partial(numbers: RunNumbers, channels: Mapping[str, np.ndarray], orders: tuple[float, ...]) -> MeshSpeed | None:
    run, log, speed = numbers.run, numbers.record.vibration, numbers.speed_out[0]
    if log is None or "fos" not in run.stages or not math.isfinite(speed):
        return None
    first = dict([next(iter(channels.items()))])
    return partial_slip(log.time, first, run.stages["fos"], speed, orders, run.stages.get("standstill"))


def _aliased(
    numbers: RunNumbers, time: np.ndarray, values: np.ndarray, orders: tuple[float, ...]
) -> tuple[tuple[float, float], ...]:
    run, speed = numbers.run, numbers.speed_in
    if speed is None or "sos" not in run.stages:
        return ()
    return tuple(aliased_lines(time, values, run.stages["sos"], speed.value, orders))


def _disturbance(numbers: RunNumbers, time: np.ndarray, values: np.ndarray) -> dict[str, float]:
    run = numbers.run
    if "fos" not in run.stages:
        return {}
    found = {
        event: transient(time, values, run.events[event], run.stages["fos"])
        for event in ("unlock", "relock")
        if event in run.events
    }
    return {event: value for event, value in found.items() if math.isfinite(value)}
