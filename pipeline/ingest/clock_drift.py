"""Two clocks of one stream held against each other, block by block: do they drift apart by more than they scatter?

A recorder stamps messages with its own clock and messages may carry that of the device; only one of them is time.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.ingest.clock import TimeSource
from pipeline.ingest.mapping import Source
from pipeline.ingest.naming import plain
from pipeline.recording import QualityFinding

_STAMPS = {"stamp", "time", "timestamp", "device_time", "t"}
# Clocks are apart where their way from begin to end exceeds their scatter so many times, and this part of the record.
_SCATTERS, _LEAST = 5.0, 2e-5
_FEWEST = 20


def other_clock(source: Source, time: TimeSource) -> str | None:
    """Return a second clock of the table: the log's own where a channel is time, else a stamp that messages carry."""
    table = source.table
    if time.channel is None or table.time_channel is None:
        return None
    if time.channel != table.time_channel:
        return table.time_channel
    for channel in table.channels:
        is_stamp = plain(channel.name.rsplit(".", 1)[-1]) in _STAMPS and channel.unit == "s"
        if is_stamp and channel.name != time.channel and not channel.is_text:
            return channel.name
    return None


class ClockDrift:
    """Fits the difference of two clocks by a line, in one pass."""

    def __init__(self) -> None:
        self._n = 0
        self._origin: tuple[float, float] | None = None
        self._sums = np.zeros(5)
        self._span = 0.0

    def add(self, time: np.ndarray, other: np.ndarray) -> None:
        """Take the next block of both clocks, each (n,), s."""
        both = np.isfinite(time) & np.isfinite(other)
        if not both.any():
            return
        time, other = time[both], other[both]
        if self._origin is None:
            self._origin = (float(time[0]), float(other[0]))
        x = time - self._origin[0]
        y = (other - self._origin[1]) - x
        self._n += x.size
        self._sums += [x.sum(), y.sum(), (x * x).sum(), (x * y).sum(), (y * y).sum()]
        self._span = max(self._span, float(x.max()))

    def findings(self, where: str, time: str, other: str) -> list[QualityFinding]:
        """Return a warning where the clocks drift apart, else nothing; `time` is the one that is used."""
        if self._n < _FEWEST or self._span <= 0:
            return []
        sx, sy, sxx, sxy, syy = (self._sums / self._n).tolist()
        variance = sxx - sx * sx
        if not variance > 0:
            return []
        slope = (sxy - sx * sy) / variance
        scatter = math.sqrt(max(syy - sy * sy - slope * (sxy - sx * sy), 0.0))
        apart = slope * self._span
        if abs(slope) > 0.5 or abs(apart) <= max(
            _SCATTERS * scatter, _LEAST * self._span, 1e-9 * abs(sum(self._origin or ()))
        ):
            return []
        return [
            QualityFinding(
                "warning",
                f"{where}: two clocks of the log drift apart: '{other}' runs {100 * slope:+.3g} % against '{time}', "
                f"{abs(apart):.3g} s over {self._span:.4g} s, while they scatter by {scatter:.2g} s. '{time}' is used; "
                "name the other as time in the recipe if it is the better one.",
            )
        ]
