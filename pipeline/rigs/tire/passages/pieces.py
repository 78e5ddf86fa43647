"""The rows of a log put on its even grid, piece by piece; samples at an end of the scale are lost."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.tire.passages.layout import Layout

# A silence from here on (s) is left out between two pieces instead of filled with NaN.
_SILENCE = 10.0
# So many equal codes at an end of the scale are clipped.
_CLIPPED = 3
# So many samples in a row at the highest or lowest volts of all are flat, where the scale of the converter is not stated.
_FLAT = 20


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of the log on the even grid.

    Attributes
    ----------
    first, begins, rate
        Number of its first sample, the moment of that (s), samples per second.
    flex, film
        V, shape (n,), NaN where lost or clipped; film None where there is none.
    clipped
        Whether the flex sensor was at an end of the scale, shape (n,); None where it never was.
    film_clipped
        The same of the film.
    """

    first: int
    begins: float
    rate: float
    flex: np.ndarray
    film: np.ndarray | None
    clipped: np.ndarray | None = None
    film_clipped: np.ndarray | None = None

    @property
    def time(self) -> np.ndarray:
        """Moment of each sample, s, shape (n,)."""
        return np.asarray(self.begins + np.arange(self.flex.size) / self.rate)


class Gatherer:
    """Puts rows on the grid; gives a piece of `size` samples when it is full or a long silence begins.

    Parameters
    ----------
    scales
        Least and highest volts of the flex sensor, and of the film where there is one.
    stated
        Whether the scale of the converter is in them; else the signal's own flat ends tell.
    """

    def __init__(self, layout: Layout, scales: Sequence[tuple[float, float]], size: int, *, stated: bool) -> None:
        self._layout, self._scales, self._size = layout, scales, size
        self._stated = stated
        self._silence = int(_SILENCE * layout.rate)
        self._channels = len(scales)
        self._run = 0
        self._first = 0
        self._filled, self._begun = 0, False
        self._buffer = np.full((self._channels, size), np.nan)

    def add(self, row: int, rows: int, volts: list[np.ndarray]) -> Iterator[Piece]:
        """Take `rows` rows from row `row` on, volts by channel, shape (rows,) each; yield what is full."""
        starts, places = self._layout.rows, self._layout.places
        done = 0
        while done < rows:
            ends = int(starts[self._run + 1]) if self._run + 1 < starts.size else self._layout.size
            if row + done >= ends:
                self._run += 1
                continue
            place = int(places[self._run]) + row + done - int(starts[self._run])
            count = min(ends - row - done, rows - done)
            while count:
                silent = place - self._first - self._filled > self._silence
                if self._filled and silent:
                    yield self._piece(place)
                if not self._begun or silent:
                    self._first, self._begun = place, True
                while place >= self._first + self._size:
                    yield self._piece(place)
                at = place - self._first
                if at < 0:  # Late, and its piece is given already.
                    skipped = min(count, -at)
                    place, done, count = place + skipped, done + skipped, count - skipped
                    continue
                now = min(count, self._size - at)
                for channel, values in enumerate(volts):
                    self._buffer[channel, at : at + now] = values[done : done + now]
                self._filled = max(self._filled, at + now)
                place, done, count = place + now, done + now, count - now

    def rest(self) -> Iterator[Piece]:
        """Yield what is left at the end of the log."""
        if self._filled:
            yield self._piece(self._first + self._filled)

    def _piece(self, following: int) -> Piece:
        """Return what is gathered; a short gap up to the sample `following` belongs to it."""
        gap = following - self._first - self._filled
        length = self._filled if gap > self._silence else min(self._filled + gap, self._size)
        values = self._buffer[:, :length]
        clipped = [
            _clipped(row, max(least, flat[0]), min(most, flat[1]))
            for row, (least, most) in zip(values, self._scales, strict=True)
            for flat in [(-math.inf, math.inf) if self._stated else _flat_ends(row)]
        ]
        for row, mask in zip(values, clipped, strict=True):
            if mask is not None:
                row[mask] = np.nan
        piece = Piece(
            self._first,
            self._layout.begins + self._first / self._layout.rate,
            self._layout.rate,
            values[0],
            values[1] if self._channels == 2 else None,
            clipped[0],
            clipped[1] if self._channels == 2 else None,
        )
        self._buffer = np.full((self._channels, self._size), np.nan)
        self._first += length
        self._filled = 0
        return piece


def _flat_ends(volts: np.ndarray) -> tuple[float, float]:
    """Return below and above which volts are at an end of a scale that nobody stated: where they stay at their extreme."""
    least, most = -math.inf, math.inf
    valid = volts[np.isfinite(volts)]
    if valid.size:
        low, high = float(valid.min()), float(valid.max())
        slack = 1e-6 * max(high - low, 1e-3)
        if _longest(valid <= low + slack) >= _FLAT:
            least = low + 2.0 * slack
        if _longest(valid >= high - slack) >= _FLAT:
            most = high - 2.0 * slack
    return least, most


def _longest(mask: np.ndarray) -> int:
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _clipped(volts: np.ndarray, least: float, most: float) -> np.ndarray | None:
    """Return which samples are beyond the ends of the scale, at least three in a row; None where there are none."""
    at_end = (volts < least) | (volts > most)
    if not at_end.any():
        return None
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_end, [False]]).astype(np.int8)))
    begins, ends = edges[::2], edges[1::2]
    mask = np.zeros(volts.size, dtype=bool)
    for begin, end in zip(begins[ends - begins >= _CLIPPED], ends[ends - begins >= _CLIPPED], strict=True):
        mask[begin:end] = True
    return mask if mask.any() else None
