"""Revolutions whose rotation cannot be: where a passage beside them is not seen, two turns are counted as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.rigs.tire.road.revolution_fit import OUT_OF_STEP, Forces

# Revolutions on either side that tell the rotation, and how far off it may be: two turns for one are 33 or 50 %.
_SIDE, _OFF = 5, 0.15
# Neighbours farther away in turns tell nothing.
_REACH = 12.0


def in_step(forces: Forces) -> Forces:
    """Return the forces with rotation, load and force unknown where the rotation leaves that of both sides.

    A wheel that speeds up or brakes lies between its neighbours; the medians of five on either side bear two wrong ones.
    """
    known = np.flatnonzero(np.isfinite(forces.speed))
    if known.size < 2 * _SIDE + 1:
        return forces
    speed, time = forces.speed[known], forces.time[known]
    before, after = _median(speed, time, -1), _median(speed, time, 1)
    # Beside a standstill one side tells nothing.
    low, high = np.minimum(before, after), np.maximum(before, after)
    odd = np.zeros(len(forces), dtype=bool)
    odd[known] = (speed < (1.0 - _OFF) * low) | (speed > (1.0 + _OFF) * high)
    if not odd.any():
        return forces

    def told(values: np.ndarray) -> np.ndarray:
        return np.where(odd, np.nan, values)

    return replace(
        forces,
        speed=told(forces.speed),
        speed_se=told(forces.speed_se),
        load=told(forces.load),
        load_se=told(forces.load_se),
        force=told(forces.force),
        force_se=told(forces.force_se),
        gain_ratio=told(forces.gain_ratio),
        fits=forces.fits & ~odd,
        reason=np.where(odd, OUT_OF_STEP, forces.reason).astype(forces.reason.dtype),
    )


def _median(speed: np.ndarray, time: np.ndarray, side: int) -> np.ndarray:
    """Return the median rotation of those before (-1) or behind (+1), shape (m,); NaN where fewer than three are near."""
    m = speed.size
    at = np.arange(m)[:, None] + side * np.arange(1, _SIDE + 1)
    inside = (at >= 0) & (at < m)
    at = np.clip(at, 0, m - 1)
    near = inside & (np.abs(time[at] - time[:, None]) * np.median(speed) < _REACH * 2.0 * np.pi)
    values = np.where(near, speed[at], np.nan)
    enough = near.sum(axis=1) >= 3
    found = np.full(m, np.nan)
    found[enough] = np.nanmedian(values[enough], axis=1)
    return found
