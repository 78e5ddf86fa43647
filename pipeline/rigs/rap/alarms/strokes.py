"""How long to average so that the pulsation averages out: whole strokes, as near to 1 s as they come.

A mean over 1 s leaves 13 % of a pulsation of 1.4 Hz, which is more than the noise of the sensors.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from pipeline.rigs.rap.alarms.pump import PumpRun
from pipeline.rigs.rap.tables import Signal

_WIDTH = 1.0
# Where strokes are looked for, Hz, and for how long at each set-point, s.
_BAND = (0.6, 5.0)
_LONGEST = 60.0
_SHORTEST = 8.0


def averaging(signals: Sequence[Signal], grid: np.ndarray, pump: PumpRun) -> np.ndarray:
    """Return the width of the mean at each moment of `grid` (n,), s: whole strokes of each set-point, 1 s without a pump.

    Parameters
    ----------
    signals
        Pulsating pressures, the first that tells the strokes decides; none gives 1 s throughout.
    """
    width = np.full(grid.shape, _WIDTH)
    for start, end in pump.running:
        inner = pump.set_changes[(pump.set_changes > start) & (pump.set_changes < end)]
        edges = [start, *inner.tolist(), end]
        for low, high in itertools.pairwise(edges):
            told = (_strokes(signal, low + 1.5, min(high, low + 1.5 + _LONGEST)) for signal in signals)
            frequency = next((found for found in told if np.isfinite(found)), float("nan"))
            if np.isfinite(frequency):
                width[(grid >= low) & (grid <= high)] = max(round(frequency * _WIDTH), 1) / frequency
    return width


def _strokes(signal: Signal, start: float, end: float) -> float:
    """Return the frequency of the strongest line between two moments, Hz; NaN where there is none or too little time."""
    inside = (signal.time >= start) & (signal.time <= end)
    n = int(inside.sum())
    if end - start < _SHORTEST or n < 2 * _BAND[1] * (end - start) / 2.0:
        return float("nan")
    values = signal.values[inside] - signal.values[inside].mean()
    step = (signal.time[inside][-1] - signal.time[inside][0]) / (n - 1)
    spectrum = np.abs(np.fft.rfft(values * np.hanning(n)))
    frequency = np.fft.rfftfreq(n, step)
    band = np.flatnonzero((frequency >= _BAND[0]) & (frequency <= min(_BAND[1], 0.45 / step)))
    if band.size < 3:
        return float("nan")
    peak = int(band[np.argmax(spectrum[band])])
    if not spectrum[peak] > 8.0 * float(np.median(spectrum[band])) or not 0 < peak < spectrum.size - 1:
        return float("nan")
    a, b, c = np.log(np.maximum(spectrum[peak - 1 : peak + 2], 1e-300))
    return float(frequency[peak] + 0.5 * (a - c) / (a - 2.0 * b + c) * frequency[1])
