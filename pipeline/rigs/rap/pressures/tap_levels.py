"""Level and scatter of each pressure with the pump on and off, on its own clock: what units, signs and exchanges are judged by."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.rigs.rap.conditions import pressure
from pipeline.rigs.rap.pressures.record import Record, Source
from pipeline.rigs.rap.tables import Signal

_MEANS = 2.0  # s; scatter is told about means of that length, so that steps of the protocol do not count


@dataclass(frozen=True)
class TapLevel:
    """One reader's pressure at one tap, Pa.

    Attributes
    ----------
    on, off
        Mean with the pump on and off; NaN where that does not occur.
    error
        Standard error of `on` less `off`, from means of 2 s.
    scatter
        Root mean square about means of 2 s with the pump on: pulsation and noise.
    noise
        The same with the pump off; NaN where it never is.
    spread
        Standard deviation over the whole run.
    """

    reader: str
    tap: str
    on: float
    off: float
    error: float
    scatter: float
    noise: float
    spread: float

    @property
    def channel(self) -> str:
        """Name of the channel."""
        return pressure(self.tap, self.reader)

    @property
    def zeroed(self) -> bool:
        """Tell whether the reading at rest is known."""
        return math.isfinite(self.off)

    @property
    def rise(self) -> float:
        """Mean with the pump on over the one at rest, or over the atmosphere where the pump never stops, Pa."""
        return self.on - self.off if self.zeroed else self.on

    @property
    def pulsation(self) -> float:
        """Root mean square of the pulsation, the noise at rest taken off, Pa."""
        noise = self.noise if math.isfinite(self.noise) else 0.0
        return math.sqrt(max(self.scatter**2 - noise**2, 0.0)) if math.isfinite(self.scatter) else math.nan


def tap_levels(record: Record) -> list[TapLevel]:
    """Return the levels of all pressures of a run."""
    return [_level(source, tap, one) for source in record.sources.values() for tap, one in source.taps.items()]


def _level(source: Source, tap: str, one: Signal) -> TapLevel:
    parts = {}
    for on in (True, False):
        means, about = [], []
        for start, end in source.spans.on if on else source.spans.off:
            first, last = np.searchsorted(one.time, (start, end))
            size = max(round(_MEANS * one.rate), 1) if one.time.size > 1 else 1
            count = (last - first) // size
            if count < 1:
                continue
            rows = one.values[first : first + count * size].reshape(count, size)
            means.append(rows.mean(axis=1))
            about.append(rows - rows.mean(axis=1, keepdims=True))
        if means:
            all_means = np.concatenate(means)
            scatter = float(np.sqrt(np.mean(np.concatenate([a.ravel() for a in about]) ** 2)))
            parts[on] = (float(all_means.mean()), float(all_means.std() / math.sqrt(all_means.size)), scatter)
    nothing = (math.nan, math.nan, math.nan)
    (on_mean, on_error, scatter), (off_mean, off_error, noise) = parts.get(True, nothing), parts.get(False, nothing)
    error = math.hypot(on_error, 0.0 if math.isnan(off_error) else off_error)
    return TapLevel(source.reader, tap, on_mean, off_mean, error, scatter, noise, float(one.values.std()))
