"""Largest and smallest value of a channel and how samples gather there: saturation shows as flat tops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.ingest.quality.window import CONTEXT, Window, cut_off

# A flat top has at least this many equal samples in succession.
_FLAT = 3
# So many flat tops are looked at closely.
_VOTES = 8


@dataclass(frozen=True)
class FlatTops:
    """A level at which a channel was clipped: samples and tops there, from the first to the last (s)."""

    level: float
    samples: int
    tops: int
    longest: int
    start: float
    end: float


class Extreme:
    """Accumulates the largest (`upper`) or smallest value of one channel and the flat tops at it."""

    def __init__(self, upper: bool) -> None:
        self._upper = upper
        self.level = -np.inf if upper else np.inf
        self._restart()

    def _restart(self) -> None:
        self._samples = self._beside = self._tops = self._longest = 0
        self._votes: list[bool] = []
        self._start = self._end = float("nan")

    def add(self, window: Window) -> None:
        """Take the next window."""
        new = window.values[window.old :]
        if not new.size:
            return
        level = float(new.max() if self._upper else new.min())
        if level != self.level:
            if (level < self.level) is self._upper:
                return
            self._restart()
            self.level = level
        count = int(np.count_nonzero(new == level))
        self._samples += count
        if count < _FLAT:
            return
        rows = np.flatnonzero(new == level) + window.old
        others = new[new != level]
        if others.size:
            self._beside += int(np.count_nonzero(others == (others.max() if self._upper else others.min())))
        breaks = np.flatnonzero(np.diff(rows) > 1)
        first = rows[np.concatenate(([0], breaks + 1))]
        lengths = np.diff(np.concatenate(([0], breaks + 1, [rows.size])))
        flat = (lengths >= _FLAT) & (first > 0)
        self._tops += int(flat.sum())
        if not flat.any():
            return
        self._longest = max(self._longest, int(lengths[flat].max()))
        if np.isnan(self._start):
            self._start = window.moment(int(first[flat][0]))
        self._end = window.moment(int((first + lengths - 1)[flat][-1]))
        for at, length in zip(first[flat].tolist(), lengths[flat].tolist(), strict=True):
            if len(self._votes) >= _VOTES:
                break
            self._votes.append(cut_off(window.before(at, min(max(length, 32), CONTEXT)), level))

    def clipped(self) -> FlatTops | None:
        """Return the flat tops where the signal was cut off, None where there are none.

        They differ from the natural top of a slow, coarsely resolved signal in that far fewer samples
        lie one step below, and from rest and set values in how the signal arrives there. A level of
        exactly zero is where many quantities begin and is never called clipped.
        """
        enough = self._longest >= 5 or (self._tops >= 2 and self._longest >= _FLAT)
        gathered = self._samples >= 4 * max(self._beside, 1)
        if not enough or not gathered or self.level == 0.0 or 2 * sum(self._votes) < len(self._votes):
            return None
        return FlatTops(self.level, self._samples, self._tops, self._longest, self._start, self._end)
