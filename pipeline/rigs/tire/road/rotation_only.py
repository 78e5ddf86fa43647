"""Revolutions of a drive without a bench: time and rotation, no load and no force."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from pipeline.rigs.tire.passages.revolutions import Revolutions
from pipeline.rigs.tire.road.revolution_fit import Forces


def without_forces(block: Revolutions) -> Forces | None:
    """Return times and rotations of a block, everything else unknown; None for a block without revolutions."""
    m = block.times.size
    if not m:
        return None
    unknown = np.full(m, np.nan)
    known = {
        "time": block.times,
        "time_se": block.time_se,
        "speed": block.speed,
        "speed_se": block.speed_se,
        "resistance": block.level,
        "fits": np.zeros(m, dtype=bool),
        "reason": np.zeros(m, dtype=np.uint8),
        "extrapolated": np.zeros(m, dtype=bool),
    }
    return Forces(**{f.name: known.get(f.name, unknown) for f in fields(Forces)})
