"""Standard errors of the longitudinal force that hold on a moving body: what neighbouring revolutions tell (tire.md, 5.11).

A load that changes between the two dips of one passage (wheel hop, a rough road) reads as longitudinal force. The
waveform of that passage cannot tell the two apart, its neighbours can: they scatter by more than its noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.rigs.tire.road.revolution_fit import Forces

# Revolutions whose scatter counts for the one in their middle.
_WINDOW = 61
# Neighbours no farther apart than that are evenly spaced.
_EVEN = 1.6
# Median of the square of a standard normal deviation.
_MEDIAN_SQUARE = 0.4549
# How far the median of so many squares is off by chance, relative (1 sd); so much scatter is no excess.
_CHANCE = 0.35
_FEWEST = 8


def with_scatter(forces: Forces) -> Forces:
    """Return the forces with standard errors of Fx no smaller than what each stands off from between its neighbours.

    The square of that is held against what the errors of the three explain; its running median over 61 revolutions,
    where above 1 by more than chance, widens them. A ramp of the force does not widen: it stands between its
    neighbours, and the few revolutions at its ends move no median.
    """
    at = np.flatnonzero(forces.fits)
    if at.size < _FEWEST:
        return forces
    excess = _excess(forces.time[at], forces.force[at], forces.force_se[at])
    factor = np.ones(len(forces))
    factor[at] = np.sqrt(1.0 + np.where(excess > 2.0 * _CHANCE, excess - 0.5 * _CHANCE, 0.0))
    return replace(forces, force_se=forces.force_se * factor, correlation=forces.correlation / factor)


def _excess(time: np.ndarray, values: np.ndarray, se: np.ndarray) -> np.ndarray:
    """Return scatter over what the errors explain, less 1, shape (m,)."""
    before, after = time[1:-1] - time[:-2], time[2:] - time[1:-1]
    even = np.maximum(before, after) < _EVEN * np.minimum(before, after)
    share = before / (before + after)
    off = values[1:-1] - share * values[2:] - (1.0 - share) * values[:-2]
    variance = se[1:-1] ** 2 + (share * se[2:]) ** 2 + ((1.0 - share) * se[:-2]) ** 2
    ratio = np.full(time.size, np.nan)
    ratio[1:-1] = np.where(even, off**2 / variance / _MEDIAN_SQUARE, np.nan)
    padded = np.pad(ratio, _WINDOW // 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW)
    told = np.isfinite(windows).sum(axis=1) >= _FEWEST
    found = np.zeros(time.size)
    found[told] = np.nanmedian(windows[told], axis=1) - 1.0
    return found
