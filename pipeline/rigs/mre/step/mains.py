"""Hum of the mains in force or current: its frequency and strength where the levels stand, and its wave over the whole log.

Multiples of the mains frequency are not looked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_GRIDS, _OFF = (50.0, 60.0), 0.2  # Hz
_MOST_TRIED = 300
# The mains wander: one wave does not fit a longer log, s.
LONGEST = 60.0
_SURE, _STRONG = 8.0, 0.5  # standard errors; of the noise beside
_FEWEST = 200


@dataclass(frozen=True)
class Hum:
    """One line: frequency (Hz), complex amplitude such that the wave is Re(a exp(2 pi i f t))."""

    frequency: float
    phasor: complex

    @property
    def amplitude(self) -> float:
        """In the unit of the channel."""
        return abs(self.phasor)

    def wave(self, time: np.ndarray) -> np.ndarray:
        """Return the hum at times (s), shape (n,)."""
        return np.asarray((self.phasor * np.exp(2j * math.pi * self.frequency * time)).real)


def hum_of(time: np.ndarray, values: np.ndarray, spans: Sequence[tuple[float, float]]) -> Hum | None:
    """Return the hum of the mains that stands out of the noise; None where there is none, or sampling is too slow.

    Parameters
    ----------
    time, values
        s, and any unit; shape (n,).
    spans
        Start and stop (s) of stretches in which the signal all but stands.

    Examples
    --------
    >>> t = np.arange(0, 5, 1e-3)
    >>> hum = hum_of(t, 2 * np.sin(2 * np.pi * 50.02 * t) + np.random.default_rng(0).standard_normal(t.size), [(0.0, 5.0)])
    >>> hum is not None and abs(hum.amplitude - 2) < 0.1 and abs(hum.frequency - 50.02) < 0.02
    True
    """
    times, rests = [], []
    for start, stop in spans:
        inside = (time >= start) & (time < stop)
        if inside.sum() > 50:
            t, x = time[inside], values[inside]
            u = (t - t.mean()) / max(float(np.ptp(t)), 1e-12)
            times.append(t)
            rests.append(x - np.polyval(np.polyfit(u, x, 3), u))
    if not times:
        return None
    t, x = np.concatenate(times), np.concatenate(rests)
    if t.size < _FEWEST:
        return None
    if t.size > 30_000:
        t, x = t[:30_000], x[:30_000]
    step, length = float(np.median(np.diff(t))), float(t[-1] - t[0])
    if step <= 0:  # stamps that stand in batches tell no phase
        return None
    best: Hum | None = None
    for grid in _GRIDS:
        if grid > 0.45 / step:
            continue
        count = int(min(max(16 * _OFF * length, 3), _MOST_TRIED)) | 1
        for f in np.linspace(grid - _OFF, grid + _OFF, count).tolist():
            phasor = complex(2 * np.mean(x * np.exp(-2j * math.pi * f * t)))
            if best is None or abs(phasor) > best.amplitude:
                best = Hum(f, phasor)
    if best is None:
        return None
    noise = float(np.std(x - best.wave(t)))
    sure = best.amplitude > _SURE * noise * math.sqrt(2 / t.size)
    return best if sure and best.amplitude > _STRONG * noise else None
