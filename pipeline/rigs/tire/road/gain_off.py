"""A flex sensor whose gain is no longer that of the bench, by the film: how far load and force may be off by it.

Which of the two sensors changed cannot be told, so nothing is corrected: errors grow by it, and where it is much the load
is withheld.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.rigs.tire.road.revolution_fit import OTHER_GAIN, Forces

# Revolutions whose median tells the gain; differences that the film's fit on the bench leaves open.
_WINDOW, _FEWEST = 51, 5
_OPEN = 0.02
WITHHELD = 0.10
"""From here on, relative, the flex sensor's gain is not the bench's: no load and no force."""


def gain_off(forces: Forces) -> np.ndarray:
    """Return how far the gain of the flex sensor is off by the film's, relative, shape (m,); 0 where nothing tells it."""
    ratio = np.where(forces.fits | np.isfinite(forces.gain_ratio), forces.gain_ratio, np.nan)
    known = np.flatnonzero(np.isfinite(ratio))
    if known.size < _FEWEST:
        return np.zeros(len(forces))
    padded = np.pad(ratio[known], _WINDOW // 2, constant_values=np.nan)
    median = np.nanmedian(np.lib.stride_tricks.sliding_window_view(padded, _WINDOW), axis=1)
    off = np.interp(forces.time, forces.time[known], median) - 1.0
    return np.where(np.abs(off) > _OPEN, off, 0.0)


def without_lost_gain(forces: Forces, off: np.ndarray) -> Forces:
    """Return the forces without those revolutions in which the flex sensor answers far less than the film."""
    lost = off < -WITHHELD
    reason = np.where(forces.fits & lost, OTHER_GAIN, forces.reason).astype(forces.reason.dtype)
    return replace(forces, fits=forces.fits & ~lost, reason=reason)
