"""Zero offsets of the torques, from where the motor is off and the shaft stands (gearbox.md, 5.2 and 11).

A shaft that stands still under torque tells no zero: the stretch ends where the input torque begins to rise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.gearbox.record import TORQUES, Record
from pipeline.rigs.gearbox.stages.breaks import find_break, parabola, ramp
from pipeline.rigs.gearbox.stages.stage import EventTime, Problem, Segmentation, Stage
from pipeline.signals.periodogram import block_means

_BLOCK = 0.02
# Kept clear of motion and of the motor's begin, s; the shortest stretch that tells a zero, s.
_CLEAR, _LEAST = 0.1, 0.5
# The motor's begin is significant that takes away so many variances for its three parameters.
_SIGNIFICANT = 25.0
# A standstill with so much of FOS's input torque is held under torque; a drift is one beyond so many sigmas.
_HELD, _DRIFT = 0.2, 3.0


@dataclass(frozen=True)
class Level:
    """Mean torque over a standstill: `value` and standard error `sd` (N m) with `dof`, and its middle `time` (s)."""

    time: float
    value: float
    sd: float
    dof: float


@dataclass(frozen=True)
class Offset:
    """Zero of one torque channel.

    Attributes
    ----------
    before, after
        Zero at the begin and at the end of the run; None where it does not stand there. One of them is there.
    drifts
        Whether they differ by more than three standard errors; then the zero is interpolated between them.
    """

    before: Level | None
    after: Level | None
    drifts: bool = False

    @property
    def _known(self) -> tuple[Level, ...]:
        return tuple(level for level in (self.before, self.after) if level is not None)

    @property
    def _weights(self) -> tuple[float, ...]:
        """Shares of both ends: as long as each tells, not as its own error says, which may be small by chance."""
        parts = [1.0 if self.drifts else level.dof for level in self._known]
        return tuple(part / sum(parts) for part in parts)

    @property
    def value(self) -> float:
        """Zero of the run as one number, N m: the weighted mean, of a drifting one the mean of both ends."""
        return sum(w * level.value for w, level in zip(self._weights, self._known, strict=True))

    @property
    def sd(self) -> float:
        """Standard error of the zero, N m; a drift adds the spread that a straight line between the ends leaves open."""
        levels = self._known
        if not self.drifts:
            return math.hypot(*(w * level.sd for w, level in zip(self._weights, levels, strict=True)))
        # Within a straight drift anything may have happened: an even spread over half of it.
        spread = abs(levels[1].value - levels[0].value) / math.sqrt(12.0)
        return math.hypot(max(level.sd for level in levels), 0.5 * spread)

    @property
    def dof(self) -> float:
        """Degrees of freedom of `sd` (Welch-Satterthwaite)."""
        levels = self._known
        if self.drifts:
            return min(level.dof for level in levels)
        parts = [(w * level.sd) ** 4 / level.dof for w, level in zip(self._weights, levels, strict=True)]
        return self.sd**4 / sum(parts)

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return what to take off at `time`, N m, same shape."""
        if self.drifts and self.before is not None and self.after is not None:
            return np.asarray(
                np.interp(time, [self.before.time, self.after.time], [self.before.value, self.after.value])
            )
        return np.full(np.shape(time), self.value)


@dataclass(frozen=True)
class Offsets:
    """Zeros of both torques, None where the run has no standstill, and when the motor came on."""

    torque_in: Offset | None
    torque_out: Offset | None
    motor_on: EventTime | None = None
    problems: tuple[Problem, ...] = ()

    @property
    def known(self) -> bool:
        """Tell whether both zeros are known."""
        return self.torque_in is not None and self.torque_out is not None


def zero_offsets(record: Record, segmentation: Segmentation) -> Offsets:
    """Return the zero offsets of a run from its standstills.

    Parameters
    ----------
    record, segmentation
        On one clock, see `segmentation.segment`.
    """
    stands = segmentation.all("standstill")
    begin = record.torque.span[0]
    problems: list[Problem] = []
    motor_on = None
    found: list[tuple[bool, Stage]] = []
    for stand in stands:
        first = stand.start - begin < 1.0 or any(
            s.name == "startup" and s.start >= stand.end - 1e-6 for s in segmentation.stages
        )
        if first:
            motor_on = motor_on or motor_begin(record, stand)
            end = motor_on.time if motor_on is not None else stand.end
            found.append((True, Stage("standstill", begin, min(end - _CLEAR, stand.end - _CLEAR))))
        else:
            found.append((False, Stage("standstill", _quiet_from(record, stand), record.torque.span[1])))
    running = _running(record, segmentation)
    ends: dict[tuple[str, bool], Level | None] = {}
    for first, stretch in found:
        levels = {name: _level(record, name, stretch) for name in TORQUES}
        at_input = levels["torque_in"]
        if at_input is not None and running and abs(at_input.value) > _HELD * abs(running):
            text = (
                f"torque_in reads {at_input.value:+.3f} N m while the shaft stands: the shaft is held under torque or the "
                "sensor is far off zero, so this standstill tells no zero of either torque"
            )
            problems.append(Problem((stretch.start, stretch.end), text))
            continue
        for name, level in levels.items():
            ends[name, first] = ends.get((name, first)) or level
    offsets: dict[str, Offset | None] = {}
    for name in TORQUES:
        offsets[name], told = _offset(name, ends.get((name, True)), ends.get((name, False)))
        problems += told
    if any(offset is None for offset in offsets.values()):
        names = " and ".join(name for name, offset in offsets.items() if offset is None)
        text = (
            f"no standstill tells the zero of {names}: efficiency and drag keep the sensors' offsets, differences between "
            "stages do not. Log 2 s before the motor is switched on"
        )
        problems.append(Problem(record.torque.span, text))
    return Offsets(offsets["torque_in"], offsets["torque_out"], motor_on, tuple(problems))


def _offset(name: str, before: Level | None, after: Level | None) -> tuple[Offset | None, list[Problem]]:
    if before is None and after is None:
        return None, []
    if before is None or after is None:
        return Offset(before, after), []
    error = math.hypot(before.sd, after.sd)
    if abs(after.value - before.value) <= _DRIFT * error:
        return Offset(before, after), []
    text = (
        f"the zero of {name} drifts from {before.value:+.4f} to {after.value:+.4f} N m over the run "
        f"({abs(after.value - before.value) / error:.1f} standard errors); a straight line between them is taken off"
    )
    return Offset(before, after, True), [Problem((before.time, after.time), text)]


def motor_begin(record: Record, stand: Stage) -> EventTime | None:
    """Return when the input torque begins to rise in a standstill; None where no rise is significant.

    The rise is a break from a constant to a straight line and a parabola, tested against no break with
    errors that know the drift of the sensor.
    """
    part = record.torque.part(record.torque.span[0], stand.end - 0.02)
    if part.time.size < 3 or part.time[-1] - part.time[0] < 0.2:
        return None
    time, level = block_means(part.time, part["torque_in"], max(round(part.rate * _BLOCK), 1))
    if time.size < 12:
        return None
    within = (float(time[2]), float(time[-3]))
    found, (without, broken) = find_break(time, level, [np.ones_like(time)], [ramp, parabola], within)
    before = level[time <= found.time]
    if before.size < 4:
        return None
    # Drift correlates neighbours: fewer independent samples make the same gain less sure.
    inflation = before.size / effective_size(before)
    if (without - broken) / (broken / max(time.size - 4, 1)) < _SIGNIFICANT * inflation:
        return None
    return EventTime(found.time, math.hypot(found.sd * math.sqrt(inflation), _BLOCK))


def _quiet_from(record: Record, stand: Stage) -> float:
    """Return from when on a standstill at the end of a run is without torque: the shaft may relax first."""
    part = record.torque.part(stand.start + _CLEAR, record.torque.span[1])
    if part.time.size < 3:
        return stand.end
    time, level = block_means(part.time, part["torque_in"], max(round(part.rate * _BLOCK), 1))
    if time.size < 12:
        return stand.end
    last = level[time.size // 2 :]
    sigma = max(float(np.std(last)), 1e-9)
    off = np.flatnonzero(np.abs(level - np.median(last)) > 4.0 * sigma)
    return float(time[off[-1]] + _CLEAR) if off.size else float(part.time[0])


def _level(record: Record, name: str, stretch: Stage) -> Level | None:
    part = record.torque.part(stretch.start, stretch.end)
    if part.time.size < 10 or part.time[-1] - part.time[0] < _LEAST:
        return None
    time, level = block_means(part.time, part[name], max(round(part.rate * _BLOCK), 1))
    independent = effective_size(level)
    sd = float(np.std(level)) / math.sqrt(max(independent - 1.0, 1.0))
    # The correlation time is estimated too, and scatters more than the variance (Sokal 1997, eq. 3.19).
    dof = max(independent / 3.0, 1.0)
    return Level(0.5 * (float(time[0]) + float(time[-1])), float(level.mean()), max(sd, 1e-9), dof)


def _running(record: Record, segmentation: Segmentation) -> float:
    """Return the median input torque of FOS, N m; 0 where there is none."""
    stage = segmentation.stage("fos") or segmentation.stage("fos_after")
    values = record.torque.part(stage.start, stage.end)["torque_in"] if stage else np.zeros(0)
    return float(np.median(values)) if values.size else 0.0
