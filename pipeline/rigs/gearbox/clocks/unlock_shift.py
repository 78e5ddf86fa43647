"""What the breaking lock tells about the clock of the encoder: the output torque breaks off, and the flywheel feels it.

No shape of that break is assumed: the measured torque, integrated twice, is laid over the angle. The speed gives way
already as the brake comes on, since the drive droops under load, and the measured torque knows that too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.uncertainty import effective_size
from pipeline.rigs.gearbox.clocks.shift_search import Part
from pipeline.rigs.gearbox.record import Record
from pipeline.rigs.gearbox.stages.brake_events import brake_rise
from pipeline.rigs.gearbox.stages.count_events import angle_in
from pipeline.rigs.gearbox.stages.counts import Counts
from pipeline.rigs.gearbox.stages.input_torque import CLEAR
from pipeline.rigs.gearbox.stages.stage import Stage

# Of the angle this is used before the onset and after unlocking, s; and so many samples at the least.
_BEFORE, _AFTER, _FEWEST = 0.5, 0.2, 20
# The shift is looked for this far, first in coarse and then in fine steps, s.
_REACH, _COARSE, _FINE = 0.2, 0.01, 0.001
# What onset and polynomial leave open; over so much shift the squares are compared for the error, s.
_OPEN, _WIDE = 0.003, 0.005


def unlock_part(record: Record, counts: Counts, stages: Sequence[Stage], sos: Stage) -> Part | None:
    """Return the shift of the angle against the torque as the lock breaks; None where it does not tell.

    Eq. (A) under the brake, ``J w' = T_out - d_0 - T_b(t)`` with the brake's torque a polynomial from its onset on,
    integrated twice: what is left free is the inertia, that polynomial, and a straight line.
    """
    before = [stage for stage in stages if stage.end <= sos.start + 1e-9 and stage.name.startswith("fos")]
    if not before:
        return None
    rise = brake_rise(record, counts, before[-1], sos.start)
    if rise is None or rise.onset is None:
        return None
    onset, unlock = rise.onset, rise.peak
    span = (max(onset - _BEFORE, before[-1].start), min(unlock + _AFTER, sos.start - 0.02))
    t, angle = angle_in(counts, span)
    torque = record.torque.part(span[0] - 2 * _REACH, span[1] + 2 * _REACH)
    steady = torque.time < onset - 0.05
    if t.size < _FEWEST or not counts.whole(*span) or steady.sum() < _FEWEST or torque.time[-1] < span[1] + _REACH:
        return None
    load = torque["torque_out"] - torque["torque_out"][steady].mean()
    twice = np.cumsum(np.cumsum(load)) / torque.rate**2
    laws = [_Law(t, angle, torque.time, twice, onset, degree) for degree in (2, 3)]
    # A brake whose rise is freer leaves less to the torque: it tells how far the shift hangs on that.
    found = [_least(law, counts.step, clear) for law, clear in zip(laws, (CLEAR, 0.0), strict=True)]
    if any(part is None for part in found):
        return None
    one, other = (part for part in found if part is not None)
    sd = math.hypot(math.hypot(one.sd, _OPEN), one.shift - other.shift)
    return Part(unlock - one.shift, one.shift, sd, one.misfit)


@dataclass(frozen=True, eq=False)
class _Law:
    """The angle (rad, shape (n,)) under a torque that was integrated twice (N m s^2, shape (m,)), at any shift between both.

    The brake's torque is a polynomial of that degree from the onset (s of the torque) on.
    """

    time: np.ndarray
    angle: np.ndarray
    torque_time: np.ndarray
    twice: np.ndarray
    onset: float
    degree: int

    def parts(self, shift: float) -> tuple[np.ndarray, np.ndarray]:
        """Return angle and doubly integrated torque, what line and polynomial explain taken off, shape (n,) each."""
        late = np.maximum(self.time + shift - self.onset, 0.0)
        columns = [np.ones_like(late), self.time - self.onset, *(late ** (k + 2) for k in range(1, self.degree + 1))]
        driven = np.interp(self.time + shift, self.torque_time, self.twice)
        base, _ = np.linalg.qr(np.column_stack(columns))
        return self.angle - base @ (base.T @ self.angle), driven - base @ (base.T @ driven)

    def rest(self, shift: float) -> np.ndarray:
        """Return what of the angle is left unexplained, shape (n,): the torque drives the shaft, never works against it."""
        angle, driven = self.parts(shift)
        along = float(driven @ angle) / max(float(driven @ driven), 1e-30)
        return np.asarray(angle - max(along, 0.0) * driven)

    def squares(self, shift: float) -> float:
        """Return the sum of squares of what is left unexplained."""
        rest = self.rest(shift)
        return float(rest @ rest)


def _least(law: _Law, step: float, clear: float) -> Part | None:
    """Return the shift at which least is unexplained; None where that is no minimum inside the search, or no torque is seen."""
    low, high = -_REACH, _REACH
    for pace in (_COARSE, _FINE):
        shifts = np.arange(low, high + 0.5 * pace, pace)
        squares = [law.squares(float(shift)) for shift in shifts]
        best = int(np.argmin(squares))
        low, high = float(shifts[max(best - 1, 0)]), float(shifts[min(best + 1, shifts.size - 1)])
    shift, left = float(shifts[best]), squares[best]
    rest = law.rest(shift)
    variance = max(left / max(rest.size - law.degree - 4, 1), step**2 / 12.0)
    variance *= rest.size / max(min(effective_size(rest, 2), rest.size), 1.0)
    undriven = law.parts(shift)[0]
    bowl = law.squares(shift - _WIDE) + law.squares(shift + _WIDE) - 2.0 * left
    if abs(shift) > _REACH - 2 * _COARSE or bowl <= 0.0 or float(undriven @ undriven) - left < clear * variance:
        return None
    return Part(shift, shift, _WIDE * math.sqrt(2.0 * variance / bowl), left)
