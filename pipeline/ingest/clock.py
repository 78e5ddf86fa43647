"""How the numbers of a time channel become seconds of the run, and which of them have a date.

Relative times stay as they were logged; times that count from 1970 or have a date count from the earliest stamp of
the run. Which channel is time is found in `timebase`; what is wrong with stamps is mended in `stamps`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from pipeline.errors import InputError
from pipeline.ingest.mapping import Source
from pipeline.recording import Level, QualityFinding
from pipeline.recording.units import conversion

_SECONDS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "second": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6,
    "usec": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9, "nsec": 1e-9, "min": 60.0, "h": 3600.0,
}  # fmt: skip
# Seconds since 1970 that a log may bear: 1998 to 2103.
_EPOCH = (0.9e9, 4.2e9)
# Days that date programs count, with their number on 1 January 1970; no rig is sampled faster than the limit (s).
_DAY = 86400.0
_DAY_COUNTS = {
    "days since the year 0, as MATLAB's datenum counts": 719529.0,
    "days since 1900, as Excel counts": 25569.0,
}
_FASTEST = 1e-6
_EPOCH_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True)
class TimeSource:
    """Where a table's time comes from: a channel in a unit, samples counted at a rate (Hz), or both: a channel that numbers them.

    `stated` tells whether someone stated the unit; numbers since 1970 are recognised either way.
    """

    channel: str | None
    unit: str = "s"
    stated: bool = False
    rate: float | None = None
    notes: tuple[QualityFinding, ...] = ()


class Clock:
    """Turns a table's stamps into seconds of the run; `start` must have seen the first stamp.

    Attributes
    ----------
    begins
        Seconds since 1970 of the first stamp; None for relative times.
    shift
        Seconds added to all, set by `align`.
    """

    def __init__(self, source: Source, time: TimeSource) -> None:
        self.where = source.where
        self.time = time
        self.begins: float | None = None
        self.shift = 0.0
        self.notes: list[QualityFinding] = list(time.notes)
        self._zero = 0.0
        self._factor = 1.0
        named = source.table.time_channel
        # A date of one channel is none of another that the recipe takes for time.
        self._absolute_start = source.table.absolute_start if named in (None, time.channel) else None
        self._started = False

    def start(self, first: float, step: float = math.nan) -> None:
        """Learn from the first stamp and the usual step, as logged, whether times have a date and in which unit."""
        if self._started:
            return
        self._started = True
        if self.time.channel is None:
            return
        if self.time.rate is not None:
            self._factor = 1.0 / self.time.rate
            return
        self._factor = _seconds_per(self.time.unit, self.where, self.time.channel)
        if self._absolute_start is not None:
            self.begins = _seconds_since_1970(self._absolute_start) + first * self._factor
            self._zero = first
            return
        unit = _epoch_unit(first, self._factor)
        if unit is None:
            self._start_with_days(first, step)
            return
        if self.time.stated and _EPOCH_UNITS[unit] != self._factor:
            said = f"'{self.time.channel}' has the unit {self.time.unit}, but its numbers are {unit} since 1970"
            self.notes.append(QualityFinding("warning", f"{self.where}: {said}; they are taken so."))
        self._factor = _EPOCH_UNITS[unit]
        self._zero = first
        self.begins = first * self._factor

    def _start_with_days(self, first: float, step: float) -> None:
        """Take numbers for days of our time where the unit says so, or where as seconds no rig is that fast."""
        for counted, in_1970 in _DAY_COUNTS.items():
            begins = (first - in_1970) * _DAY
            if not _EPOCH[0] <= begins <= _EPOCH[1]:
                continue
            is_sure = self._factor == _DAY if self.time.stated else 0 < step < _FASTEST
            said = (
                f"{self.where}: the numbers of '{self.time.channel}' begin with {first:.9g}, which is "
                f"{datetime.fromtimestamp(begins, UTC):%Y-%m-%d %H:%M} in {counted}"
            )
            if is_sure:
                self._factor, self._zero, self.begins = _DAY, first, begins
                fine = f"they resolve {1e6 * _DAY * float(np.spacing(first)):.2g} us"
                why = "" if self.time.stated else f" (as seconds they would make {1.0 / step:.3g} samples a second)"
                level: Level = "note" if self.time.stated else "warning"
                self.notes.append(QualityFinding(level, f"{said}; they are taken so{why}, and {fine}."))
            elif not self.time.stated and in_1970 > 1e5:
                advice = "They are taken as seconds; if they are days, say `time: {unit: d}` in the recipe."
                self.notes.append(QualityFinding("warning", f"{said}. {advice}"))
            return

    @property
    def seconds_per_unit(self) -> float:
        """Seconds that one unit of the stamps lasts."""
        return self._factor

    def seconds(self, stamps: np.ndarray) -> np.ndarray:
        """Return stamps (n,) as seconds of the run."""
        if self._zero == 0.0 and self._factor == 1.0 and self.shift == 0.0:
            return stamps
        return (stamps - self._zero) * self._factor + self.shift


def align(clocks: Sequence[Clock]) -> float | None:
    """Let absolute clocks count from the earliest stamp of the run, and return that, s since 1970; None without any."""
    absolute = [clock.begins for clock in clocks if clock.begins is not None]
    if not absolute:
        return None
    earliest = min(absolute)
    for clock in clocks:
        if clock.begins is not None:
            clock.shift = clock.begins - earliest
    relative = [clock for clock in clocks if clock.begins is None]
    for clock in relative:
        clock.notes.append(
            QualityFinding(
                "warning",
                f"{clock.where}: its times have no date but those of the run's other streams have; they cannot be "
                f"aligned and are kept as logged.",
            )
        )
    return earliest


def said_made_relative(begins: float) -> str:
    """Say for the provenance that times with a date count from the first of them."""
    moment = datetime.fromtimestamp(begins, UTC)
    return f"Absolute times were made relative: second 0 is {moment:%Y-%m-%dT%H:%M:%S}.{moment.microsecond:06d}Z."


def _seconds_per(unit: str, where: str, channel: str) -> float:
    known = _SECONDS.get(unit.strip().strip("[]()").strip())
    if known is not None:
        return known
    try:
        return conversion(unit, "s", f"{where}, channel '{channel}'").factor
    except InputError as error:
        raise InputError(
            f"{error} Give the unit of time in the recipe, under 'channels': "
            f'`time: {{channel: "{channel}", unit: s}}`.'
        ) from error


def _epoch_unit(first: float, factor: float) -> str | None:
    """Return the unit in which `first` is a moment of our days, None where it is a relative time.

    Another unit than the stated one is thought of only where the stated one leads beyond our days: a
    counter of microseconds since power-on passes 1e9 too.
    """
    if first * factor > _EPOCH[1]:
        return next((unit for unit, s in _EPOCH_UNITS.items() if _EPOCH[0] <= first * s <= _EPOCH[1]), None)
    if first * factor < _EPOCH[0]:
        return None
    return next((unit for unit, s in _EPOCH_UNITS.items() if s == factor), None)


def _seconds_since_1970(text: str) -> float:
    moment = datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
