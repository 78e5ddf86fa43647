"""One run of the bench as numbers: averaged waveform, marks, rotation, and what the reference table says meanwhile."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.recording import Condition, QualityFinding, Recording
from pipeline.rigs.tire.bench.reference import LOAD, SPEED, Reference, reference_of
from pipeline.rigs.tire.bench.speed_line import SpeedPoint, speed_point
from pipeline.rigs.tire.passages.device import Device, device_of
from pipeline.rigs.tire.passages.passage_faults import Course, course_of, passage_findings
from pipeline.rigs.tire.passages.revolutions import Revolutions, joined, revolutions_of
from pipeline.rigs.tire.passages.waveform import Waveform, averaged

_ROAD = "road"
# A load that was set and not measured: what all runs share, and what differs from run to run (relative).
NOMINAL_U, _NOMINAL_SCATTER = 0.02, 0.003
_FEWEST = 3
_FREE = 50.0


class FreeSpinError(InputError):
    """The wheel turned without load: nothing is wrong, and there is nothing to fit."""


@dataclass(frozen=True, eq=False)
class BenchRun:
    """What identification uses of one run. SI.

    Attributes
    ----------
    name, conditions
        As in the log.
    device, course, revolutions, waveform
        Of the transmitter: see `passages`.
    reference
        Means of the reference channels over the revolutions used.
    point
        Mean rotation (rad/s) and speed (m/s) over the same time.
    findings
        What is to be said of the run.
    supply
        Mean current (A) and battery voltage (V, NaN where not logged) of the transmitter; None without a current.
    reference_length
        How long the bench's table lasts by its own clock, s; NaN where there is none.
    """

    name: str
    conditions: Mapping[str, Condition]
    device: Device
    course: Course
    revolutions: Revolutions
    waveform: Waveform
    reference: Reference
    point: SpeedPoint
    findings: tuple[QualityFinding, ...]
    supply: tuple[float, float] | None = None
    reference_length: float = math.nan

    def told(self, name: str) -> float | None:
        """Return a numeric condition, None where the run does not state it."""
        value = self.conditions.get(name)
        return None if value is None or isinstance(value, str | bool) else float(value)

    @property
    def rotation(self) -> float:
        """Mean rotation, rad/s."""
        return self.point.rotation

    @property
    def load(self) -> float:
        """Load on the tire, N: measured, else as set; NaN where neither is known."""
        measured = self.reference.value(LOAD)
        return measured if math.isfinite(measured) else (self.told("nominal_load") or math.nan)

    @property
    def load_se(self) -> float:
        """Standard error of `load`, N, without the error of the load cell's gain."""
        error = self.reference.std_error(LOAD)
        return error if math.isfinite(error) else _NOMINAL_SCATTER * self.load

    @property
    def nominal_load(self) -> float:
        """Load at which results are told, N: as set, else the measured one to 10 N."""
        told = self.told("nominal_load")
        return told if told is not None else round(self.load, -1)

    @property
    def nominal_speed(self) -> float:
        """Speed at which results are told, m/s: as set, else the measured one to 0.01 m/s."""
        told = self.told("nominal_speed")
        if told is not None:
            return told
        measured = self.reference.value(SPEED)
        return round(measured, 2) if math.isfinite(measured) else round(0.32 * self.rotation, 2)

    @property
    def level(self) -> float:
        """R0, ohm: mean of the revolution, of a gated log as stated; NaN where neither is known."""
        told = self.device.sensor_resistance
        return self.waveform.level if math.isfinite(self.waveform.level) else math.nan if told is None else told

    @property
    def lift(self) -> float:
        """By how much the mean of what is recorded lies over R0, ohm: nothing unless the log is gated; NaN without R0."""
        if math.isfinite(self.waveform.level):
            return 0.0
        return float(np.nanmean(self.waveform.mean - self.waveform.change)) - self.level

    @property
    def peak(self) -> float:
        """Peak of the averaged waveform over its mean, ohm, straight from the bins."""
        return float(np.nanmax(self.waveform.change))


def bench_run(recording: Recording) -> BenchRun:
    """Return the numbers of one run.

    Raises
    ------
    InputError
        If the run cannot be used at all: there is no flex sensor, no passage, or it is of another experiment.
    """
    where = str(recording.conditions.get("bench_or_road", "")).strip().lower()
    if where == _ROAD:
        raise InputError(
            f"run '{recording.run}' says bench_or_road: road; it belongs to tire.road. Put it into a campaign of that experiment."
        )
    device = device_of(recording)
    blocks = list(revolutions_of(device))
    course = course_of(blocks)
    if sum(len(block) for block in blocks) < _FEWEST:
        load = recording.conditions.get("nominal_load")
        if isinstance(load, int | float) and load < _FREE:
            raise FreeSpinError(
                f"run '{recording.run}' is a free spin (nominal_load {load:g} N): without load there is no passage and nothing to fit"
            )
        findings = passage_findings(device, course, None)
        raise InputError(_no_passage(recording, findings))
    revolutions = joined(blocks)
    try:
        waveform = averaged(revolutions, middle=0.5 * sum(device.span))
    except InputError as error:
        findings = passage_findings(device, course, None)
        told = next((f.message for f in findings if f.level == "error"), str(error))
        raise InputError(told if told.startswith("run ") else f"run '{recording.run}': {told}") from error
    begin, end = _turns(revolutions)
    reference = reference_of(recording, begin, end, device.span)
    point = _speed_point(recording, revolutions, reference)
    findings = (*passage_findings(device, course, waveform), *reference.findings)
    return BenchRun(
        recording.run, dict(recording.conditions), device, course, revolutions, waveform, reference, point,
        tuple(findings), _supply(recording), _reference_length(recording),
    )  # fmt: skip


def _no_passage(recording: Recording, findings: tuple[QualityFinding, ...]) -> str:
    first = next((f.message for f in findings if f.level == "error"), "")
    return first or (
        f"run '{recording.run}' shows fewer than {_FEWEST} passages of the flex sensor: expected one high peak a revolution. Look whether the "
        "wheel turned, the sensor is connected and flex_code or flex_voltage is mapped to its column"
    )


def _turns(revolutions: Revolutions) -> tuple[np.ndarray, np.ndarray]:
    """Return when each revolution with a known speed begins and ends, half a turn about its peak, s."""
    known = np.isfinite(revolutions.speed) & (revolutions.speed > 0.0) & np.isfinite(revolutions.times)
    half = math.pi / revolutions.speed[known]
    return revolutions.times[known] - half, revolutions.times[known] + half


def _speed_point(recording: Recording, revolutions: Revolutions, reference: Reference) -> SpeedPoint:
    """Return rotation and speed over the same span; the speed is NaN where there is none."""
    known = np.isfinite(revolutions.speed)
    rotation = float(np.mean(revolutions.speed[known]))
    error = float(np.sqrt(np.nanmean(revolutions.speed_se[known] ** 2) / max(known.sum(), 1)))
    alone = SpeedPoint(recording.run, rotation, error, math.nan, math.nan)
    if SPEED not in reference.means:
        return alone
    time, speed = recording.signal(SPEED)
    try:
        return speed_point(recording.run, revolutions.times, revolutions.speed, revolutions.speed_se, time, speed)
    except InputError:
        return alone


def _reference_length(recording: Recording) -> float:
    """Return how long the bench's own table lasts by its stamps, s; NaN where there is none."""
    name = next((n for n in (SPEED, LOAD) if n in recording), None)
    time = recording.stream_of(name).time if name is not None else np.zeros(0)
    return float(time[-1] - time[0]) if len(time) > 1 else math.nan


def _supply(recording: Recording) -> tuple[float, float] | None:
    means = {
        name: float(np.nanmean(values))
        for name in ("supply_current", "battery_voltage")
        if name in recording and np.isfinite(values := recording.values(name)).any()
    }
    return (means["supply_current"], means.get("battery_voltage", math.nan)) if "supply_current" in means else None
