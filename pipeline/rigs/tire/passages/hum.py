"""Mains hum in what the template leaves of the flex voltage (tire.md, section 8)."""

from __future__ import annotations

import numpy as np

from pipeline.rigs.tire.passages.blocks import block_means
from pipeline.rigs.tire.passages.moments import Moments
from pipeline.rigs.tire.passages.pieces import Piece
from pipeline.rigs.tire.passages.template import FINE

_MAINS = (50.0, 60.0)
# Seconds that are looked at, samples per second that they are thinned to.
_LOOKED_AT, _RATE = 20.0, 500.0
# The line lies within so many Hz of the mains; other lines (multiples of the speed) within so many more.
_LINE, _BESIDE = 0.3, (1.0, 8.0)
_HIGHER = 3.0
_FEWEST = 500


def mains_hum(stretch: Piece, moments: Moments) -> float:
    """Return the amplitude of a line at 50 or 60 Hz, V; 0 where none is three times as high as all beside it."""
    places = moments.places
    begin = max(int(places[0]), 0)
    end = min(int(places[-1]), begin + int(_LOOKED_AT * stretch.rate), stretch.flex.size)
    i = np.arange(begin, end)
    turn = np.interp(i, places, np.arange(places.size, dtype=float)) + 0.5
    table = np.append(moments.template.values, moments.template.values[0])
    height = np.interp(i, places, moments.fit.amplitude)
    left = stretch.flex[begin:end] - height * np.interp(turn % 1.0 * FINE, np.arange(FINE + 1), table)
    size = max(1, int(stretch.rate / _RATE))
    blocks = block_means(left, size)
    valid = np.isfinite(blocks)
    if blocks.size < _FEWEST or valid.sum() < 0.5 * blocks.size:
        return 0.0
    taper = np.hanning(blocks.size)
    lines = 2.0 * np.abs(np.fft.rfft(np.where(valid, blocks - blocks[valid].mean(), 0.0) * taper)) / taper[valid].sum()
    frequency = np.fft.rfftfreq(blocks.size, size / stretch.rate)
    highest = 0.0
    for mains in _MAINS:
        away = np.abs(frequency - mains)
        line = float(lines[away < _LINE].max(initial=0.0))
        if line > _HIGHER * float(lines[(away > _BESIDE[0]) & (away < _BESIDE[1])].max(initial=0.0)):
            highest = max(highest, line)
    return highest
