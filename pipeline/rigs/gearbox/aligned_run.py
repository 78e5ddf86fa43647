"""One run as its numbers need it: all boards on one clock, offsets taken off, stages known.

Plain arrays and no file, recipe or finding; who aligned them and found the stages is said elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pipeline.signals.periodogram import block_means

Span = tuple[float, float]

# Torques are averaged to about this rate wherever a mean or a slow fit is wanted, Hz.
SLOW_RATE = 100.0


@dataclass(frozen=True)
class ZeroOffset:
    """Zero offset of a torque channel, N m: value, standard error, degrees of freedom."""

    value: float = 0.0
    std_error: float = 0.0
    dof: float = np.inf


@dataclass(frozen=True, eq=False)
class AlignedRun:
    """One run.

    Attributes
    ----------
    run
        Name.
    time, torque_in, torque_out
        s and N m, shape (n,), offsets taken off.
    angle_time, angle
        s and rad, shape (m,): angle of the output shaft where the encoder was read.
    stages
        Stage name -> (start, end), s.
    events
        Event name -> time, s.
    speed_nominal
        Nominal speed of the output shaft while locked, rad/s, as measured.
    offset_in, offset_out
        What was taken off.
    free
        Every stretch where the load turns forward with a free brake: what sets it in motion (`startup`, `release`),
        start and end, s. Empty where only `stages` are known.
    gaps
        Where the encoder told nothing or lost counts, s: the angle has a break across them.
    lost
        Torque channel -> where its samples are none of the sensor's, s.
    rate_sd
        Board (`encoder`, `vibration`) -> relative standard uncertainty of its clock's rate against that of the torques.
    """

    run: str
    time: np.ndarray
    torque_in: np.ndarray
    torque_out: np.ndarray
    angle_time: np.ndarray
    angle: np.ndarray
    stages: Mapping[str, Span]
    events: Mapping[str, float] = field(default_factory=dict)
    speed_nominal: float = np.nan
    offset_in: ZeroOffset = field(default_factory=ZeroOffset)
    offset_out: ZeroOffset = field(default_factory=ZeroOffset)
    free: tuple[tuple[str, float, float], ...] = ()
    gaps: tuple[Span, ...] = ()
    rate_sd: Mapping[str, float] = field(default_factory=dict)
    lost: Mapping[str, tuple[Span, ...]] = field(default_factory=dict)

    @cached_property
    def slow(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stamps and both torques as block means at about 100 Hz, shape (n',) each."""
        return self.means(SLOW_RATE)

    def means(self, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return stamps and both torques as block means at about `rate` Hz, shape (n',) each."""
        size = max(round(1 / (rate * float(np.median(np.diff(self.time))))), 1)
        kept = np.isfinite(self.torque_in) & np.isfinite(self.torque_out)
        time, torque_in = block_means(self.time[kept], self.torque_in[kept], size)
        return time, torque_in, block_means(self.time[kept], self.torque_out[kept], size)[1]

    def angle_at(self, time: np.ndarray) -> np.ndarray:
        """Return the output shaft's angle at `time`, rad, same shape; held beyond the ends."""
        return np.asarray(np.interp(time, self.angle_time, self.angle))

    def whole(self, start: float, end: float) -> bool:
        """Tell whether the encoder was read without a loss between `start` and `end`, s."""
        return not any(first < end and last > start for first, last in self.gaps)

    def has(self, *stages: str) -> bool:
        """Tell whether all these stages were found."""
        return all(stage in self.stages for stage in stages)


def within(time: np.ndarray, span: Span) -> slice:
    """Return the slice of increasing `time` inside `span`."""
    first, last = np.searchsorted(time, span)
    return slice(int(first), int(last))
